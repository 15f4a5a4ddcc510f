"""One substep of lanes of rows: gates, parameters, rates, integration (see `gpsim.effects.chain.Chain.advance`).

Shares of terms without a gate are one.
"""

from __future__ import annotations

from gpsim.channels import FloatArray, IntArray
from gpsim.kernels import codes
from gpsim.kernels.compiling import blended, compiled, place
from gpsim.kernels.friction import bend_on, push, rub_all, transmit, turn_on
from gpsim.kernels.gates import curve_at, find_shares
from gpsim.kernels.lanes import AHEAD, K1, LANES, ONE, REACHED, SUM, Y1, F, H, K, P, R, U, X, Y
from gpsim.kernels.laws import correct_of, given_of, twist
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
    for n in range(layout[codes.PARAMETERS], layout[codes.TWISTS]):
        at, gated = P + terms[n, codes.ON] * LANES, terms[n, codes.GATE] < terms[n, codes.GATE_END]
        correct_of(b, lanes, terms[n, codes.LAW], terms[n, codes.VALUE], v, at, gated, shares, n)


@compiled
def drive(b: FloatArray, lanes: int, layout: IntArray, terms: IntArray, v: FloatArray) -> None:
    """Keep the commands U in REACHED, and change them to what drives give in the stage's state."""
    for i in range(2 * LANES):
        b[REACHED + i] = b[U + i]
    for n in range(layout[codes.FORCES]):
        speed = place(Y1 + 2 * terms[n, codes.ON] * LANES)
        given_of(
            b,
            lanes,
            terms[n, codes.LAW],
            terms[n, codes.VALUE],
            v,
            place(U + terms[n, codes.CURVE] * LANES),
            speed,
        )


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
    drives = layout[codes.FORCES]  # their terms come first
    if drives:
        drive(b, lanes, layout, terms, v)
    push(b, lanes, layout, terms, curves, knots, v, shares)
    if drives:
        transmit(b, lanes, layout, terms, v)
    rates(b, lanes, layout[codes.SYSTEM], layout[codes.HELD])
    rub_all(b, lanes, layout, terms, curves, knots, v, shares)
    for n in range(layout[codes.TWISTS], layout[codes.RATES]):
        if terms[n, codes.ON] <= codes.OPENING:
            for i in range(3 * LANES):
                b[SUM + i] = b[R + i]
        twist(b, lanes, terms, n, v, curves, knots)
        if terms[n, codes.GATE] < terms[n, codes.GATE_END]:
            for c in range(3):
                for i in range(lanes):
                    at = c * LANES + i
                    b[R + at] = blended(shares[n, i], b[R + at], b[SUM + at])
    for n in range(layout[codes.RATES], layout[codes.TERMS]):
        add_curve(b, lanes, layout, terms, n, curves, knots, v, shares)
    if drives:
        for i in range(2 * LANES):
            b[U + i] = b[REACHED + i]


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
    curve_at(b, lanes, terms[n, codes.VALUE], curves, terms[n, codes.CURVE], knots, v, ONE)
    on = place(terms[n, codes.ON] * LANES)
    if terms[n, codes.LAW] != codes.DRIVE_CURVE:
        for i in range(lanes):
            b[R + on + i] += b[ONE + i] * shares[n, i]
        return
    for i in range(3 * LANES):
        b[SUM + i] = b[R + i]
    for i in range(2 * LANES):
        b[F + i] = 0.0
    for turn in range(2):
        times = 1.0 if turn else -1.0
        for i in range(lanes):
            b[U + on + i] += b[ONE + i] if turn else 0.0
        rates(b, lanes, layout[codes.SYSTEM], layout[codes.HELD])
        for c in range(3):
            for i in range(lanes):
                at = c * LANES + i
                b[SUM + at] += times * b[R + at] * shares[n, i]
    for i in range(lanes):
        b[U + on + i] -= b[ONE + i]
    for i in range(3 * LANES):
        b[R + i] = b[SUM + i]


