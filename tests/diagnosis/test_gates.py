"""Whether a term could act in a region only, told before anything is fitted."""

import numpy as np

from gpsim.diagnosis.catalogue import candidates
from gpsim.diagnosis.gates import may_be_limited
from gpsim.diagnosis.hypothesis import Hypothesis
from gpsim.diagnosis.preparing import prepare
from gpsim.diagnosis.replacing import left_open
from gpsim.diagnosis.screening import Directions
from gpsim.diagnosis.shooting import fit
from gpsim.simulators import make_simulator

from .worlds import World, record

SLIDER = make_simulator("slider")


def limited(force) -> list[str | None]:
    recording = record(World("slider", forces={0: force}), seed=2, episodes=8, steps=155, session=True)
    problem = prepare(recording, SLIDER, recording.parameters).everything
    drag = next(
        c for c in candidates(recording, SLIDER, recording.parameters) if c.family == "viscous_friction"
    )
    hypothesis = Hypothesis().plus(drag.term([1.0]), drag.declared)
    leader = fit(problem, hypothesis, problem.windows.measured[:, 0])
    without = left_open(problem, leader, 0)
    shared = type(without)(**{**vars(without), "variance": leader.variance})
    values = tuple(leader.hypothesis.theta)
    return may_be_limited(Directions(problem, leader), Directions(problem, shared), drag, values)


def test_a_law_that_acts_everywhere_is_missed_wherever_it_is_taken_away():
    assert limited(lambda q, v, t: -2.0 * v) == []


def test_a_law_that_acts_in_a_region_or_late_is_not():
    assert "q" in limited(lambda q, v, t: -4.0 * v * (q > np.quantile(q, 0.3)))
    assert None in limited(lambda q, v, t: -2.0 * v * (t > 8.0))
