"""Windows of awkward recordings: angles that wrap, many transitions."""

from dataclasses import replace

import numpy as np

from gpsim.channels import wrap_angle
from gpsim.diagnosis.windows import cut
from gpsim.recordings import Recording

from .worlds import World, record


def turned(recording: Recording, angle: float) -> Recording:
    """The same pendulum, its angle counted from elsewhere and wrapped."""
    episodes = []
    for episode in recording.episodes:
        states = np.array(episode.states)
        states[:, 0] = wrap_angle(states[:, 0] + angle)
        episodes.append(replace(episode, states=states))
    return replace(recording, episodes=tuple(episodes))


def test_angles_run_on_inside_a_window_and_before_it():
    recording = turned(record(World("pendulum"), episodes=3, steps=150), np.pi)
    jumps = np.concatenate([np.abs(np.diff(e.states[:, 0])) for e in recording.episodes])
    assert (jumps > np.pi).any()
    windows = cut(recording)
    assert np.abs(np.diff(windows.measured[..., 0], axis=1)).max() < 0.5
    together = np.concatenate([windows.before_states[..., 0], windows.measured[..., :1, 0]], axis=1)
    assert np.abs(np.diff(together, axis=1)).max() < 0.5
    assert np.abs(windows.measured[:, 0, 0]).max() <= np.pi  # each begins where it was recorded


def test_most_windows_are_evenly_spread():
    recording = record(World("slider"), episodes=4, steps=100)
    every, some = cut(recording, 1), cut(recording, 1, most=20)
    assert len(some) == 20 < len(every)
    assert set(some.t[:, 0]) <= set(every.t[:, 0])
    assert set(some.episode) == {0, 1, 2, 3}
