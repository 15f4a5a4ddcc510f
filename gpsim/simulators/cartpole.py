"""The frictionless cart-pole: a uniform pole on a pivot on a cart that a force pushes along a track.

Barto, Sutton and Anderson (1983), "Neuronlike adaptive elements that can solve difficult learning control
problems"; equations as corrected by Florian (2007), "Correct equations for the dynamics of the cart-pole system",
(23) and (24), here written as the manipulator equations so that a generalised force can act on either coordinate.
"""

from __future__ import annotations

import math
from typing import ClassVar

import numpy as np

from gpsim.channels import Channels, FloatArray
from gpsim.simulators.simulator import SMALLEST, Coordinate, MechanicalSimulator, Parameter, Parameters


class CartPole(MechanicalSimulator):
    """State (x [m], x_dot [m/s], theta [rad, 0 upright], theta_dot [rad/s]); action force [N] on the cart.

    Rates x_acc [m/s^2] and theta_acc [rad/s^2]. theta grows to the right: the pole's tip is at
    (x + 2 l sin theta, 2 l cos theta) with l the HALF length.
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
