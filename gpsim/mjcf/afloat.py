"""The axes of a body that floats: how fast it moves along its own ones, and what a force along one of them does."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gpsim.channels import Channels, FloatArray
from gpsim.mjcf.naming import MOTIONS, POSE, TWIST, Names


@dataclass(frozen=True)
class Axis:
    """One of the six: velocities and orientation are in these columns of a state, dofs in the model.

    axis: 0 to 2, of the body's own frame. A free joint's linear velocities are in the world, its angular ones and their
    forces in the body (MuJoCo's).
    """

    axis: int
    linear: bool
    velocities: tuple[int, ...]
    orientation: tuple[int, ...]
    dofs: tuple[int, ...]

    def along(self, state: FloatArray) -> tuple[FloatArray, FloatArray]:
        """(B,) m/s or rad/s along it or about it in states (B, S), and (B, 3) its direction in their frame."""
        if not self.linear:
            return state[:, self.velocities[self.axis]], np.tile(np.eye(3)[self.axis], (len(state), 1))
        w, *v = state[:, self.orientation].T
        i, j, k = self.axis, (self.axis + 1) % 3, (self.axis + 2) % 3
        out = np.empty((len(state), 3))
        out[:, i] = w * w + v[i] * v[i] - v[j] * v[j] - v[k] * v[k]
        out[:, j] = 2.0 * (v[i] * v[j] + w * v[k])
        out[:, k] = 2.0 * (v[i] * v[k] - w * v[j])
        out /= (state[:, self.orientation] ** 2).sum(axis=1)[:, None]
        return np.asarray((out * state[:, self.velocities]).sum(axis=1)), out


def axes_of(names: Names, state: Channels) -> dict[str, Axis]:
    """Of every free joint the axes of its body by their places, in these channels."""
    found = {}
    for joint in names.free:
        orientation = tuple(state.index(f"{joint}.{part}") for part in POSE[3:])
        for i, motion in enumerate(MOTIONS):
            half = 3 * (i // 3)
            velocities = tuple(state.index(f"{joint}.{part}") for part in TWIST[half : half + 3])
            places = POSE[:3] if half == 0 else MOTIONS[3:]
            dofs = tuple(names.dof(f"{joint}.{part}") for part in places)
            found[f"{joint}.{motion}"] = Axis(i - half, half == 0, velocities, orientation, dofs)
    return found
