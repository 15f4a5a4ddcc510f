"""Whether a slide weighs a tenth of a gram or a hundred tons, the same physics is missing: no bound knows the unit."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from hypothesis import Phase, given, settings
from hypothesis import strategies as st

from gpsim.diagnosis import diagnose
from gpsim.diagnosis.fitting import Directions, Hypothesis, fit
from gpsim.diagnosis.fitting.score_test import child_of, screened
from gpsim.diagnosis.setup import offers_of, prepare
from gpsim.errors import UsageError
from gpsim.simulators import make_simulator

from .truths import mechanical
from .worlds import record

FRICTION = next(t for t in mechanical("slider") if t.family == "coulomb_friction")
POWERS = st.integers(-12, 12)


def heavier(times):
    """The same motion of a slide whose mass, and whatever pushes it, is so many times as large."""
    recording = record(FRICTION.world, seed=2, episodes=4, steps=50)
    episodes = tuple(replace(e, actions=times * e.actions) for e in recording.episodes)
    masses = {name: times * value for name, value in recording.parameters.items()}
    return replace(recording, episodes=episodes, parameters=masses)


@cache
def found(times):
    """What is screened and fitted first, in units of the base: gains [nats], the friction and what it leaves."""
    recording = heavier(times)
    simulator = make_simulator("slider")
    question = prepare(recording, simulator, simulator.defaults(recording.parameters))
    offers, problem = offers_of(question), question.searched
    start = problem.windows.measured[:, 0]

    null = fit(problem, Hypothesis(), start, iterations=4)
    looks = screened(Directions(problem, null), offers)
    _, best, values = next(look for look in looks if not look[1].only_gated)
    one = fit(problem, child_of(Hypothesis(), best, values), null.starts)
    again = screened(Directions(problem, one), offers)
    gains = {c.name: nats for nats, c, _ in looks} | {f"then {c.name}": nats for nats, c, _ in again}
    return best.name, gains, float(one.hypothesis.theta[0] / times), one.variance


@settings(max_examples=4, deadline=None, phases=[Phase.generate])
@given(POWERS)
def test_what_is_found_does_not_know_the_unit_of_mass(power):
    plain, scaled = found(1.0), found(10.0**power)
    assert scaled[0] == plain[0] == "coulomb_friction on q"
    assert scaled[2] == pytest.approx(plain[2], rel=1e-5)
    np.testing.assert_allclose(scaled[3], plain[3], rtol=1e-5)
    for name, nats in plain[1].items():
        assert scaled[1][name] == pytest.approx(nats, rel=1e-3, abs=1e-3), name


@pytest.mark.slow
@pytest.mark.parametrize("mass", [1e-4, 1e5])
def test_a_slide_of_any_mass_is_diagnosed_alike(mass):
    simulator, answers = make_simulator("slider"), []
    for times in (1.0, mass / 2.0):
        recording = heavier(times)
        outcome = diagnose(
            recording, simulator, simulator.defaults(recording.parameters), np.random.default_rng(0)
        )
        (effect,) = outcome.diagnosis.effects
        force = effect.parameters["force"]
        answers.append([force.value / times, force.low / times, force.high / times, effect.evidence_gain])
    np.testing.assert_allclose(answers[1], answers[0], rtol=1e-3)


@pytest.mark.parametrize(
    ("system", "given", "said"),
    [
        ("slider", {"mass": 0.0}, "mass=0 kg: expected more than 0"),
        ("slider", {"mass": float("inf")}, "mass=inf kg: expected more than 0"),
        ("pendulum", {"gravity": -1.0}, "gravity=-1 m/s\\^2: expected a finite number of at least 0"),
    ],
)
def test_what_no_unit_makes_sense_of_is_refused(system, given, said):
    with pytest.raises(UsageError, match=said):
        make_simulator(system).defaults(given)
