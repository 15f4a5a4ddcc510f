"""Screening: what a term promises before it is fitted."""

import pytest

from gpsim.diagnosis.fitting.hypothesis import Hypothesis
from gpsim.diagnosis.fitting.multiple_shooting import fit
from gpsim.diagnosis.fitting.score_test import Directions, child_of, screened
from gpsim.diagnosis.setup.candidates import candidates
from gpsim.diagnosis.setup.prepare import prepare
from gpsim.simulators import make_simulator

from .worlds import World, record


def test_a_small_change_promises_more_where_motion_is_sensitive():
    """What a tenth more of gravity does to a pendulum within two seconds is no line any more."""
    recording = record(
        World("pendulum", parameters={"gravity": 0.95 * 9.81}),
        seed=5,
        episodes=6,
        noise=0.1,
        dt=0.06,
        hold=12,
    )
    simulator = make_simulator("pendulum")
    parameters = simulator.defaults(recording.parameters)
    question = prepare(recording, simulator, parameters)
    problem = question.searched
    null = fit(problem, Hypothesis(), problem.windows.measured[:, 0], iterations=8)
    directions = Directions(problem, null)
    worth, best, start = screened(directions, candidates(question.recording, simulator, parameters))[0]
    assert best.identity == ("parameter_offset", "gravity")
    assert start == pytest.approx((1.005,))
    large = child_of(null.hypothesis, best, (1.1,))
    assert worth > 1.3 * directions.gains(large, large.theta[None])[0]
