"""Laws of force, dry friction and twist for lanes of rows: what gpsim/effects writes for batches."""

from __future__ import annotations

import math

from gpsim.channels import FloatArray, IntArray
from gpsim.kernels.codes import (
    COEFFICIENT,
    CONSTANT,
    COULOMB,
    CURVE,
    FIRST,
    LAW,
    QUADRATIC,
    RADIUS,
    SLIP,
    SPRING,
    STEERING,
    STRIBECK,
    TURN_CURVE,
    UNDERSTEER,
    VALUE,
    VISCOUS,
)
from gpsim.kernels.compiling import compiled
from gpsim.kernels.curves import curve
from gpsim.kernels.lanes import LANES, LOAD, ONE, OTHER, POSITION, R1, R2, SPEED, SUM, R
from gpsim.kernels.scalars import clipped, larger

TINY = 2.2250738585072014e-308  # the smallest normal number


@compiled
def force(
    b: FloatArray, lanes: int, terms: IntArray, n: int, v: FloatArray, curves: IntArray, knots: FloatArray
) -> None:
    """Fill ONE with a smooth force at POSITION and SPEED."""
    law, at = terms[n, LAW], terms[n, VALUE]
    if law == VISCOUS:
        for i in range(lanes):
            b[ONE + i] = -v[at, i] * b[SPEED + i]
    elif law == QUADRATIC:
        for i in range(lanes):
            b[ONE + i] = -v[at, i] * abs(b[SPEED + i]) * b[SPEED + i]
    elif law == SPRING:
        for i in range(lanes):
            b[ONE + i] = -v[at, i] * (b[POSITION + i] - v[at + 1, i])
    elif law == CONSTANT:
        for i in range(lanes):
            b[ONE + i] = v[at, i]
    else:
        about = terms[n, CURVE]
        curve(b, lanes, SPEED if curves[about, FIRST] else POSITION, 0, at, curves, about, knots, v, ONE)


@compiled
def grip(
    b: FloatArray,
    lanes: int,
    terms: IntArray,
    n: int,
    v: FloatArray,
    loaded: bool,
    curves: IntArray,
    knots: FloatArray,
) -> None:
    """Fill ONE with the most that dry friction can hold; loaded: there is a normal force, in LOAD."""
    law, at = terms[n, LAW], terms[n, VALUE]
    if law == COULOMB:
        for i in range(lanes):
            b[ONE + i] = v[at, i]
    elif law == COEFFICIENT:
        for i in range(lanes):
            b[ONE + i] = v[at, i] * larger(b[LOAD + i], 0.0) if loaded else 0.0
    elif law == STRIBECK:
        for i in range(lanes):
            slow = b[SPEED + i] / v[at + 2, i]
            b[ONE + i] = v[at, i] + larger(v[at + 1, i] - v[at, i], 0.0) * math.exp(-(slow * slow))
    else:
        about = terms[n, CURVE]
        of_speed = curves[about, FIRST] == 1
        curve(b, lanes, SPEED if of_speed else POSITION, 0, at, curves, about, knots, v, ONE)
        if of_speed:  # of what rests, the mean of both directions
            for i in range(lanes):
                b[POSITION + i] = -TINY if b[SPEED + i] == 0.0 else b[SPEED + i]
            curve(b, lanes, POSITION, 0, at, curves, about, knots, v, OTHER)
            for i in range(lanes):
                if b[SPEED + i] == 0.0:
                    b[ONE + i] = 0.5 * (b[ONE + i] + b[OTHER + i])


@compiled
def twist(
    b: FloatArray, lanes: int, terms: IntArray, n: int, v: FloatArray, curves: IntArray, knots: FloatArray
) -> None:
    """Change R to what a vehicle makes of that twist (speed, sideways speed, turn rate), which was in SUM before."""
    law, at = terms[n, LAW], terms[n, VALUE]
    if law == RADIUS:
        for i in range(lanes):
            most = abs(b[R + i]) / v[at, i]
            b[R2 + i] = clipped(b[R2 + i], -most, most)
    elif law == UNDERSTEER:
        for i in range(lanes):
            b[R2 + i] /= larger(1.0 + v[at, i] * (b[R + i] * b[R + i]), 0.05)
    elif law == STEERING:
        for i in range(lanes):
            b[R2 + i] += v[at, i] * b[R + i]
    elif law == SLIP:
        for i in range(lanes):
            b[R1 + i] -= v[at, i] * b[R + i] * b[R2 + i]
    else:
        curve(b, lanes, SUM, SUM + 2 * LANES, at, curves, terms[n, CURVE], knots, v, ONE)
        if law == TURN_CURVE:
            for i in range(lanes):
                b[R2 + i] += b[ONE + i]
        else:
            for i in range(lanes):
                b[R1 + i] += b[ONE + i]
