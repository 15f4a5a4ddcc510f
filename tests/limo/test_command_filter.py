"""The command filter: against a fine simulation of delay and lag, and found again from its own answer."""

import numpy as np
import pytest

from gpsim.corrected import CommandFilter, fit_filter, settled_rows
from gpsim.errors import UsageError
from gpsim.recordings.episodes import OverGaps, gaps

FILTER = CommandFilter((0.13, 0.0), (0.11, 0.25), 0.1)


def commands(rng, rows, hold):
    return np.repeat(rng.uniform(-1.0, 1.0, (rows // hold, 2)), hold, axis=0)


def clock(rows):
    return 0.1 * np.arange(rows)


def test_it_is_a_delay_and_a_lag():
    """Against an Euler integration a thousand times finer."""
    rng = np.random.default_rng(0)
    actions = commands(rng, 40, 2)
    fine = 1000
    memory, out = FILTER.begin(1), []
    for action in actions:
        out.append(FILTER.step(action[None], memory)[0])
    for i in range(2):
        late = round(FILTER.delay[i] / 0.1 * fine)
        sent = np.concatenate([np.zeros(late), np.repeat(actions[:, i], fine)])[: 40 * fine]
        level, means = 0.0, []
        for u in sent:
            level += 0.1 / fine / FILTER.time_constant[i] * (u - level)
            means.append(level)
        np.testing.assert_allclose(np.array(out)[:, i], np.reshape(means, (40, fine)).mean(axis=1), atol=2e-3)


def test_delay_and_lag_are_found_again():
    rng = np.random.default_rng(2)
    actions = commands(rng, 600, 6)
    episode = np.repeat([0, 1, 2], 200)
    true = CommandFilter((0.13, 0.06), (0.11, 0.25), 0.1)

    def rates_of(arrived):
        return np.column_stack([arrived[:, 0], np.tanh(arrived[:, 1]) + 0.2 * arrived[:, 0]])

    measured = rates_of(true.arrived(actions, episode, clock(600))) + 0.01 * rng.standard_normal((600, 2))
    found = fit_filter(actions, episode, clock(600), measured, rates_of, 0.1)
    np.testing.assert_allclose(found.delay, true.delay, atol=0.01)
    np.testing.assert_allclose(found.time_constant, true.time_constant, atol=0.015)


def lossy(actions, episode, t, lost):
    """The rows whose transition is no gap once the samples `lost` are gone, and what stood over the gaps."""
    kept = np.setdiff1d(np.arange(len(t)), lost)
    actions, episode, t = actions[kept], episode[kept], t[kept]
    over = np.append(gaps(t, 0.1) & (np.diff(episode) == 0), False)
    return kept[~over], OverGaps.of(over, episode, t, actions)


def test_commands_that_change_where_rows_are_lost_arrive_as_if_none_were():
    """The command changes at the last row before each gap, and at the lone row between two of them."""
    rng = np.random.default_rng(5)
    actions, episode = rng.uniform(-1.0, 1.0, (40, 2)), np.repeat([0, 1], 20)
    for first, last in ((5, 8), (9, 13), (27, 30)):
        actions[first : last + 1] = actions[first]
    whole = FILTER.arrived(actions, episode, clock(40))
    kept, over_gaps = lossy(actions, episode, clock(40), [6, 7, 8, 10, 11, 12, 13, 28, 29, 30])
    assert not np.isin([5, 9, 27], kept).any()
    found = FILTER.arrived(actions[kept], episode[kept], clock(40)[kept], over_gaps)
    np.testing.assert_array_equal(found, whole[kept])


def test_delay_and_lag_are_found_where_commands_change_before_gaps():
    """Every change of the command is at the last row before a gap; without what stood there the filter seems quick."""
    rng = np.random.default_rng(6)
    actions, episode, t = commands(rng, 1200, 12), np.repeat([0, 1], 600), clock(1200)
    true = CommandFilter((0.13, 0.06), (0.11, 0.25), 0.1)
    measured = true.arrived(actions, episode, t) + 0.01 * rng.standard_normal((1200, 2))
    kept, over_gaps = lossy(actions, episode, t, np.arange(0, 1200, 12) + 1)
    rows = actions[kept], episode[kept], t[kept], measured[kept], lambda arrived: arrived, 0.1
    found = fit_filter(*rows, over_gaps)
    total = np.add(true.delay, true.time_constant)
    np.testing.assert_allclose(np.add(found.delay, found.time_constant), total, atol=0.01)
    without = fit_filter(*rows)
    assert (np.add(without.delay, without.time_constant) < total - 0.1).all()


def test_settled_rows_are_those_that_have_stood_and_over_a_gap_another_command_may_have():
    actions = np.array([[1.0], [1.0], [1.0], [2.0], [2.0], [2.0], [2.0], [2.0]])
    episode, t = np.array([0, 0, 0, 0, 0, 0, 1, 1]), clock(8)
    assert np.flatnonzero(settled_rows(actions, episode, t, 1, 0.1)).tolist() == [1, 2, 4, 5, 7]
    assert np.flatnonzero(settled_rows(actions, episode, t, 2, 0.1)).tolist() == [2, 5]
    t[2:] += 0.1
    assert np.flatnonzero(settled_rows(actions, episode, t, 1, 0.1)).tolist() == [1, 4, 5, 7]


def test_round_trip_and_foreign_content():
    assert CommandFilter.from_json(FILTER.to_json()) == FILTER
    with pytest.raises(UsageError, match="not a command filter"):
        CommandFilter.from_json({"delay": [0.1]})
