"""Whether a slide weighs a tenth of a gram or a hundred tons, the same physics is missing: no bound knows the unit."""

from dataclasses import replace

import numpy as np
import pytest

from gpsim.diagnosis import diagnose
from gpsim.errors import UsageError
from gpsim.simulators import make_simulator

from .truths import mechanical
from .worlds import record

FRICTION = next(t for t in mechanical("slider") if t.family == "coulomb_friction")


def heavier(times):
    """The same motion of a slide whose mass, and whatever pushes it, is so many times as large."""
    recording = record(FRICTION.world, seed=2, episodes=4, steps=50)
    episodes = tuple(replace(e, actions=times * e.actions) for e in recording.episodes)
    masses = {name: times * value for name, value in recording.parameters.items()}
    return replace(recording, episodes=episodes, parameters=masses)


@pytest.mark.parametrize("mass", [1e-12, 1e-4, 1e5, 1e12])
def test_a_slide_of_any_mass_is_diagnosed_alike(mass):
    simulator, answers = make_simulator("slider"), []
    for times in (1.0, mass):
        recording = heavier(times)
        outcome = diagnose(
            recording, simulator, simulator.defaults(recording.parameters), np.random.default_rng(0)
        )
        (effect,) = outcome.diagnosis.effects
        assert effect.family == "coulomb_friction"
        force = effect.parameters["force"]
        answers.append([force.value / times, force.low / times, force.high / times])
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
