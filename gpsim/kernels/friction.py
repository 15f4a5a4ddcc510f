"""Generalised forces, and dry friction that sticks, of one state (see `gpsim.effects.forces`, which this repeats)."""

from __future__ import annotations

from gpsim.channels import FloatArray, IntArray
from gpsim.kernels.codes import (
    CARTPOLE,
    COEFFICIENT,
    DRY,
    DRY_SECOND,
    FINE,
    FORCES,
    GATE,
    GATE_END,
    HELD,
    LAW,
    ON,
    PARAMETERS,
    SCHEME,
    SYSTEM,
)
from gpsim.kernels.compiling import compiled
from gpsim.kernels.laws import force, grip
from gpsim.kernels.scalars import larger, sign, smaller
from gpsim.kernels.systems import Rates, State, load, mobility, rates


@compiled
def pushed(
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
) -> Rates:
    """Rates under all force terms; begun: the state in which the substep began."""
    f0, f1 = 0.0, 0.0
    for i in range(layout[FORCES], layout[DRY]):
        term = terms[i]
        on = term[ON]
        one = force(term, x[2 * on], x[2 * on + 1], v, curves, knots)
        if term[GATE] < term[GATE_END]:
            one *= shares[i]
        if on == 0:
            f0 += one
        else:
            f1 += one
    r = rates(layout[SYSTEM], layout[HELD], x, u, p, f0, f1)
    if layout[DRY] < layout[DRY_SECOND]:
        r = rubbed(layout, terms, curves, knots, v, shares, p, x, r, begun, step, layout[DRY], layout[DRY_SECOND])
    if layout[DRY_SECOND] < layout[PARAMETERS]:
        r = rubbed(
            layout, terms, curves, knots, v, shares, p, x, r, begun, step, layout[DRY_SECOND], layout[PARAMETERS]
        )
    return r


@compiled
def rubbed(
    layout: IntArray,
    terms: IntArray,
    curves: IntArray,
    knots: FloatArray,
    v: FloatArray,
    shares: FloatArray,
    p: FloatArray,
    x: State,
    r: Rates,
    begun: State,
    step: float,
    first: int,
    last: int,
) -> Rates:
    """The rates with the dry friction of the terms first to last, which share a coordinate.

    A body that would reverse within the substep stops on the way; for the rest it is held as far as the grip allows, or
    starts the other way.
    """
    on = terms[first, ON]
    m0, m1 = mobility(layout[SYSTEM], layout[HELD], x, p, on)
    own, reacts = (r[0], m0) if on == 0 else (r[1], m1)
    fine = layout[SCHEME] == FINE
    speed = begun[2 * on + 1] if fine else x[2 * on + 1]
    against = -sign(speed)
    if fine and speed == 0.0:
        against = -sign(own / reacts)
    weighs, loaded = False, False
    for i in range(first, last):
        weighs = weighs or terms[i, LAW] == COEFFICIENT
    pressed = 0.0
    if weighs and layout[SYSTEM] == CARTPOLE and on == 0:
        loaded, pressed = True, load(x, r[0], r[1], p)
    most = gripped(terms, curves, knots, v, shares, x, loaded, pressed, first, last)
    if loaded:
        change = load(x, r[0] + m0, r[1] + m1, p) - pressed
        more = gripped(terms, curves, knots, v, shares, x, True, pressed + change * against * most, first, last)
        slope = (more - most) / most if most > 0.0 else 0.0
        most = most / larger(1.0 - slope, 0.1)
    friction = against * most
    if fine:
        after = speed + step * (own + reacts * friction)
        if speed * after <= 0.0:
            holding = smaller(larger(-own / reacts, -most), most)
            moving = speed / (1.0 if speed == after else speed - after)
            friction = moving * friction + (1.0 - moving) * holding
    return r[0] + m0 * friction, r[1] + m1 * friction, 0.0


@compiled
def gripped(
    terms: IntArray,
    curves: IntArray,
    knots: FloatArray,
    v: FloatArray,
    shares: FloatArray,
    x: State,
    loaded: bool,
    pressed: float,
    first: int,
    last: int,
) -> float:
    """The most that all of the terms first to last can hold."""
    total = 0.0
    for i in range(first, last):
        term = terms[i]
        on = term[ON]
        one = grip(term, x[2 * on], x[2 * on + 1], v, loaded, pressed, curves, knots)
        if term[GATE] < term[GATE_END]:
            one *= shares[i]
        total += one
    return total
