"""Leaving out what is not needed, and gates that look at where the system is, not at where it was measured."""

from dataclasses import replace

import numpy as np
import pytest

from gpsim.diagnosis.fitting.hypothesis import Hypothesis
from gpsim.diagnosis.fitting.multiple_shooting import fit
from gpsim.diagnosis.fitting.score_test import Directions
from gpsim.diagnosis.selection.acceptance import pays
from gpsim.diagnosis.selection.elimination import lean, simplest, without_a_term
from gpsim.diagnosis.setup.candidates import candidates
from gpsim.diagnosis.setup.prepare import prepare
from gpsim.effects import Gate
from gpsim.simulators import make_simulator

from .truths import mechanical
from .worlds import World, record

FRICTION = {"force": 2.5}


@pytest.fixture(scope="module")
def braked():
    """A slider with Coulomb friction everywhere, and the problem that it poses."""
    world = World("slider")
    world.grips[0] = lambda q, v, normal: 2.5 + 0 * q
    recording = record(world, seed=4, noise=0.1, episodes=6)
    simulator = make_simulator("slider")
    question = prepare(recording, simulator, simulator.defaults(recording.parameters))
    return question.everything, candidates(question.recording, simulator, simulator.defaults({}))


def having(braked, *terms):
    """A fit with terms (family, on, values, gate)."""
    problem, offers = braked
    hypothesis = Hypothesis()
    for family, on, values, gate in terms:
        offer = next(c for c in offers if c.identity == (family, on))
        term = replace(offer.term([values[p.name] for p in offer.declared]), gate=gate)
        hypothesis = hypothesis.plus(term, offer.declared)
    return fit(problem, hypothesis, problem.windows.measured[:, 0])


def said(found):
    return [(term.family, term.gate.region) for term in found.hypothesis.terms]


def test_a_gate_and_a_term_that_do_not_pay_go(braked):
    wide = Gate(region={"q": (-100.0, 100.0)})
    start = having(
        braked, ("constant_force", "q", {"force": 0.1}, wide), ("coulomb_friction", "q", FRICTION, Gate())
    )
    assert said(lean(braked[0], start)) == [("coulomb_friction", {})]


def test_what_is_needed_stays(braked):
    start = having(braked, ("coulomb_friction", "q", FRICTION, Gate()))
    assert lean(braked[0], start) is start
    null = fit(braked[0], Hypothesis(), braked[0].windows.measured[:, 0])
    assert all(pays(braked[0], start, less) for less in without_a_term(braked[0], start))
    assert simplest(braked[0], [null, start]) is start


def test_a_special_case_that_does_as_well_is_taken(braked):
    law = {"force": 2.5, "static_force": 2.6, "stribeck_velocity": 0.1}
    rich = having(braked, ("stribeck_friction", "q", law, Gate()))
    plain = having(braked, ("coulomb_friction", "q", FRICTION, Gate()))
    assert said(simplest(braked[0], [rich, plain])) == [("coulomb_friction", {})]
    term = rich.hypothesis.terms[0]
    assert term.effect.special_cases(term.values)["coulomb_friction"] == (term.values["force"],)


def test_what_pays_in_one_window_only_does_not_pay(braked):
    problem = braked[0]
    plain = having(braked, ("coulomb_friction", "q", FRICTION, Gate()))
    spoilt = plain.residuals.copy()
    glitch = 30 * np.sqrt(plain.variance)
    spoilt[7] += glitch
    variance = (spoilt**2).sum(axis=(0, 1)) / problem.counts
    worse = replace(plain, residuals=spoilt, variance=variance)
    richer = having(
        braked, ("constant_force", "q", {"force": 0.01}, Gate()), ("coulomb_friction", "q", FRICTION, Gate())
    )
    half_way = richer.residuals.copy()
    half_way[7] += 0.3 * glitch
    assert not pays(problem, replace(richer, residuals=half_way), worse)
    assert pays(problem, richer, worse)  # what leaves nothing of it explains it


@pytest.mark.parametrize("edges", [(-0.2, 0.3), (0.05, 10.0)])
def test_a_bias_of_the_actuator_in_a_region_is_a_force_in_that_region(braked, edges):
    """Both look at where the body is at every moment, so no data can tell one from the other."""
    problem, offers = braked
    gate = Gate(region={"q": edges})
    residuals = []
    for family, on in (("actuator_bias", "force"), ("constant_force", "q")):
        offer = next(c for c in offers if c.identity == (family, on))
        hypothesis = Hypothesis().plus(replace(offer.term([1.7]), gate=gate), offer.declared)
        starts = problem.windows.measured[:, 0]
        residuals.append(problem.residuals(hypothesis, hypothesis.theta[None], starts[None])[0])
    assert np.abs(residuals[0]).max() > 0
    np.testing.assert_allclose(residuals[0], residuals[1], rtol=0, atol=1e-9)


