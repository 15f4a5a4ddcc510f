"""Laws of force, dry friction and twist for lanes of rows: what gpsim/effects writes for batches."""

from __future__ import annotations

import math

from gpsim.channels import FloatArray, IntArray
from gpsim.kernels.catalogue import force_of, grip_of, twist_of
from gpsim.kernels.codes import (
    COEFFICIENT,
    CONSTANT,
    COULOMB,
    CURVE,
    FIRST,
    LAW,
    ON,
    OWN,
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
from gpsim.kernels.curves import curve, curve_of
from gpsim.kernels.lanes import LANES, LOAD, MOST, ONE, R1, R2, SUM, R, U, Y
from gpsim.kernels.scalars import clipped, larger, place

TINY = 2.2250738585072014e-308  # the smallest normal number


@compiled
def force(
    b: FloatArray,
    lanes: int,
    terms: IntArray,
    n: int,
    v: FloatArray,
    shares: FloatArray,
    curves: IntArray,
    knots: FloatArray,
    to: int,
) -> None:
    """Add to `to` a smooth force on the coordinate of the term n in the stage's state."""
    law, at = terms[n, LAW], terms[n, VALUE]
    position = place(Y + 2 * terms[n, ON] * LANES)
    speed, to = place(position + LANES), place(to)
    if law == VISCOUS:
        for i in range(lanes):
            b[to + i] -= v[at, i] * b[speed + i] * shares[n, i]
    elif law == QUADRATIC:
        for i in range(lanes):
            b[to + i] -= v[at, i] * abs(b[speed + i]) * b[speed + i] * shares[n, i]
    elif law == SPRING:
        for i in range(lanes):
            b[to + i] -= v[at, i] * (b[position + i] - v[at + 1, i]) * shares[n, i]
    elif law == CONSTANT:
        for i in range(lanes):
            b[to + i] += v[at, i] * shares[n, i]
    elif law >= OWN:
        force_of(b, lanes, law, at, v, position, speed, to, shares, n)
    else:
        about = terms[n, CURVE]
        curve(
            b, lanes, speed if curves[about, FIRST] else position, position, at, curves, about, knots, v, ONE
        )
        for i in range(lanes):
            b[to + i] += b[ONE + i] * shares[n, i]


@compiled
def grip(
    b: FloatArray,
    lanes: int,
    terms: IntArray,
    n: int,
    v: FloatArray,
    shares: FloatArray,
    loaded: bool,
    curves: IntArray,
    knots: FloatArray,
) -> None:
    """Add to MOST what the dry friction of the term n can hold; loaded: there is a normal force, in LOAD."""
    law, at = terms[n, LAW], terms[n, VALUE]
    position = place(Y + 2 * terms[n, ON] * LANES)
    speed = place(position + LANES)
    if law == COULOMB:
        for i in range(lanes):
            b[MOST + i] += v[at, i] * shares[n, i]
    elif law == COEFFICIENT:
        if loaded:
            for i in range(lanes):
                b[MOST + i] += v[at, i] * larger(b[LOAD + i], 0.0) * shares[n, i]
    elif law == STRIBECK:
        for i in range(lanes):
            slow = b[speed + i] / v[at + 2, i]
            more = larger(v[at + 1, i] - v[at, i], 0.0) * math.exp(-(slow * slow))
            b[MOST + i] += (v[at, i] + more) * shares[n, i]
    elif law >= OWN:
        grip_of(b, lanes, law, at, v, position, speed, place(U + terms[n, CURVE] * LANES), shares, n)
    else:
        about = terms[n, CURVE]
        of_speed = curves[about, FIRST] == 1
        curve(b, lanes, speed if of_speed else position, position, at, curves, about, knots, v, ONE)
        if of_speed:  # of what rests, the mean of both directions
            for i in range(lanes):
                if b[speed + i] == 0.0:
                    b[ONE + i] = 0.5 * (b[ONE + i] + curve_of(-TINY, at, curves, about, knots, v, i))
        for i in range(lanes):
            b[MOST + i] += b[ONE + i] * shares[n, i]


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
    elif law >= OWN:
        twist_of(b, lanes, law, at, v)
    else:
        curve(b, lanes, place(SUM), place(SUM + 2 * LANES), at, curves, terms[n, CURVE], knots, v, ONE)
        if law == TURN_CURVE:
            for i in range(lanes):
                b[R2 + i] += b[ONE + i]
        else:
            for i in range(lanes):
                b[R1 + i] += b[ONE + i]
