"""One substep of one row: gates, parameters, rates and integration (see `gpsim.effects.chain.Chain.advance`)."""

from __future__ import annotations

from gpsim.channels import FloatArray, IntArray
from gpsim.kernels.codes import (
    ACTIONS,
    ACKERMANN,
    AHEAD,
    CHANGING,
    CURVE,
    DRIVE_CURVE,
    EULER,
    FINE,
    FIRST,
    FORCES,
    GATE,
    GATE_END,
    HELD,
    LAW,
    ON,
    PARAMETERS,
    RATES,
    SCHEME,
    SEMI_IMPLICIT,
    STILL,
    SYSTEM,
    TERMS,
    TURN_CURVE,
    TWISTS,
    UNICYCLE,
    VALUE,
)
from gpsim.kernels.compiling import compiled
from gpsim.kernels.curves import curve_at
from gpsim.kernels.friction import pushed
from gpsim.kernels.gates import share
from gpsim.kernels.laws import turned, twist
from gpsim.kernels.scalars import blended
from gpsim.kernels.systems import Rates, State, derivative, rates


@compiled
def corrected(
    layout: IntArray, terms: IntArray, v: FloatArray, shares: FloatArray, believed: FloatArray, p: FloatArray
) -> None:
    """Fill p with the parameters of a row."""
    for i in range(len(believed)):
        p[i] = believed[i]
    for i in range(layout[PARAMETERS], layout[TWISTS]):
        on = terms[i, ON]
        value = p[on] * v[terms[i, VALUE]]
        p[on] = blended(shares[i], value, p[on]) if terms[i, GATE] < terms[i, GATE_END] else value


@compiled
def found(
    layout: IntArray,
    terms: IntArray,
    curves: IntArray,
    knots: FloatArray,
    v: FloatArray,
    shares: FloatArray,
    p: FloatArray,
    x: State,
    u: tuple[float, float],
    begun: State,
    step: float,
    extra: Rates,
) -> Rates:
    """The rates in a state, whatever acts."""
    if layout[FORCES] < layout[PARAMETERS]:
        r = pushed(layout, terms, curves, knots, v, shares, p, x, u, begun, step)
    else:
        r = rates(layout[SYSTEM], layout[HELD], x, u, p, 0.0, 0.0)
    for i in range(layout[TWISTS], layout[RATES]):
        if terms[i, LAW] >= TURN_CURVE:
            new = turned(terms[i], r, v, curves, knots)
        else:
            new = twist(terms[i, LAW], terms[i, VALUE], r, v)
        if terms[i, GATE] < terms[i, GATE_END]:
            s = shares[i]
            new = blended(s, new[0], r[0]), blended(s, new[1], r[1]), blended(s, new[2], r[2])
        r = new
    for i in range(layout[RATES], layout[TERMS]):
        r = with_curve(layout, terms[i], curves, knots, v, shares[i], p, x, u, r)
    return r[0] + extra[0], r[1] + extra[1], r[2] + extra[2]


@compiled
def with_curve(
    layout: IntArray,
    term: IntArray,
    curves: IntArray,
    knots: FloatArray,
    v: FloatArray,
    acts: float,
    p: FloatArray,
    x: State,
    u: tuple[float, float],
    r: Rates,
) -> Rates:
    """The rates and a free curve that is added to one of them, or to a command."""
    more = curve_at(x, u, curves[term[CURVE]], knots, v, term[VALUE])
    s = acts if term[GATE] < term[GATE_END] else 1.0
    on = term[ON]
    if term[LAW] == DRIVE_CURVE:
        other = (u[0] + more, u[1]) if on == 0 else (u[0], u[1] + more)
        a = rates(layout[SYSTEM], layout[HELD], x, other, p, 0.0, 0.0)
        b = rates(layout[SYSTEM], layout[HELD], x, u, p, 0.0, 0.0)
        return r[0] + s * (a[0] - b[0]), r[1] + s * (a[1] - b[1]), r[2] + s * (a[2] - b[2])
    return (
        r[0] + s * more if on == 0 else r[0],
        r[1] + s * more if on == 1 else r[1],
        r[2] + s * more if on == 2 else r[2],
    )


