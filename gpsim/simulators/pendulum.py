"""The pendulum: a point mass on a massless rod about a frictionless pivot with a motor. theta = 0 hangs down."""

from __future__ import annotations

import math
from typing import ClassVar

import numpy as np

from gpsim.channels import Channels, FloatArray
from gpsim.simulators.simulator import SMALLEST, Coordinate, MechanicalSimulator, Parameter, Parameters


class Pendulum(MechanicalSimulator):
    """State (theta [rad, 0 hanging], theta_dot [rad/s]); action torque [N m]; rate theta_acc [rad/s^2].

    m l^2 theta_acc = torque - m g l sin theta (Goldstein, Classical Mechanics, 3rd ed., section 1.4).
    """

    name: ClassVar[str] = "pendulum"
    state: ClassVar[Channels] = Channels.of({"theta": "rad", "theta_dot": "rad/s"})
    action: ClassVar[Channels] = Channels.of({"torque": "N m"})
    rate: ClassVar[Channels] = Channels.of({"theta_acc": "rad/s^2"})
    coordinates: ClassVar[tuple[Coordinate, ...]] = (Coordinate("theta", "theta_dot", "theta_acc", "N m"),)
    parameters: ClassVar[dict[str, Parameter]] = {
        "gravity": Parameter("m/s^2", 9.81, 0.0, math.inf, "acceleration of free fall"),
        "mass": Parameter("kg", 1.0, SMALLEST, math.inf, "mass of the bob"),
        "length": Parameter("m", 0.5, SMALLEST, math.inf, "pivot to the bob"),
    }

    def rates(
        self, state: FloatArray, action: FloatArray, parameters: Parameters, forces: FloatArray | None = None
    ) -> FloatArray:
        """Angular acceleration (B, 1)."""
        g, m, length = parameters["gravity"], parameters["mass"], parameters["length"]
        torque = action[:, 0] if forces is None else action[:, 0] + forces[:, 0]
        theta_acc = (torque / (m * length) - g * np.sin(state[:, 0])) / length
        return np.asarray(theta_acc)[:, None]

    def mobility(self, state: FloatArray, parameters: Parameters, coordinate: int) -> FloatArray:
        """One over the moment of inertia."""
        m, length = parameters["mass"], parameters["length"]
        out = np.empty((len(state), 1))
        out[:, 0] = 1.0 / (m * length * length)
        return out
