"""A leader that was fitted a little only, from start states that another hypothesis had left."""

import numpy as np
import pytest

from gpsim.diagnosis.fitting.hypothesis import Hypothesis
from gpsim.diagnosis.fitting.multiple_shooting import fit
from gpsim.diagnosis.selection.stepwise import _children, _finished
from gpsim.diagnosis.setup.candidates import candidates
from gpsim.diagnosis.setup.prepare import prepare
from gpsim.effects import Term
from gpsim.simulators import make_simulator

from .truths import delayed, level_filter
from .worlds import World, record

DELAY, RATE = 0.032, 70.0


def limited(level, u, h):
    return level + np.clip(u - level, -RATE * h, RATE * h)


@pytest.mark.parametrize("led_astray", [False, True])
def test_a_new_leader_is_fitted_to_its_end(led_astray):
    rated, late = level_filter(limited), delayed(DELAY)
    world = World(
        "cartpole", filters=[lambda u, t, h, m: late(u, t, h, m), lambda u, t, h, m: rated(u, t, h, m)]
    )
    recording = record(world, seed=2, episodes=6, steps=155, noise=0.0)
    simulator = make_simulator("cartpole")
    known = simulator.defaults(recording.parameters)
    question = prepare(recording, simulator, known)
    problem, starts = question.everything, question.everything.windows.measured[:, 0]
    declared = {c.family: c.declared for c in candidates(question.recording, problem.simulator, known)}
    terms = (
        Term("actuator_delay", "force", {"delay": 0.036}),
        Term("actuator_rate_limit", "force", {"rate": 110.0}),
    )
    hypothesis = Hypothesis(terms, tuple(declared[t.family] for t in terms))
    if led_astray:  # by a hypothesis without the delay
        starts = fit(problem, hypothesis.without(0), starts, iterations=12).starts
    at = fit(problem, hypothesis, starts, iterations=1, near=True)
    ended = _finished(problem, at)
    assert ended.objective < at.objective - 100.0
    np.testing.assert_allclose(ended.hypothesis.theta, [DELAY, RATE], rtol=0.01)


def drag_somewhere(q, v, t):
    return -1.5 * v * ((q > -0.2) & (q < 0.1))


def drag_everywhere(q, v, t):
    return -0.5 * v - 1.0 * v * np.abs(v)


@pytest.mark.parametrize(("force", "somewhere"), [(drag_somewhere, True), (drag_everywhere, False)])
def test_gates_are_tried_at_once_where_what_is_missing_is_far_more_than_a_term_gains(force, somewhere):
    """One term that acts everywhere was added after another in the place of one that acts in a region."""
    recording = record(World("slider", forces={0: force}), seed=5, episodes=8, steps=155, noise=0.1)
    simulator = make_simulator("slider")
    known = simulator.defaults(recording.parameters)
    problem = prepare(recording, simulator, known).everything
    offers = candidates(recording, simulator, known)
    law = next(c for c in offers if c.family == "quadratic_drag")
    hypothesis = Hypothesis().plus(law.term([0.5]), law.declared)
    leader = fit(problem, hypothesis, problem.windows.measured[:, 0])
    children = _children(problem, leader, offers, problem.run.settings.stepwise.budget, gates=False)
    best = min(children, key=lambda f: f.objective).hypothesis.terms[-1]
    assert (best.family, best.on) == ("viscous_friction", "q")
    assert any(term.gate for f in children for term in f.hypothesis.terms) == somewhere
    if somewhere:
        assert best.gate.region["q"] == pytest.approx((-0.2, 0.1), abs=0.005)