@compiled
def slope(layout: IntArray, x: State, r: Rates) -> State:
    """D state / dt; of states that are left out nothing."""
    d = derivative(layout[SYSTEM], x, r)
    still = layout[STILL]
    if still == 0:
        return d
    return (
        0.0 if still & 1 else d[0],
        0.0 if still & 2 else d[1],
        0.0 if still & 4 else d[2],
        0.0 if still & 8 else d[3],
    )


@compiled
def plus(x: State, h: float, d: State) -> State:
    """A straight line on."""
    return x[0] + h * d[0], x[1] + h * d[1], x[2] + h * d[2], x[3] + h * d[3]


@compiled
def advance(
    layout: IntArray,
    terms: IntArray,
    conditions: IntArray,
    curves: IntArray,
    knots: FloatArray,
    believed: FloatArray,
    v: FloatArray,
    shares: FloatArray,
    p: FloatArray,
    x: State,
    u: tuple[float, float],
    t: float,
    h: float,
    extra: Rates,
) -> State:
    """The state after a substep of h [s]; shares and p are room to write to."""
    scheme, system = layout[SCHEME], layout[SYSTEM]
    if layout[CHANGING]:
        ahead = x
        if layout[AHEAD] > 0:
            first: Rates = (0.0, 0.0, 0.0)
            if layout[AHEAD] > 1:
                first = rates(system, layout[HELD], x, u, believed, 0.0, 0.0)
            ahead = plus(x, h, slope(layout, x, first))
        looked = h if scheme == FINE else 0.0
        for i in range(layout[TERMS]):
            if terms[i, GATE] < terms[i, GATE_END]:
                shares[i] = share(
                    terms[i, GATE], terms[i, GATE_END], conditions, knots, v, x, ahead, u, t, looked
                )
        corrected(layout, terms, v, shares, believed, p)
    r = found(layout, terms, curves, knots, v, shares, p, x, u, x, h, extra)
    k1 = slope(layout, x, r)
    if scheme == EULER:
        return plus(x, h, k1)
    if scheme == SEMI_IMPLICIT:
        n = plus(x, h, k1)
        if system == UNICYCLE or system == ACKERMANN:
            return n
        still = layout[STILL]
        q0 = x[0] if still & 1 else x[0] + h * n[1]
        q1 = x[2] if still & 4 else x[2] + h * n[3]
        return q0, n[1], q1, n[3]
    # Where they are the same in all states, as a vehicle's often are, rates are found once.
    held = (system == UNICYCLE or system == ACKERMANN) and layout[FORCES] == layout[PARAMETERS]
    held = held and layout[RATES] == layout[TERMS]
    if scheme == FINE:  # Heun (1900), third order
        second = plus(x, h / 3.0, k1)
        if not held:
            r = found(layout, terms, curves, knots, v, shares, p, second, u, x, h, extra)
        third = plus(x, 2.0 * h / 3.0, slope(layout, second, r))
        if not held:
            r = found(layout, terms, curves, knots, v, shares, p, third, u, x, h, extra)
        k3 = slope(layout, third, r)
        w = h / 4.0
        return (
            x[0] + w * (k1[0] + 3.0 * k3[0]),
            x[1] + w * (k1[1] + 3.0 * k3[1]),
            x[2] + w * (k1[2] + 3.0 * k3[2]),
            x[3] + w * (k1[3] + 3.0 * k3[3]),
        )
    at = plus(x, h / 2.0, k1)
    if not held:
        r = found(layout, terms, curves, knots, v, shares, p, at, u, x, h, extra)
    k2 = slope(layout, at, r)
    at = plus(x, h / 2.0, k2)
    if not held:
        r = found(layout, terms, curves, knots, v, shares, p, at, u, x, h, extra)
    k3 = slope(layout, at, r)
    at = plus(x, h, k3)
    if not held:
        r = found(layout, terms, curves, knots, v, shares, p, at, u, x, h, extra)
    k4 = slope(layout, at, r)
    w = h / 6.0
    return (
        x[0] + w * (k1[0] + 2.0 * k2[0] + 2.0 * k3[0] + k4[0]),
        x[1] + w * (k1[1] + 2.0 * k2[1] + 2.0 * k3[1] + k4[1]),
        x[2] + w * (k1[2] + 2.0 * k2[2] + 2.0 * k3[2] + k4[2]),
        x[3] + w * (k1[3] + 2.0 * k2[3] + 2.0 * k3[3] + k4[3]),
    )
