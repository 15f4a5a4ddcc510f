from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import savgol_filter

from gpsim.recordings import signals
from gpsim.recordings.mapping import Smoothing

STEP = 0.01
T = np.arange(0, 4, STEP)
GAUSSIAN = Smoothing("gaussian", sigma=2.0)
SAVGOL = Smoothing("savgol", window=9, order=3)
PLAIN = Smoothing("none")


@pytest.mark.parametrize("smoothing", [GAUSSIAN, SAVGOL, PLAIN])
def test_a_straight_line_has_its_slope_up_to_the_ends(smoothing):
    assert signals.derivative(3.0 - 1.7 * T, STEP, smoothing) == pytest.approx(-1.7, abs=1e-9)


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


def test_edges_are_no_reflection():
    # A reflected end has slope 0; the one-sided fit keeps the slope of a parabola to first order.
    slope = signals.derivative(T**2 + T, STEP, GAUSSIAN)
    assert slope[0] > 0.9
    assert slope[-1] == pytest.approx(2.0 * T[-1] + 1.0, rel=0.05)


def test_savgol_agrees_with_scipy_inside():
    values = np.random.default_rng(0).normal(size=200).cumsum()
    expected = savgol_filter(values, 9, 3, deriv=1, delta=STEP)
    assert signals.derivative(values, STEP, SAVGOL)[4:-4] == pytest.approx(expected[4:-4], rel=1e-9)


def test_smoothing_takes_noise_away_and_leaves_the_signal():
    noise = np.random.default_rng(3).normal(scale=0.01, size=len(T))
    made = signals.smoothed(np.sin(T) + noise, GAUSSIAN)
    assert np.std(made - np.sin(T)) < 0.5 * np.std(noise)


def test_short_pieces_do_not_fail():
    for count in range(1, 12):
        for smoothing in (GAUSSIAN, SAVGOL, PLAIN):
            assert np.isfinite(signals.derivative(np.arange(count, dtype=float), STEP, smoothing)).all()
            assert np.isfinite(signals.smoothed(np.arange(count, dtype=float), smoothing)).all()


@pytest.mark.parametrize("smoothing", [GAUSSIAN, SAVGOL, PLAIN])
def test_a_piece_shorter_than_the_window_keeps_its_slope_and_place(smoothing):
    for count in range(2, 20):
        values = 5.0 + 1.5 * STEP * np.arange(count)
        assert signals.derivative(values, STEP, smoothing) == pytest.approx(1.5, abs=1e-8)
        assert signals.smoothed(values, smoothing) == pytest.approx(values, abs=1e-9)
