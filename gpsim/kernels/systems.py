"""The built-in simulators one state at a time: what gpsim/simulators writes for batches, where it is explained.

A state has four numbers here, rates three, commands and forces two: what a system has not is 0.
"""

from __future__ import annotations

import math

from gpsim.channels import FloatArray
from gpsim.kernels.codes import ACKERMANN, CARTPOLE, PENDULUM, SLIDER
from gpsim.kernels.compiling import compiled

State = tuple[float, float, float, float]
Rates = tuple[float, float, float]


@compiled
def rates(system: int, held: int, x: State, u: tuple[float, float], p: FloatArray, f0: float, f1: float) -> Rates:
    """Of a state under commands u, parameters p and forces on the coordinates."""
    if system == CARTPOLE:
        g, m, half, total = p[0], p[2], p[3], p[1] + p[2]
        sin, cos = math.sin(x[2]), math.cos(x[2])
        lever = m * half
        push = u[0] + lever * x[3] * x[3] * sin + f0
        turn = m * g * half * sin + f1
        m12, m22 = lever * cos, 4.0 / 3.0 * m * half * half
        determinant = total * m22 - m12 * m12
        r0, r1 = (m22 * push - m12 * turn) / determinant, (total * turn - m12 * push) / determinant
        return constrained(held, r0, r1, total, m12, m22)
    if system == PENDULUM:
        torque = u[0] + f0
        return (torque / (p[1] * p[2]) - p[0] * math.sin(x[0])) / p[2], 0.0, 0.0
    if system == SLIDER:
        return (u[0] + f0) / p[0], 0.0, 0.0
    if system == ACKERMANN:
        return u[0], 0.0, u[0] * math.tan(u[1]) / p[0]
    return u[0], 0.0, u[1]


@compiled
def constrained(held: int, r0: float, r1: float, m11: float, m12: float, m22: float) -> Rates:
    """A cart-pole's rates, or what a force does to them, where a force of constraint holds one coordinate still.

    What that force does to the two rates is as m22 to -m12 for the cart, as -m12 to m11 for the pole.
    """
    if held == 0:
        return 0.0, r1 + m12 / m22 * r0, 0.0
    if held == 1:
        return r0 + m12 / m11 * r1, 0.0, 0.0
    return r0, r1, 0.0


@compiled
def derivative(system: int, x: State, r: Rates) -> State:
    """D state / dt."""
    if system == CARTPOLE:
        return x[1], r[0], x[3], r[1]
    if system == PENDULUM or system == SLIDER:
        return x[1], r[0], 0.0, 0.0
    sin, cos = math.sin(x[2]), math.cos(x[2])
    return r[0] * cos - r[1] * sin, r[0] * sin + r[1] * cos, r[2], 0.0


@compiled
def mobility(system: int, held: int, x: State, p: FloatArray, coordinate: int) -> tuple[float, float]:
    """By how much a unit force on a coordinate changes the rates."""
    if system == CARTPOLE:
        m, half = p[2], p[3]
        m11, m22 = p[1] + m, 4.0 / 3.0 * m * half * half
        m12 = m * half * math.cos(x[2])
        determinant = m11 * m22 - m12 * m12
        own = (m22 if coordinate == 0 else m11) / determinant
        other = -m12 / determinant
        r0, r1 = (own, other) if coordinate == 0 else (other, own)
        out = constrained(held, r0, r1, m11, m12, m22)
        return out[0], out[1]
    if system == PENDULUM:
        return 1.0 / (p[1] * p[2] * p[2]), 0.0
    return 1.0 / p[0], 0.0


@compiled
def load(x: State, r0: float, r1: float, p: FloatArray) -> float:
    """The track's force on a cart-pole's cart."""
    lift = r1 * math.sin(x[2]) + x[3] * x[3] * math.cos(x[2])
    return (p[1] + p[2]) * p[0] - p[2] * p[3] * lift
