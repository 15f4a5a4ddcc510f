"""The axes of a body that floats: how fast it moves along its own ones, and what a force along one of them does."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gpsim.channels import Channels, FloatArray
from gpsim.mjcf.naming import MOTIONS, POSE, TWIST, Names
from gpsim.mjcf.native import rotation


@dataclass(frozen=True)
class Axis:
    """One of the six: velocities and orientation are in these columns of a state, dofs in the model.

    axis: 0 to 2, of the body's own frame. A free joint's linear velocities are in the world, its angular ones and their
    forces in the body (MuJoCo's).
    """

    joint: str
    axis: int
    linear: bool
    velocities: tuple[int, ...]
    orientation: tuple[int, ...]
    dofs: tuple[int, ...]

    @classmethod
    def of(cls, place: str, names: Names, state: Channels) -> Axis | None:
        """The axis of a place in these channels; None of one that is at no free joint."""
        if (free := names.afloat(place)) is None:
            return None
        (joint, dof), half = free, 3 * (free[1] // 3)
        twist = [f"{joint}.{part}" for part in TWIST[half : half + 3]]
        return cls(
            joint,
            dof - half,
            half == 0,
            tuple(state.index(name) for name in twist),
            tuple(state.index(f"{joint}.{part}") for part in POSE[3:]),
            tuple(names.dof(f"{joint}.{part}") for part in (POSE[:3] if half == 0 else MOTIONS[3:])),
        )

    def direction(self, state: FloatArray) -> FloatArray:
        """(B, 3) in the frame of its velocities, in states (B, S)."""
        if not self.linear:
            return np.tile(np.eye(3)[self.axis], (len(state), 1))
        quat = state[:, self.orientation]
        return rotation(quat / np.linalg.norm(quat, axis=1, keepdims=True))[:, :, self.axis]

    def speed(self, state: FloatArray) -> FloatArray:
        """(B,) m/s or rad/s along it or about it."""
        return np.asarray((self.direction(state) * state[:, self.velocities]).sum(axis=1))
