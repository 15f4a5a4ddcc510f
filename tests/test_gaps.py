"""Gaps of a clock: what counts as one, and how many control steps it hides."""

import numpy as np

from gpsim.channels import Channels
from gpsim.recordings.episodes import OverGaps, gaps, steps_to_next


def test_a_jittering_clock_has_none_and_lost_rows_are_counted():
    t = np.array([0.0, 0.1, 0.25, 0.3, 0.5, 1.1])
    assert gaps(t, 0.1).tolist() == [False, False, False, True, True]
    assert steps_to_next(t, np.zeros(6, dtype=int), 0.1).tolist() == [1, 1, 1, 2, 6, 1]


def test_between_episodes_nothing_is_lost():
    t, episode = np.array([0.0, 0.1, 5.0, 5.1, 0.0]), np.array([0, 0, 1, 1, 2])
    assert steps_to_next(t, episode, 0.1).tolist() == [1] * 5


def test_what_stood_over_gaps_goes_with_the_rows_before_them():
    """Two gaps in a row, one at an episode's start, one at its end."""
    over = np.array([False, True, True, False, True, False, False, True])
    episode = np.array([0, 0, 0, 0, 1, 1, 1, 1])
    t, actions = np.arange(8.0), 10.0 * np.arange(8.0)[:, None]
    found = OverGaps.of(over, episode, t, actions)
    assert found.after.tolist() == [0, 0, 3]
    assert found.actions[:, 0].tolist() == [10.0, 20.0, 70.0]
    whole, numbers, clock, own = found.put_back(actions[~over], episode[~over], t[~over])
    assert clock.tolist() == (whole[:, 0] / 10.0).tolist() == [0, 1, 2, 3, 5, 6, 7]
    assert numbers.tolist() == [0, 0, 0, 0, 1, 1, 1]
    assert own.tolist() == [True, False, False, True, True, True, False]
    part = found.take(np.array([False, True, False, True]))
    assert (part.after.tolist(), part.t.tolist()) == ([1], [7.0])
    assert OverGaps.of(np.zeros(8, dtype=bool), episode, t, actions) is None
    back = OverGaps.from_table(found.to_table(Channels.of({"u": "V"})))
    assert all((getattr(back, name) == value).all() for name, value in vars(found).items())