def test_a_region_a_little_off_is_no_sensor_bias():
    world = World("slider")
    world.grips[0] = lambda q, v, normal: 2.5 * ((q > 0.1) & (q < 0.4))
    recording = record(world, seed=4, noise=0.1, episodes=6)
    simulator = make_simulator("slider")
    parameters = simulator.defaults(recording.parameters)
    patched = (
        prepare(recording, simulator, parameters).everything,
        candidates(recording, simulator, parameters),
    )
    off = Gate(region={"q": (0.104, 0.404)})
    start = having(
        patched,
        ("local_friction_patch", "q", FRICTION, off),
        ("sensor_bias", "q", {"offset": -0.004}, Gate()),
    )
    ((family, region),) = said(lean(patched[0], start))
    assert family == "local_friction_patch"
    np.testing.assert_allclose(region["q"], (0.1, 0.4), atol=2e-3)


def test_what_mends_the_last_digits_of_a_law_goes():
    """With clean sensors it gains thousands of nats, and nearly all of what is left: a millionth of the mismatch."""
    (truth,) = (t for t in mechanical("cartpole") if t.family == "actuator_lag")
    recording = record(truth.world, seed=11, episodes=8, steps=200, noise=0.0)
    simulator = make_simulator("cartpole")
    question = prepare(recording, simulator, simulator.defaults(recording.parameters))
    posed = question.everything, candidates(question.recording, simulator, simulator.defaults({}))
    start = having(
        posed,
        ("actuator_lag", "force", {"time_constant": 0.06}, Gate()),
        ("actuator_delay", "force", {"delay": 5.5e-6}, Gate()),
    )
    assert said(lean(posed[0], start)) == [("actuator_lag", {})]


def test_directions_leave_out_what_the_parameters_could_explain(braked):
    """A gain looks like friction of another size where the pushes are always against it: only what differs counts."""
    problem, _ = braked
    found = having(braked, ("coulomb_friction", "q", FRICTION, Gate()))
    directions = Directions(problem, found)
    theta = found.hypothesis.theta
    own = directions.of(found.hypothesis, np.array([theta * 1.001]))
    alone = problem.residuals(found.hypothesis, np.array([theta * 1.001]), found.starts[None])[0]
    size = (alone - found.residuals)[..., 0] / np.sqrt(found.variance[0])
    assert np.linalg.norm(own) < 0.1 * np.linalg.norm(size)


def test_a_term_whose_region_only_makes_the_grid_finer_goes():
    """A gain of 0.99997 in a region was once named: without it the grid was coarser, which cost 1 400 nats."""
    world = World("pendulum", forces={0: lambda q, v, t: -0.15 * v})
    recording = record(world, seed=2, noise=0.0, episodes=6, dt=0.1)
    simulator = make_simulator("pendulum")
    question = prepare(recording, simulator, simulator.defaults(recording.parameters))
    problem = replace(question.everything, substeps=1, floor=1e-3 * question.everything.floor)
    offers = candidates(question.recording, simulator, simulator.defaults({}))
    viscous = ("viscous_friction", "theta", {"damping": 0.15}, Gate())
    region = Gate(region={"theta": (-50.0, 0.3)})
    idle = ("actuator_gain", "torque", {"gain": 1.00003}, region)
    start = having((problem, offers), viscous, idle)
    assert start.objective < having((problem, offers), viscous).objective - 600.0
    assert said(lean(problem, start)) == [("viscous_friction", {})]


def test_a_hypothesis_is_integrated_as_finely_as_another(braked):
    problem = braked[0]
    plain = Hypothesis()
    gated = having(braked, ("constant_force", "q", {"force": 0.1}, Gate(region={"q": (0.0, 1.0)}))).hypothesis
    assert problem.as_finely(plain, gated).substeps == 2 * problem.substeps
    assert problem.as_finely(gated, plain) is problem
    assert problem.as_finely(plain, plain) is problem
    assert problem.as_finely(replace(plain, scheme="euler"), gated) is problem
