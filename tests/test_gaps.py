"""Gaps of a clock: what counts as one, and how many control steps it hides."""

import numpy as np

from gpsim.gaps import gaps, steps_to_next


def test_a_jittering_clock_has_none_and_lost_rows_are_counted():
    t = np.array([0.0, 0.1, 0.25, 0.3, 0.5, 1.1])
    assert gaps(t, 0.1).tolist() == [False, False, False, True, True]
    assert steps_to_next(t, np.zeros(6, dtype=int), 0.1).tolist() == [1, 1, 1, 2, 6, 1]


def test_between_episodes_nothing_is_lost():
    t, episode = np.array([0.0, 0.1, 5.0, 5.1, 0.0]), np.array([0, 0, 1, 1, 2])
    assert steps_to_next(t, episode, 0.1).tolist() == [1] * 5
