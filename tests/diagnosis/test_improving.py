"""A leader that was fitted a little only, from start states that another hypothesis had left."""

import numpy as np
import pytest

from gpsim.diagnosis.catalogue import candidates
from gpsim.diagnosis.hypothesis import Hypothesis
from gpsim.diagnosis.improving import _ended
from gpsim.diagnosis.preparing import prepare
from gpsim.diagnosis.shooting import fit
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
    ended = _ended(problem, at)
    assert ended.objective < at.objective - 100.0
    np.testing.assert_allclose(ended.hypothesis.theta, [DELAY, RATE], rtol=0.01)
