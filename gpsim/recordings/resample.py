"""Values at other times: linear, on the circle, on the rotation group, held, and averaged while held."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation, Slerp

from gpsim.channels import FloatArray

# Absolute stamps (about 1.7e9 s) in double precision are a quarter of a microsecond apart: a command
# that arrives within this of t_k was given at t_k, not one step later.
TOLERANCE = 1e-6


def linear(at: FloatArray, t: FloatArray, values: FloatArray) -> FloatArray:
    """Values (M,) at times `at` inside [t[0], t[-1]] from values (N,) at t (N,) s."""
    return np.asarray(np.interp(at, t, values), dtype=np.float64)


def unwrapped(angles: FloatArray) -> FloatArray:
    """Angles [rad] made continuous: each step the short way round."""
    return np.asarray(np.unwrap(angles), dtype=np.float64)


def slerp(at: FloatArray, t: FloatArray, quaternions: FloatArray) -> FloatArray:
    """Quaternions (M, 4) x y z w at times `at`: constant rate on the shortest arc (Shoemake 1985).

    q and -q are the same rotation and may alternate in the input. Where `at` is a stamp, that rotation
    is returned.
    """
    if len(t) == 1:
        return np.repeat(quaternions, len(at), axis=0)
    return np.asarray(Slerp(t, Rotation.from_quat(quaternions))(np.clip(at, t[0], t[-1])).as_quat())


def euler_angle(quaternions: FloatArray, name: str) -> FloatArray:
    """roll, pitch or yaw [rad] (N,) of quaternions (N, 4): R = Rz(yaw) Ry(pitch) Rx(roll) (REP 103).

    x y z w. Written out, because SciPy warns at pitch = +-90 degrees, where only yaw - roll is defined.
    """
    x, y, z, w = (quaternions / np.linalg.norm(quaternions, axis=1, keepdims=True)).T
    if name == "yaw":
        angle = np.arctan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))
    elif name == "roll":
        angle = np.arctan2(2.0 * (w * x + y * z), 1.0 - 2.0 * (x * x + y * y))
    else:
        angle = np.arcsin(np.clip(2.0 * (w * y - z * x), -1.0, 1.0))
    return np.asarray(angle, dtype=np.float64)


def held(at: FloatArray, t: FloatArray, values: FloatArray) -> FloatArray:
    """The value standing at each time: the last one given at or before it (zero-order hold).

    Before t[0] nothing was commanded; callers start episodes no earlier (the first value is returned).
    """
    index = np.searchsorted(t, at + TOLERANCE, side="right") - 1
    return values[np.clip(index, 0, len(t) - 1)]


def held_mean(at: FloatArray, t: FloatArray, values: FloatArray) -> FloatArray:
    """Time average (M - 1,) of the held signal over each interval [at_k, at_k+1]."""
    ends = np.concatenate([t, [max(at[-1], t[-1])]])
    area = np.concatenate([[0.0], np.cumsum(values * np.diff(ends))])
    before = np.clip(at, t[0], None)
    integral = np.interp(before, ends, area) + np.minimum(at - t[0], 0.0) * values[0]
    return np.asarray(np.diff(integral) / np.diff(at), dtype=np.float64)
