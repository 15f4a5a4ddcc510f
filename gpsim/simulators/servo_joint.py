"""A servo joint: a link that a position servo turns, as hobby servos and the joints of small arms do.

The servo is a proportional-derivative controller with a limited torque: what is commanded is an angle. theta = 0 hangs
down.
"""

from __future__ import annotations

import math
from typing import ClassVar

import numpy as np

from gpsim.channels import Channels, FloatArray
from gpsim.simulators.simulator import SMALLEST, Coordinate, MechanicalSimulator, Parameter, Parameters


class ServoJoint(MechanicalSimulator):
    """State (theta [rad], theta_dot [rad/s]); action target [rad]; rate theta_acc [rad/s^2].

    J theta_acc = clip(kp (target - theta) - kd theta_dot, -limit, limit) - G sin theta (Spong, Hutchinson and
    Vidyasagar, Robot Modeling and Control, section 6.3).
    """

    name: ClassVar[str] = "servo_joint"
    state: ClassVar[Channels] = Channels.of({"theta": "rad", "theta_dot": "rad/s"})
    action: ClassVar[Channels] = Channels.of({"target": "rad"})
    rate: ClassVar[Channels] = Channels.of({"theta_acc": "rad/s^2"})
    coordinates: ClassVar[tuple[Coordinate, ...]] = (Coordinate("theta", "theta_dot", "theta_acc", "N m"),)
    parameters: ClassVar[dict[str, Parameter]] = {
        "inertia": Parameter(
            "kg m^2", 0.01, SMALLEST, math.inf, "of link, load and geared rotor about the joint"
        ),
        "stiffness": Parameter("N m/rad", 5.0, SMALLEST, math.inf, "proportional gain"),
        "damping": Parameter(
            "N m s/rad", 0.3, 0.0, math.inf, "derivative gain, and what the motor brakes by itself"
        ),
        "torque_limit": Parameter("N m", 2.0, SMALLEST, math.inf, "the most that the servo gives"),
        "gravity_torque": Parameter(
            "N m", 0.0, 0.0, math.inf, "weight times its arm, with the link level", additive=0.3
        ),
    }

    def driven(self) -> dict[str, str]:
        """None: what is commanded is an angle, no torque."""
        return {}

    @property
    def served(self) -> tuple[str, ...]:
        """The joint."""
        return ("theta",)

    def given(self, state: FloatArray, action: FloatArray, parameters: Parameters) -> dict[str, FloatArray]:
        """The servo's torque (B,)."""
        limit = parameters["torque_limit"]
        wanted = parameters["stiffness"] * (action[:, 0] - state[:, 0]) - parameters["damping"] * state[:, 1]
        return {"theta": np.minimum(np.maximum(wanted, -limit), limit)}

    def rates(
        self, state: FloatArray, action: FloatArray, parameters: Parameters, forces: FloatArray | None = None
    ) -> FloatArray:
        """Angular acceleration (B, 1)."""
        torque = self.given(state, action, parameters)["theta"]
        torque = torque - parameters["gravity_torque"] * np.sin(state[:, 0])
        if forces is not None:
            torque = torque + forces[:, 0]
        return np.asarray(torque / parameters["inertia"])[:, None]

    def mobility(self, state: FloatArray, parameters: Parameters, coordinate: int) -> FloatArray:
        """One over the inertia."""
        out = np.empty((len(state), 1))
        out[:, 0] = 1.0 / parameters["inertia"]
        return out
