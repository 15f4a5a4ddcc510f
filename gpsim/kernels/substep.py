"""One substep of lanes of rows: gates, parameters, rates, integration (see `gpsim.effects.chain.Chain.advance`)."""

from __future__ import annotations

from gpsim.channels import FloatArray, IntArray
from gpsim.kernels.codes import (
    ACKERMANN,
    CHANGING,
    CURVE,
    DRIVE_CURVE,
    FINE,
    GATE,
    GATE_END,
    HELD,
    LAW,
    LOOKS_AHEAD,
    ON,
    OPENING,
    PARAMETERS,
    RATES,
    RK4,
    SCHEME,
    SEMI_IMPLICIT,
    STILL,
    SYSTEM,
    TERMS,
    TWISTS,
    UNICYCLE,
    VALUE,
)
from gpsim.kernels.compiling import compiled
from gpsim.kernels.curves import curve_at
from gpsim.kernels.friction import push, rub_all
from gpsim.kernels.gates import find_shares
from gpsim.kernels.lanes import AHEAD, EXTRA, K1, LANES, ONE, SUM, F, H, K, P, R, U, X, Y
from gpsim.kernels.laws import twist
from gpsim.kernels.scalars import blended
from gpsim.kernels.systems import rates, slope, turning


@compiled
def believe(b: FloatArray, lanes: int, believed: FloatArray) -> None:
    """Fill P with what was believed."""
    for c in range(len(believed)):
        for i in range(lanes):
            b[P + c * LANES + i] = believed[c]


@compiled
def correct(
    b: FloatArray, lanes: int, layout: IntArray, terms: IntArray, v: FloatArray, shares: FloatArray
) -> None:
    """Change P, as it was believed, to the parameters that the rows have."""
    for n in range(layout[PARAMETERS], layout[TWISTS]):
        at, value, gated = P + terms[n, ON] * LANES, terms[n, VALUE], terms[n, GATE] < terms[n, GATE_END]
        for i in range(lanes):
            new = b[at + i] * v[value, i]
            b[at + i] = blended(shares[n, i], new, b[at + i]) if gated else new


@compiled
def find(
    b: FloatArray,
    lanes: int,
    layout: IntArray,
    terms: IntArray,
    curves: IntArray,
    knots: FloatArray,
    v: FloatArray,
    shares: FloatArray,
) -> None:
    """Fill R with the rates in the stage's state, whatever acts; SIN and COS are those of that state."""
    push(b, lanes, layout, terms, curves, knots, v, shares)
    rates(b, lanes, layout[SYSTEM], layout[HELD])
    rub_all(b, lanes, layout, terms, curves, knots, v, shares)
    for n in range(layout[TWISTS], layout[RATES]):
        if terms[n, ON] <= OPENING:
            for i in range(3 * lanes):
                b[SUM + i] = b[R + i]
        twist(b, lanes, terms, n, v, curves, knots)
        if terms[n, GATE] < terms[n, GATE_END]:
            for c in range(3):
                for i in range(lanes):
                    at = c * LANES + i
                    b[R + at] = blended(shares[n, i], b[R + at], b[SUM + at])
    for n in range(layout[RATES], layout[TERMS]):
        add_curve(b, lanes, layout, terms, n, curves, knots, v, shares)
    for i in range(3 * lanes):
        b[R + i] += b[EXTRA + i]


@compiled
def add_curve(
    b: FloatArray,
    lanes: int,
    layout: IntArray,
    terms: IntArray,
    n: int,
    curves: IntArray,
    knots: FloatArray,
    v: FloatArray,
    shares: FloatArray,
) -> None:
    """Add to R a free curve of one of the rates, or what one of a command does to them."""
    curve_at(b, lanes, terms[n, VALUE], curves, terms[n, CURVE], knots, v, ONE)
    on, gated = terms[n, ON] * LANES, terms[n, GATE] < terms[n, GATE_END]
    if terms[n, LAW] != DRIVE_CURVE:
        for i in range(lanes):
            b[R + on + i] += b[ONE + i] * shares[n, i] if gated else b[ONE + i]
        return
    for i in range(3 * lanes):
        b[SUM + i] = b[R + i]
    for i in range(2 * lanes):
        b[F + i] = 0.0
    for turn in range(2):
        times = 1.0 if turn else -1.0
        for i in range(lanes):
            b[U + on + i] += b[ONE + i] if turn else 0.0
        rates(b, lanes, layout[SYSTEM], layout[HELD])
        for c in range(3):
            for i in range(lanes):
                at = c * LANES + i
                b[SUM + at] += times * b[R + at] * (shares[n, i] if gated else 1.0)
    for i in range(lanes):
        b[U + on + i] -= b[ONE + i]
    for i in range(3 * lanes):
        b[R + i] = b[SUM + i]


