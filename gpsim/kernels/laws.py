"""Laws of force, dry friction and twist, one number at a time: what gpsim/effects writes for batches."""

from __future__ import annotations

import math

from gpsim.channels import FloatArray, IntArray
from gpsim.kernels.codes import (
    COEFFICIENT,
    COULOMB,
    CURVE,
    FIRST,
    LAW,
    QUADRATIC,
    RADIUS,
    SPRING,
    STEERING,
    STRIBECK,
    SLIP,
    TURN_CURVE,
    UNDERSTEER,
    VALUE,
    VISCOUS,
    CONSTANT,
)
from gpsim.kernels.compiling import compiled
from gpsim.kernels.curves import curve
from gpsim.kernels.scalars import clipped, larger
from gpsim.kernels.systems import Rates

TINY = 2.2250738585072014e-308  # the smallest normal number


@compiled
def force(
    term: IntArray, position: float, speed: float, v: FloatArray, curves: IntArray, knots: FloatArray
) -> float:
    """A smooth force; v: all values of the row."""
    law, at = term[LAW], term[VALUE]
    if law == VISCOUS:
        return -v[at] * speed
    if law == QUADRATIC:
        return -v[at] * abs(speed) * speed
    if law == SPRING:
        return -v[at] * (position - v[at + 1])
    if law == CONSTANT:
        return v[at] + 0.0 * speed
    about = curves[term[CURVE]]
    return curve(speed if about[FIRST] else position, 0.0, about, knots, v, at)


@compiled
def grip(
    term: IntArray,
    position: float,
    speed: float,
    v: FloatArray,
    loaded: bool,
    load: float,
    curves: IntArray,
    knots: FloatArray,
) -> float:
    """The most that dry friction can hold; loaded: the normal force is known, and is `load`."""
    law, at = term[LAW], term[VALUE]
    if law == COULOMB:
        return v[at] + 0.0 * speed
    if law == COEFFICIENT:
        return v[at] * larger(load, 0.0) if loaded else 0.0
    if law == STRIBECK:
        slow = speed / v[at + 2]
        return v[at] + larger(v[at + 1] - v[at], 0.0) * math.exp(-(slow * slow))
    about = curves[term[CURVE]]
    out = curve(speed if about[FIRST] else position, 0.0, about, knots, v, at)
    if about[FIRST] and speed == 0.0:
        out = 0.5 * (out + curve(-TINY, 0.0, about, knots, v, at))
    return out


@compiled
def twist(law: int, at: int, r: Rates, v: FloatArray) -> Rates:
    """What a vehicle makes of a twist (speed, sideways speed, turn rate)."""
    if law == RADIUS:
        most = abs(r[0]) / v[at]
        return r[0], r[1], clipped(r[2], -most, most)
    if law == UNDERSTEER:
        return r[0], r[1], r[2] / larger(1.0 + v[at] * r[0] * r[0], 0.05)
    if law == STEERING:
        return r[0], r[1], r[2] + v[at] * r[0]
    return r[0], r[1] - v[at] * r[0] * r[2], r[2]


@compiled
def turned(term: IntArray, r: Rates, v: FloatArray, curves: IntArray, knots: FloatArray) -> Rates:
    """A free curve of speed and turn rate beside the twist."""
    more = curve(r[0], r[2], curves[term[CURVE]], knots, v, term[VALUE])
    return (r[0], r[1], r[2] + more) if term[LAW] == TURN_CURVE else (r[0], r[1] + more, r[2])
