"""Clocks put in order, signals on grids, velocities and lags, against closed forms and SciPy."""

import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from gpsim.recordings import clock, signals
from gpsim.recordings.mapping import Smoothing


def ordered(t, values=None, burst=False):
    values = np.arange(len(t), dtype=float)[:, None] if values is None else values
    return clock.in_order(np.asarray(t, dtype=float), values, jump=1.0, newest_of_burst=burst)


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


stamps = st.lists(st.floats(0.001, 0.5), min_size=1, max_size=30).map(lambda steps: np.cumsum([0.0, *steps]))


def test_a_command_at_t_k_counts_at_t_k_despite_rounding_of_absolute_stamps():
    t = 1.7e9 + np.arange(1000) * 0.02
    grid = t[0] + np.arange(1000) / 50.0  # the same times, rounded another way
    assert np.array_equal(clock.held(grid, t, np.arange(1000.0)), np.arange(1000.0))


@settings(deadline=None)
@given(stamps, st.floats(0.01, 0.3), st.integers(0, 2**32 - 1))
def test_the_mean_of_a_held_command_agrees_with_fine_sampling(t, step, seed):
    values = np.random.default_rng(seed).normal(size=len(t))
    at = np.arange(0.0, t[-1] + 2 * step, step)
    fine = (np.arange(4000) + 0.5) / 4000
    expected = [clock.held(a + fine * (b - a), t, values).mean() for a, b in itertools.pairwise(at)]
    assert clock.held_mean(at, t, values) == pytest.approx(
        np.array(expected), abs=5e-3 * np.ptp(values) + 1e-6
    )


@settings(deadline=None)
@given(st.floats(-3, 3), st.floats(-1.5, 1.5), st.floats(-3, 3))
def test_euler_angles_agree_with_scipy(yaw, pitch, roll):
    quaternion = Rotation.from_euler("ZYX", [yaw, pitch, roll]).as_quat()[None]
    for name, angle in (("yaw", yaw), ("pitch", pitch), ("roll", roll)):
        assert clock.euler_angle(-2.0 * quaternion, name)[0] == pytest.approx(angle, abs=1e-7)


STEP = 0.01
T = np.arange(0, 4, STEP)
GAUSSIAN = Smoothing("gaussian", sigma=2.0)
SAVGOL = Smoothing("savgol", window=9, order=3)
PLAIN = Smoothing("none")


@pytest.mark.parametrize(("smoothing", "tolerance"), [(GAUSSIAN, 2e-3), (SAVGOL, 2e-5), (PLAIN, 2e-4)])
def test_a_sine_has_its_analytic_derivative(smoothing, tolerance):
    made = signals.derivative(np.sin(2.0 * T), STEP, smoothing)
    edge = signals.reach(smoothing, derivative=True)
    inner = slice(edge, -edge)
    assert made[inner] == pytest.approx(2.0 * np.cos(2.0 * T)[inner], abs=tolerance)


def test_gaussian_damping_is_what_theory_says():
    # A Gaussian of sigma samples multiplies a sine of angular rate w by exp(-(w sigma step)^2 / 2), a central
    # difference by sin(w step) / (w step).
    rate, smoothing = 30.0, Smoothing("gaussian", sigma=3.0)
    made = signals.derivative(np.sin(rate * T), STEP, smoothing)[50:-50]
    gain = np.exp(-0.5 * (rate * 3.0 * STEP) ** 2) * np.sin(rate * STEP) / (rate * STEP)
    assert made == pytest.approx(gain * rate * np.cos(rate * T)[50:-50], abs=1e-2)


@pytest.mark.parametrize("smoothing", [GAUSSIAN, SAVGOL, PLAIN])
def test_a_piece_shorter_than_the_window_keeps_its_slope_and_place(smoothing):
    for count in range(2, 20):
        values = 5.0 + 1.5 * STEP * np.arange(count)
        assert signals.derivative(values, STEP, smoothing) == pytest.approx(1.5, abs=1e-8)
        assert signals.smoothed(values, smoothing) == pytest.approx(values, abs=1e-9)