@compiled
def peer(b: FloatArray, lanes: int, layout: IntArray, believed: FloatArray) -> None:
    """Fill AHEAD with about where the substep ends, for gates that look at the state.

    Where that takes rates, P becomes what was believed; positions need none.
    """
    for i in range(4 * LANES):
        b[AHEAD + i] = b[Y + i] = b[X + i]
    if not layout[codes.LOOKS_AHEAD]:
        return
    if layout[codes.LOOKS_AHEAD] == 1:
        for i in range(3 * LANES):
            b[R + i] = 0.0
    else:
        believe(b, lanes, believed)
        turning(b, lanes, layout[codes.SYSTEM])
        for i in range(2 * LANES):
            b[F + i] = 0.0
        rates(b, lanes, layout[codes.SYSTEM], layout[codes.HELD])
    slope(b, lanes, layout[codes.SYSTEM], layout[codes.STILL])
    for c in range(4):
        for i in range(lanes):
            at = c * LANES + i
            b[AHEAD + at] = b[X + at] + b[H + i] * b[K + at]


@compiled
def is_steady(layout: IntArray, terms: IntArray) -> bool:
    """Whether the parameters that a row has stay as they are from one substep to the next."""
    if layout[codes.LOOKS_AHEAD] > 1 and (layout[codes.CHANGING] or layout[codes.LOOKS]):
        return False
    gated = 0
    for n in range(layout[codes.PARAMETERS], layout[codes.TWISTS]):
        gated += terms[n, codes.GATE] < terms[n, codes.GATE_END]
    return gated == 0


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
    steady: bool,
) -> None:
    """Move X on by a substep; steady: the parameters in P are the rows' still."""
    scheme, system = layout[codes.SCHEME], layout[codes.SYSTEM]
    drives = system == codes.UNICYCLE or system == codes.ACKERMANN
    if layout[codes.CHANGING]:
        peer(b, lanes, layout, believed)
        find_shares(b, lanes, layout, terms, conditions, knots, v, shares)
    if not steady:
        believe(b, lanes, believed)
        correct(b, lanes, layout, terms, v, shares)
    for i in range(4 * LANES):
        b[Y + i] = b[X + i]
    # Rates that are the same in all states, as a vehicle's often are, are found once.
    held = drives and layout[codes.RATES] == layout[codes.TERMS]
    channels = 3 if drives else (4 if system == codes.CARTPOLE else 2)
    stages = 3 if scheme == codes.FINE else (4 if scheme == codes.RK4 else 1)
    for n in range(stages):
        turning(b, lanes, system)
        if n == 0 or not held:
            find(b, lanes, layout, terms, curves, knots, v, shares)
        slope(b, lanes, system, layout[codes.STILL])
        go_on(b, lanes, channels, scheme, n, n == stages - 1)
    if scheme == codes.SEMI_IMPLICIT and not drives:
        for q in range(0, channels, 2):  # positions go with the new velocities
            if not layout[codes.STILL] & (1 << q):
                for i in range(lanes):
                    at = q * LANES + i
                    b[Y + at] = b[X + at] + b[H + i] * b[Y + LANES + at]
    bend_on(b, lanes, layout, terms, v)
    if (
        layout[codes.FORCES] and terms[layout[codes.FORCES] - 1, codes.LAW] == codes.ELASTIC
    ):  # they are the last ones
        drive(b, lanes, layout, terms, v)
        turn_on(b, lanes, layout, terms, v)
        for i in range(2 * LANES):
            b[U + i] = b[REACHED + i]
    for i in range(4 * LANES):
        b[X + i] = b[Y + i]


@compiled
def go_on(b: FloatArray, lanes: int, channels: int, scheme: int, stage: int, ends: bool) -> None:
    """Fill Y with the state of the next stage or of the substep's end.

    The slope of a stage goes into the mean K1: Heun (1900), third order; the classical Runge-Kutta scheme.
    """
    weight, share = 1.0, 1.0
    if scheme == codes.FINE:
        weight = 0.25 if stage == 0 else (0.0 if stage == 1 else 0.75)
        share = (stage + 1) / 3.0
    elif scheme == codes.RK4:
        weight = 1.0 / 6.0 if stage == 0 or stage == 3 else 1.0 / 3.0
        share = 0.5 if stage < 2 else 1.0
    for c in range(channels):
        for i in range(lanes):
            at = c * LANES + i
            slope = b[K + at]
            mean = weight * slope + (b[K1 + at] if stage > 0 else 0.0)
            b[K1 + at] = mean
            b[Y + at] = b[X + at] + (b[H + i] * mean if ends else share * b[H + i] * slope)
