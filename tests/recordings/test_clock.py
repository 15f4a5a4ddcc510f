from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gpsim.recordings import clock, signals


def ordered(t, values=None, burst=False):
    values = np.arange(len(t), dtype=float)[:, None] if values is None else values
    return clock.in_order(np.asarray(t, dtype=float), values, jump=1.0, newest_of_burst=burst)


def test_late_messages_are_sorted_in_and_counted():
    t = np.arange(0, 1, 0.01)
    swapped = t.copy()
    swapped[[30, 31, 60, 61]] = t[[31, 30, 61, 60]]
    made = ordered(swapped)
    assert np.array_equal(made.t, t)
    assert dict(made.noticed) == {"out of order": 2}
    assert not made.dropped


def test_duplicates_and_second_values_are_told_apart():
    t = np.repeat(np.arange(0, 1, 0.1), 2)
    values = np.repeat(np.arange(10.0), 2)[:, None]
    values[5] += 1.0
    made = ordered(t, values)
    assert dict(made.dropped) == {"duplicate": 9, "second value at one stamp": 1}
    assert made.rows.tolist() == list(range(1, 20, 2))


def test_jumping_stamps_are_dropped_and_pauses_are_not():
    t = np.arange(0, 10, 0.1)
    t[50:] += 60.0  # a pause
    broken = t.copy()
    broken[[20, 80]] = [4000.0, -3.0]
    made = ordered(broken)
    assert dict(made.dropped) == {"jumping stamp": 2}
    assert np.array_equal(made.t, np.delete(t, [20, 80]))


def test_the_newest_of_a_burst_is_kept_on_receive_time():
    t = np.sort(np.concatenate([np.arange(0, 1, 0.1), [0.3001, 0.3002, 0.3003]]))
    assert dict(ordered(t, burst=True).dropped) == {"older of a burst": 3}
    assert 0.3003 in ordered(t, burst=True).t
    assert dict(ordered(t).noticed) == {"in a burst": 3}


def test_a_clock_set_back_is_a_restart_and_a_late_message_is_none():
    t = np.concatenate([np.arange(0, 5, 0.1), np.arange(2, 4, 0.1), np.arange(1, 4, 0.1)])
    assert clock.restarts(t) == [50, 70]
    late = np.arange(0, 5, 0.1)
    late[[10, 20]] -= 0.25
    assert clock.restarts(late) == []


@settings(deadline=None)
@given(st.integers(0, 2**32 - 1), st.integers(1, 200))
def test_every_row_is_kept_or_dropped_for_a_reason(seed, count):
    rng = np.random.default_rng(seed)
    t = np.round(np.arange(count) * 0.1 + rng.normal(scale=0.1, size=count), 2)
    t[rng.random(count) < 0.05] += 1e4
    made = ordered(t, rng.integers(0, 2, size=(count, 1)).astype(float), burst=bool(seed % 2))
    assert len(made.t) + sum(made.dropped.values()) == count
    assert (np.diff(made.t) > 0).all()
    assert np.array_equal(made.t, t[made.rows])


@pytest.mark.parametrize("delay", [-0.17, 0.0, 0.043, 0.31])
def test_a_known_lag_is_found(delay):
    rng = np.random.default_rng(7)
    step, count = 0.01, 4000
    signal = np.repeat(rng.normal(size=count // 40), 40)
    at = np.arange(count) * step
    response = 0.7 * np.interp(at - delay, at, signal) + rng.normal(scale=0.05, size=count)
    found = signals.estimate_lag(
        ("u", "r"), [(signal[:2000], response[:2000]), (signal[2000:], response[2000:])], step
    )
    assert found.usable
    assert found.lag == pytest.approx(delay, abs=0.006)


def test_unrelated_signals_have_no_usable_lag():
    rng = np.random.default_rng(8)
    assert not signals.estimate_lag(("u", "r"), [(rng.normal(size=3000), rng.normal(size=3000))], 0.01).usable