@compiled
def look(
    b: FloatArray,
    lanes: int,
    layout: IntArray,
    terms: IntArray,
    conditions: IntArray,
    knots: FloatArray,
    believed: FloatArray,
    v: FloatArray,
    shares: FloatArray,
) -> None:
    """Where gates are open in this substep, and the parameters that follow from it."""
    for i in range(4 * lanes):
        b[AHEAD + i] = b[X + i]
    believe(b, lanes, believed)
    if layout[LOOKS_AHEAD]:
        turning(b, lanes, layout[SYSTEM])
        for i in range(2 * lanes):
            b[F + i] = 0.0
        rates(b, lanes, layout[SYSTEM], layout[HELD])
        if layout[LOOKS_AHEAD] == 1:  # positions need no rates
            for i in range(3 * lanes):
                b[R + i] = 0.0
        slope(b, lanes, layout[SYSTEM], layout[STILL])
        for c in range(4):
            for i in range(lanes):
                at = c * LANES + i
                b[AHEAD + at] = b[X + at] + b[H + i] * b[K + at]
    find_shares(b, lanes, layout, terms, conditions, knots, v, shares)
    correct(b, lanes, layout, terms, v, shares)


@compiled
def advance(
    b: FloatArray,
    lanes: int,
    layout: IntArray,
    terms: IntArray,
    conditions: IntArray,
    curves: IntArray,
    knots: FloatArray,
    believed: FloatArray,
    v: FloatArray,
    shares: FloatArray,
) -> None:
    """Move X on by a substep."""
    scheme, system = layout[SCHEME], layout[SYSTEM]
    for i in range(4 * lanes):
        b[Y + i] = b[X + i]
    if layout[CHANGING]:
        look(b, lanes, layout, terms, conditions, knots, believed, v, shares)
    # Rates that are the same in all states, as a vehicle's often are, are found once.
    held = (system == UNICYCLE or system == ACKERMANN) and layout[RATES] == layout[TERMS]
    stages = 3 if scheme == FINE else (4 if scheme == RK4 else 1)
    for n in range(stages):
        turning(b, lanes, system)
        if n == 0 or not held:
            find(b, lanes, layout, terms, curves, knots, v, shares)
        slope(b, lanes, system, layout[STILL])
        add_up(b, lanes, scheme, n)
        if n < stages - 1:
            share = (n + 1) / 3.0 if scheme == FINE else (0.5 if n < 2 else 1.0)
            for c in range(4):
                for i in range(lanes):
                    at = c * LANES + i
                    b[Y + at] = b[X + at] + share * b[H + i] * b[K + at]
    for c in range(4):
        for i in range(lanes):
            at = c * LANES + i
            b[Y + at] = b[X + at] + b[H + i] * b[K1 + at]
    if scheme == SEMI_IMPLICIT and not (system == UNICYCLE or system == ACKERMANN):
        for q in range(0, 4, 2):  # positions go with the new velocities
            if not layout[STILL] & (1 << q):
                for i in range(lanes):
                    at = q * LANES + i
                    b[Y + at] = b[X + at] + b[H + i] * b[Y + LANES + at]
    for i in range(4 * lanes):
        b[X + i] = b[Y + i]


@compiled
def add_up(b: FloatArray, lanes: int, scheme: int, stage: int) -> None:
    """Add the slope of a stage to the mean slope K1: Heun (1900), third order; the classical Runge-Kutta scheme."""
    weight = 1.0
    if scheme == FINE:
        weight = 0.25 if stage == 0 else (0.0 if stage == 1 else 0.75)
    elif scheme == RK4:
        weight = 1.0 / 6.0 if stage == 0 or stage == 3 else 1.0 / 3.0
    if stage == 0:
        for i in range(4 * lanes):
            b[K1 + i] = weight * b[K + i]
    elif weight > 0.0:
        for i in range(4 * lanes):
            b[K1 + i] += weight * b[K + i]
