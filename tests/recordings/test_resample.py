from __future__ import annotations

import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from gpsim.recordings import clock

stamps = st.lists(st.floats(0.001, 0.5), min_size=1, max_size=30).map(lambda steps: np.cumsum([0.0, *steps]))


def test_a_command_is_the_one_standing_from_t_k_to_t_k_plus_1():
    given_at, values = np.array([0.0, 0.1, 0.25]), np.array([1.0, 2.0, 3.0])
    at = np.array([0.0, 0.05, 0.0999, 0.1, 0.2, 0.25, 9.0])
    assert clock.held(at, given_at, values).tolist() == [1, 1, 1, 2, 2, 3, 3]


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
@given(stamps, st.floats(-20, 20), st.floats(-3, 3))
def test_a_turning_angle_is_interpolated_the_short_way_round(t, start, rate):
    turning = start + rate * t  # at most 1.5 rad a step
    wrapped = (turning + np.pi) % (2 * np.pi) - np.pi
    at = np.linspace(t[0], t[-1], 57)
    error = clock.linear(at, t, clock.unwrapped(wrapped)) - (start + rate * at)
    assert np.abs((error + np.pi) % (2 * np.pi) - np.pi).max() < 1e-9


def test_quaternions_keep_a_constant_rate_whatever_their_sign():
    axis = np.array([0.2, -0.5, 0.8]) / np.linalg.norm([0.2, -0.5, 0.8])
    t = np.linspace(0.0, 2.0, 21)
    quaternions = Rotation.from_rotvec(axis * (1.7 * t)[:, None]).as_quat()
    quaternions[::3] *= -1.0
    at = np.linspace(0.0, 2.0, 333)
    error = (
        Rotation.from_quat(clock.slerp(at, t, quaternions))
        * Rotation.from_rotvec(axis * (1.7 * at)[:, None]).inv()
    )
    assert error.magnitude().max() < 1e-7


@settings(deadline=None)
@given(st.floats(-3, 3), st.floats(-1.5, 1.5), st.floats(-3, 3))
def test_euler_angles_agree_with_scipy(yaw, pitch, roll):
    quaternion = Rotation.from_euler("ZYX", [yaw, pitch, roll]).as_quat()[None]
    for name, angle in (("yaw", yaw), ("pitch", pitch), ("roll", roll)):
        assert clock.euler_angle(-2.0 * quaternion, name)[0] == pytest.approx(angle, abs=1e-7)
