"""What every vehicle in the plane shares: a pose, and the body's twist (v, v_lateral, w) as its rates."""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from gpsim.channels import Channels, FloatArray, difference
from gpsim.simulators.simulator import Simulator


class PlanarVehicle(Simulator):
    """State is the pose (x, y [m], yaw [rad, wraps]); rates are v, v_lateral [m/s, forward and left], w [rad/s]."""

    state: ClassVar[Channels] = Channels.of({"x": "m", "y": "m", "yaw": "rad"}, wraps=("yaw",))
    rate: ClassVar[Channels] = Channels.of({"v": "m/s", "v_lateral": "m/s", "w": "rad/s"})

    def derivative(self, state: FloatArray, rates: FloatArray) -> FloatArray:
        """The twist turned into the world's frame."""
        sin, cos = np.sin(state[:, 2]), np.cos(state[:, 2])
        v, lateral, w = rates[:, 0], rates[:, 1], rates[:, 2]
        out = np.empty((len(state), 3))
        out[:, 0] = v * cos - lateral * sin
        out[:, 1] = v * sin + lateral * cos
        out[:, 2] = w
        return out

    def measured_rates(self, state: FloatArray, next_state: FloatArray, dt: FloatArray) -> FloatArray:
        """The displacement over dt in the body's frame at the step's start: the inverse of an Euler step."""
        dx, dy, dyaw = (difference(next_state, state, self.state) / dt[:, None]).T
        sin, cos = np.sin(state[:, 2]), np.cos(state[:, 2])
        return np.stack([dx * cos + dy * sin, dy * cos - dx * sin, dyaw], axis=1)
