"""The systems of the trials: channels, base parameters, equations of motion, how they are driven.

The equations are written as inverse mass matrix times generalised force, solved by Cramer's rule; the simulators that
will be diagnosed are written differently, on purpose.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from gpsim.channels import FloatArray

Parameters = Mapping[str, float | FloatArray]


@dataclass(frozen=True)
class System:
    """One system. parameters: name -> range of the base's value; steps: possible dt [s]; sensors: a decent one's noise.

    coordinates: the position channels, each followed by its velocity; empty for a vehicle. rates: what integration
    turns into the next state.
    """

    name: str
    state: Mapping[str, str]
    action: Mapping[str, str]
    coordinates: tuple[str, ...]
    rates: tuple[str, ...]
    parameters: Mapping[str, tuple[float, float]]
    steps: tuple[float, ...]
    sensors: Mapping[str, float]

    @property
    def vehicle(self) -> bool:
        """Whether it moves in the plane and only its pose is measured."""
        return not self.coordinates

    @property
    def names(self) -> tuple[str, ...]:
        """State channels in column order."""
        return tuple(self.state)


SYSTEMS: Mapping[str, System] = {
    "cartpole": System(
        "cartpole",
        {"x": "m", "x_dot": "m/s", "theta": "rad", "theta_dot": "rad/s"},
        {"force": "N"},
        ("x", "theta"),
        ("x_acc", "theta_acc"),
        {
            "gravity": (9.8, 9.81),
            "cart_mass": (0.7, 1.5),
            "pole_mass": (0.1, 0.3),
            "pole_half_length": (0.3, 0.6),
        },
        (0.02, 0.02, 0.01),
        {"x": 0.0005, "x_dot": 0.005, "theta": 0.001, "theta_dot": 0.01},
    ),
    "slider": System(
        "slider",
        {"q": "m", "q_dot": "m/s"},
        {"force": "N"},
        ("q",),
        ("q_acc",),
        {"mass": (1.0, 4.0)},
        (0.02, 0.01),
        {"q": 0.0005, "q_dot": 0.005},
    ),
    "pendulum": System(
        "pendulum",
        {"theta": "rad", "theta_dot": "rad/s"},
        {"torque": "N m"},
        ("theta",),
        ("theta_acc",),
        {"gravity": (9.8, 9.81), "mass": (0.5, 1.5), "length": (0.3, 0.7)},
        (0.02, 0.02, 0.05),
        {"theta": 0.001, "theta_dot": 0.01},
    ),
    "unicycle": System(
        "unicycle",
        {"x": "m", "y": "m", "yaw": "rad"},
        {"v_cmd": "m/s", "w_cmd": "rad/s"},
        (),
        ("v", "v_lateral", "w"),
        {},
        (0.1, 0.02),
        {"x": 0.002, "y": 0.002, "yaw": 0.004},
    ),
}


def dynamics(system: str, p: Parameters, s: FloatArray, u: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Inverse mass matrix (B, C, C) and generalised forces (B, C) of state s (B, S) under the action u (B, A)."""
    if system == "slider":
        return np.broadcast_to(1.0 / np.asarray(p["mass"]), (len(s),)).reshape(-1, 1, 1), u.copy()
    if system == "pendulum":
        weight = p["mass"] * p["length"]
        inverse = np.broadcast_to(1.0 / np.asarray(weight * p["length"]), (len(s),)).reshape(-1, 1, 1)
        return inverse, (u[:, 0] - weight * p["gravity"] * np.sin(s[:, 0]))[:, None]
    lever = p["pole_mass"] * p["pole_half_length"]
    sin, cos = np.sin(s[:, 2]), np.cos(s[:, 2])
    across = lever * cos
    # A uniform rod of length 2 l about its end: m l^2 + m (2 l)^2 / 12.
    turning = lever * p["pole_half_length"] * (1.0 + 1.0 / 3.0)
    total = p["cart_mass"] + p["pole_mass"]
    determinant = total * turning - across**2
    inverse = np.empty((len(s), 2, 2))
    inverse[:, 0, 0], inverse[:, 1, 1] = turning / determinant, total / determinant
    inverse[:, 0, 1] = inverse[:, 1, 0] = -across / determinant
    forces = np.empty((len(s), 2))
    forces[:, 0] = u[:, 0] + lever * s[:, 3] ** 2 * sin
    forces[:, 1] = lever * p["gravity"] * sin
    return inverse, forces


def load_on_track(p: Parameters, s: FloatArray, acceleration: FloatArray) -> FloatArray:
    """(B,) N: the track's force on the cart, from the vertical acceleration of the pole's centre of mass."""
    half, m = p["pole_half_length"], p["pole_mass"]
    rise = -half * (acceleration[:, 1] * np.sin(s[:, 2]) + s[:, 3] ** 2 * np.cos(s[:, 2]))
    return np.asarray(p["cart_mass"] * p["gravity"] + m * (p["gravity"] + rise))
