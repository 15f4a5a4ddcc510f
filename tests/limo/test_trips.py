"""Deployments from logs: one each, though the cameras lost the robot on its way."""

import numpy as np

from gpsim.channels import Channels
from gpsim.recordings import Episode, Recording
from gpsim.stages.evaluate_deployed import trip, trips


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
    path, reached = trip(whole, np.array([0.805, 0.0]), 0.06)
    assert reached
    assert round((whole.t[len(path) - 1] - whole.t[0]) / 0.1) == 75  # the five steps nobody saw among them
    assert np.isnan(whole.actions).any(axis=1).sum() == 1
    assert [len(e) for _, e in trips(recording, whole=False)] == [40, 55, 30]
