"""Deployments from logs: one each, though the cameras lost the robot on its way."""

from dataclasses import replace

import numpy as np
import pytest

from gpsim.channels import Channels
from gpsim.recordings import Episode, Recording
from gpsim.stages.evaluate_deployed import Ended, trip, trips
from gpsim.tasks import GoalReaching


def drive(name: str, first: int, last: int) -> Episode:
    """A robot that moves 1 cm a step along x; its clock starts with the episode."""
    k = np.arange(first, last + 1)
    states = np.stack([0.01 * k, 0.0 * k, 0.0 * k], axis=1)
    return Episode(name, 0.1 * (k - first), states, np.ones((last - first, 2)))


def test_pieces_of_one_log_are_one_trip():
    episodes = (drive("0", 0, 40), drive("1", 45, 100), drive("2", 0, 30))
    sources = {
        "0": {"log": "a.bag", "epoch_s": 5.0, "start_s": 1.0},
        "1": {"log": "a.bag", "epoch_s": 5.0, "start_s": 5.5},
        "2": {"log": "b.bag", "epoch_s": 9.0, "start_s": 0.0},
    }
    recording = Recording(
        "unicycle",
        Channels.of({"x": "m", "y": "m", "yaw": "rad"}, ("yaw",)),
        Channels.of({"v_cmd": "m/s", "w_cmd": "rad/s"}),
        episodes,
        0.1,
        provenance={"sources": sources},
    )
    (first, whole), (second, other) = trips(recording, whole=True)
    assert (first, second) == ("0 (a.bag)", "2 (b.bag)")
    assert len(other) == 30
    path, ended = trip(whole, GoalReaching(), np.array([0.805, 0.0]), 0.06, 0.1)
    assert ended is Ended.REACHED
    assert round((whole.t[len(path) - 1] - whole.t[0]) / 0.1) == 75  # the five steps nobody saw among them
    assert np.isnan(whole.actions).any(axis=1).sum() == 1
    assert [len(e) for _, e in trips(recording, whole=False)] == [40, 55, 30]


@pytest.mark.parametrize(
    ("settings", "ended", "steps"),
    [
        ({}, Ended.REACHED, 75),
        ({"max_steps": 75}, Ended.REACHED, 75),  # in the last step that there is
        ({"max_steps": 74}, Ended.LATE, 74),
        ({"floor": 1.0}, Ended.LEFT, 51),
        ({"floor": 1.5}, Ended.REACHED, 75),  # on the edge is inside
        ({"max_steps": 50, "floor": 1.0}, Ended.LATE, 50),
    ],
)
def test_a_recorded_trip_is_over_when_a_simulated_one_is(settings, ended, steps):
    goal = np.array([0.80, 0.0])
    path, how = trip(drive("0", 0, 100), GoalReaching(**settings), goal, 0.0501, 0.1)
    assert (how, len(path) - 1) == (ended, steps)


def test_a_log_that_ends_early_is_not_out_of_time():
    far, task = np.array([1.8, 0.0]), GoalReaching(max_steps=100)
    assert trip(drive("0", 0, 90), task, far, 0.05, 0.1)[1] is Ended.LOG
    assert trip(drive("0", 0, 100), task, far, 0.05, 0.1)[1] is Ended.LATE
    late = replace(drive("0", 0, 100), t=0.1003 * np.arange(101) + 1e9)  # a clock that jitters, far from zero
    assert trip(late, task, np.array([1.0, 0.0]), 0.001, 0.1)[1] is Ended.REACHED
    # Recorded at another pace than that of the commands.
    assert len(trip(drive("0", 0, 400), GoalReaching(max_steps=20), far, 0.05, 0.2)[0]) == 41
