"""A push from outside is left out; what a machine does wherever it is in the same state is not."""

import numpy as np
import pytest

from gpsim.diagnosis.data import stretches
from gpsim.diagnosis.selection import without_outside_acts

from . import laws
from .worlds import World


def explained(force):
    world = World("slider", forces={0: lambda q, v, t: -1.2 * v + force(q, v, t)})
    question, leader = laws.explained_by(world, ("viscous_friction", "q"), session=True)
    return question, without_outside_acts(question, leader.hypothesis, question.recording)


def hand(q, v, t):
    """25 N for a quarter of a second."""
    return np.where((t > 12.0) & (t < 12.25), 25.0, 0.0)


def test_a_push_by_hand_is_left_out_and_becomes_a_gap():
    question, (recording, fact) = explained(hand)
    assert (fact.kind, fact.unit) == ("pushed", "s")
    assert fact.value == pytest.approx(12.0, abs=1.0)
    gone = [e.t[e.weights[:, 0] == 0.0] for e in recording.episodes if e.weights is not None]
    times = np.concatenate(gone)
    assert fact.count == len(times) < 0.03 * sum(len(e.t) for e in recording.episodes)
    assert times.min() <= 12.0 + recording.dt
    assert times.max() >= 12.25 - recording.dt
    whole, kept = (
        sum(last + 1 - first for _, first, last in stretches(r)) for r in (question.recording, recording)
    )
    assert kept == whole - fact.count


@pytest.mark.parametrize(
    "force", [lambda q, v, t: 0.0 * t, lambda q, v, t: -900.0 * np.maximum(q - 0.5, 0.0)]
)
def test_what_a_machine_does_itself_stays(force):
    assert explained(force)[1] is None
