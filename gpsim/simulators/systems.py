"""The systems that come with gpsim, and the registry through which they are found.

Each is its law without friction, lag or noise: what else a machine does is for the diagnosis to find.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from typing import ClassVar

import numpy as np

from gpsim.channels import Channels, FloatArray, difference
from gpsim.errors import UsageError, near
from gpsim.simulators.simulator import (
    SMALLEST,
    Coordinate,
    MechanicalSimulator,
    Parameter,
    Parameters,
    Simulator,
)
from gpsim.simulators.user import load_user_simulator


class Slider(MechanicalSimulator):
    """State (q [m], q_dot [m/s]); action force [N]; rate q_acc = force / mass [m/s^2]."""

    name: ClassVar[str] = "slider"
    state: ClassVar[Channels] = Channels.of({"q": "m", "q_dot": "m/s"})
    action: ClassVar[Channels] = Channels.of({"force": "N"})
    rate: ClassVar[Channels] = Channels.of({"q_acc": "m/s^2"})
    coordinates: ClassVar[tuple[Coordinate, ...]] = (Coordinate("q", "q_dot", "q_acc", "N"),)
    parameters: ClassVar[dict[str, Parameter]] = {
        "mass": Parameter("kg", 1.0, SMALLEST, math.inf, "moving mass")
    }

    def rates(
        self,
        state: FloatArray,
        action: FloatArray,
        parameters: Parameters,
        forces: FloatArray | None = None,
    ) -> FloatArray:
        """Acceleration (B, 1)."""
        push = action if forces is None else action + forces
        return push / _column(parameters["mass"])

    def mobility(self, state: FloatArray, parameters: Parameters, coordinate: int) -> FloatArray:
        """One over the mass."""
        return _inverse(parameters["mass"], len(state))


def _column(value: float | FloatArray) -> float | FloatArray:
    return value if isinstance(value, float | int) else value[:, None]


def _inverse(inertia: float | FloatArray, count: int) -> FloatArray:
    """(B, 1): the mobility of one coordinate."""
    out = np.empty((count, 1))
    out[:, 0] = 1.0 / inertia
    return out


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
        return _inverse(m * length * length, len(state))


class ServoJoint(MechanicalSimulator):
    """State (theta [rad, 0 hanging], theta_dot [rad/s]); action target [rad]; rate theta_acc [rad/s^2].

    A link that a position servo turns, as hobby servos and the joints of small arms do:
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
        "damping": Parameter("N m s/rad", 0.3, 0.0, math.inf, "derivative gain plus the motor's own damping"),
        "torque_limit": Parameter("N m", 2.0, SMALLEST, math.inf, "the largest torque of the servo"),
        "gravity_torque": Parameter(
            "N m", 0.0, 0.0, math.inf, "weight times lever arm, with the link horizontal", additive=0.3
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
        return _inverse(parameters["inertia"], len(state))


class CartPole(MechanicalSimulator):
    """State (x [m], x_dot [m/s], theta [rad, 0 upright], theta_dot [rad/s]); action force [N] on the cart.

    Rates x_acc [m/s^2] and theta_acc [rad/s^2]. theta grows to the right: the pole's tip is at
    (x + 2 l sin theta, 2 l cos theta) with l the HALF length. A uniform pole on a frictionless pivot (Barto, Sutton and
    Anderson 1983); equations as corrected by Florian (2007), "Correct equations for the dynamics of the cart-pole
    system", (23) and (24), here as manipulator equations, so that a generalised force can act on either coordinate.
    """

    name: ClassVar[str] = "cartpole"
    state: ClassVar[Channels] = Channels.of({"x": "m", "x_dot": "m/s", "theta": "rad", "theta_dot": "rad/s"})
    action: ClassVar[Channels] = Channels.of({"force": "N"})
    rate: ClassVar[Channels] = Channels.of({"x_acc": "m/s^2", "theta_acc": "rad/s^2"})
    coordinates: ClassVar[tuple[Coordinate, ...]] = (
        Coordinate("x", "x_dot", "x_acc", "N"),
        Coordinate("theta", "theta_dot", "theta_acc", "N m"),
    )
    parameters: ClassVar[dict[str, Parameter]] = {
        "gravity": Parameter("m/s^2", 9.8, 0.0, math.inf, "acceleration of free fall"),
        "cart_mass": Parameter("kg", 1.0, SMALLEST, math.inf, "mass of the cart"),
        "pole_mass": Parameter("kg", 0.1, SMALLEST, math.inf, "mass of the pole, uniform along its length"),
        "pole_half_length": Parameter("m", 0.5, SMALLEST, math.inf, "pivot to the pole's centre of mass"),
    }

    def rates(
        self, state: FloatArray, action: FloatArray, parameters: Parameters, forces: FloatArray | None = None
    ) -> FloatArray:
        """Accelerations (B, 2): the two by two mass matrix solved in closed form."""
        g, m = parameters["gravity"], parameters["pole_mass"]
        half, total = parameters["pole_half_length"], parameters["cart_mass"] + m
        theta, theta_dot, lever = state[:, 2], state[:, 3], m * half
        sin, cos = np.sin(theta), np.cos(theta)
        push = action[:, 0] + lever * theta_dot * theta_dot * sin
        turn = m * g * half * sin
        if forces is not None:
            push, turn = push + forces[:, 0], turn + forces[:, 1]
        # [total, m half cos; m half cos, 4/3 m half^2] (x_acc, theta_acc) = (push, turn)
        m11, m12, m22 = total, lever * cos, 4.0 / 3.0 * m * half * half
        determinant = m11 * m22 - m12 * m12
        out = np.empty((len(state), 2))
        out[:, 0] = (m22 * push - m12 * turn) / determinant
        out[:, 1] = (m11 * turn - m12 * push) / determinant
        return out

    def mobility(self, state: FloatArray, parameters: Parameters, coordinate: int) -> FloatArray:
        """A column of the inverse mass matrix."""
        m, half = parameters["pole_mass"], parameters["pole_half_length"]
        m11, m22 = parameters["cart_mass"] + m, 4.0 / 3.0 * m * half * half
        m12 = m * half * np.cos(state[:, 2])
        determinant = m11 * m22 - m12 * m12
        out = np.empty((len(state), 2))
        out[:, coordinate] = (m22 if coordinate == 0 else m11) / determinant
        out[:, 1 - coordinate] = -m12 / determinant
        return out

    def normal_force(
        self, state: FloatArray, rates: FloatArray, parameters: Parameters
    ) -> dict[str, FloatArray]:
        """The track's force on the cart: both weights less what the pole's motion carries (Florian 2007, (18))."""
        g, m = parameters["gravity"], parameters["pole_mass"]
        lever = m * parameters["pole_half_length"]
        lift = rates[:, 1] * np.sin(state[:, 2]) + state[:, 3] ** 2 * np.cos(state[:, 2])
        return {"x": np.asarray((parameters["cart_mass"] + m) * g - lever * lift)}


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


class Unicycle(PlanarVehicle):
    """Actions v_cmd [m/s] and w_cmd [rad/s]; v = v_cmd, v_lateral = 0, w = w_cmd; only the pose is measured.

    Siegwart, Nourbakhsh and Scaramuzza, Introduction to Autonomous Mobile Robots, 2nd ed., section 3.2.
    """

    name: ClassVar[str] = "unicycle"
    action: ClassVar[Channels] = Channels.of({"v_cmd": "m/s", "w_cmd": "rad/s"})
    parameters: ClassVar[dict[str, Parameter]] = {}

    @property
    def kinematic(self) -> bool:
        """Yes; a vehicle derived from it that writes rates of its own has to say so itself."""
        return type(self).rates is Unicycle.rates

    def rates(
        self,
        state: FloatArray,
        action: FloatArray,
        parameters: Parameters,
        forces: FloatArray | None = None,
    ) -> FloatArray:
        """The commanded twist (B, 3)."""
        out = np.zeros((len(state), 3))
        out[:, 0::2] = action
        return out


class Ackermann(PlanarVehicle):
    """Actions v_cmd [m/s] and steering [rad, + left]; w = v tan(steering) / wheelbase, v_lateral = 0 at the rear axle.

    Rajamani, Vehicle Dynamics and Control, 2nd ed., section 2.2 (with the reference point on the rear axle).
    """

    name: ClassVar[str] = "ackermann"
    action: ClassVar[Channels] = Channels.of({"v_cmd": "m/s", "steering": "rad"})
    parameters: ClassVar[dict[str, Parameter]] = {
        "wheelbase": Parameter("m", 0.2, SMALLEST, math.inf, "distance between the axles")
    }

    @property
    def kinematic(self) -> bool:
        """Yes; a vehicle derived from it that writes rates of its own has to say so itself."""
        return type(self).rates is Ackermann.rates

    def rates(
        self,
        state: FloatArray,
        action: FloatArray,
        parameters: Parameters,
        forces: FloatArray | None = None,
    ) -> FloatArray:
        """The twist (B, 3)."""
        out = np.zeros((len(state), 3))
        out[:, 0] = action[:, 0]
        out[:, 2] = action[:, 0] * np.tan(np.ascontiguousarray(action[:, 1])) / parameters["wheelbase"]
        return out


SIMULATORS: Mapping[str, type[Simulator]] = {
    CartPole.name: CartPole,
    Unicycle.name: Unicycle,
    Ackermann.name: Ackermann,
    Slider.name: Slider,
    Pendulum.name: Pendulum,
    ServoJoint.name: ServoJoint,
}


def source_file(name: str) -> Path | None:
    """The file that a user's own simulator comes from; None of a registered one, or of one in an environment."""
    return Path(name.rpartition(":")[0]) if ":" in name and not name.startswith("gym:") else None


def make_simulator(name: str) -> Simulator:
    """The simulator registered under `name`, or a user's own as FILE.py:ClassName; raises UsageError."""
    if ":" in name:
        return load_user_simulator(name)
    if name not in SIMULATORS:
        raise UsageError(
            f"unknown simulator '{name}'{near(name, SIMULATORS)}; registered are: {', '.join(SIMULATORS)}; "
            "your own: FILE.py:ClassName"
        )
    return SIMULATORS[name]()
