"""Generalised forces, and dry friction that sticks, for lanes of rows (see `gpsim.effects.forces`)."""

from __future__ import annotations

from gpsim.channels import FloatArray, IntArray
from gpsim.kernels.bristles import yield_on
from gpsim.kernels.codes import (
    BRISTLES,
    CARTPOLE,
    DRY,
    FINE,
    FORCES,
    HELD,
    LAW,
    LOADED,
    ON,
    PARAMETERS,
    SCHEME,
    SYSTEM,
    WEIGHED,
)
from gpsim.kernels.compiling import compiled
from gpsim.kernels.lanes import (
    AGAINST,
    BEFORE,
    BEGUN,
    HOLDS,
    LANES,
    LIGHTER,
    LOAD,
    M1,
    MOST,
    ONE,
    R1,
    X1,
    Y1,
    F,
    H,
    M,
    R,
)
from gpsim.kernels.laws import force, grip
from gpsim.kernels.scalars import larger, place, sign, smaller
from gpsim.kernels.systems import mobility, normal_force


@compiled
def push(
    b: FloatArray,
    lanes: int,
    layout: IntArray,
    terms: IntArray,
    curves: IntArray,
    knots: FloatArray,
    v: FloatArray,
    shares: FloatArray,
) -> None:
    """Fill F and F1 with the smooth forces on the coordinates."""
    for i in range(2 * LANES):
        b[F + i] = 0.0
    for n in range(layout[FORCES], layout[DRY]):
        force(b, lanes, terms, n, v, shares, curves, knots, place(F + terms[n, ON] * LANES))


@compiled
def look_at(b: FloatArray, lanes: int, on: int, fine: bool) -> None:
    """Fill HOLDS with what would hold a coordinate, AGAINST with the direction of its friction.

    BEGUN is the speed that friction is against: at the substep's begin, if it sticks.
    """
    own, reacts = place(R + on * LANES), place(M + on * LANES)
    begun = place((X1 if fine else Y1) + 2 * on * LANES)
    for i in range(lanes):
        holds, speed = -b[own + i] / b[reacts + i], b[begun + i]
        b[HOLDS + i], b[BEGUN + i] = holds, speed
        b[AGAINST + i] = sign(holds) if fine and speed == 0.0 else -sign(speed)


@compiled
def rub(
    b: FloatArray,
    lanes: int,
    layout: IntArray,
    terms: IntArray,
    curves: IntArray,
    knots: FloatArray,
    v: FloatArray,
    shares: FloatArray,
    first: int,
    last: int,
) -> None:
    """Add to R what the dry friction of the terms first to last changes, which share a coordinate.

    A body that would reverse within the substep stops on the way; for the rest it is held as far as the grip allows, or
    starts the other way.
    """
    on, fine = terms[first, ON], layout[SCHEME] == FINE
    mobility(b, lanes, layout[SYSTEM], layout[HELD], on)
    look_at(b, lanes, on, fine)
    weighs = False
    for n in range(first, last):
        weighs = weighs or WEIGHED <= terms[n, LAW] < LOADED
    loaded = weighs and layout[SYSTEM] == CARTPOLE and on == 0
    if loaded:
        normal_force(b, lanes, 0.0)
    for again in range(2 if loaded else 1):
        if again:  # load and friction depend on each other, both affinely
            for i in range(lanes):
                b[LIGHTER + i], b[BEFORE + i] = b[LOAD + i], b[MOST + i]
            normal_force(b, lanes, 1.0)
            for i in range(lanes):
                change = b[LOAD + i] - b[LIGHTER + i]
                b[LOAD + i] = b[LIGHTER + i] + change * b[AGAINST + i] * b[BEFORE + i]
        for i in range(LANES):
            b[MOST + i] = 0.0
        for n in range(first, last):
            grip(b, lanes, terms, n, v, shares, loaded, curves, knots)
    if loaded:
        for i in range(lanes):
            most = b[BEFORE + i]
            slope = (b[MOST + i] - most) / most if most > 0.0 else 0.0
            b[MOST + i] = most / larger(1.0 - slope, 0.1)
    stick(b, lanes, on, fine)
    for i in range(lanes):
        b[R + i] += b[M + i] * b[ONE + i]
    if layout[SYSTEM] == CARTPOLE:
        for i in range(lanes):
            b[R1 + i] += b[M1 + i] * b[ONE + i]


@compiled
def stick(b: FloatArray, lanes: int, on: int, fine: bool) -> None:
    """Fill ONE with the friction force, a mean over the substep."""
    if not fine:
        for i in range(lanes):
            b[ONE + i] = b[AGAINST + i] * b[MOST + i]
        return
    own, reacts = place(R + on * LANES), place(M + on * LANES)
    for i in range(lanes):
        most, speed = b[MOST + i], b[BEGUN + i]
        moves = b[AGAINST + i] * most
        after = speed + b[H + i] * (b[own + i] + b[reacts + i] * moves)
        holding = smaller(larger(b[HOLDS + i], -most), most)
        part = speed / (1.0 if speed == after else speed - after)
        stopped = part * moves + (1.0 - part) * holding
        b[ONE + i] = stopped if speed * after <= 0.0 else moves


@compiled
def rub_all(
    b: FloatArray,
    lanes: int,
    layout: IntArray,
    terms: IntArray,
    curves: IntArray,
    knots: FloatArray,
    v: FloatArray,
    shares: FloatArray,
) -> None:
    """Bristles, then other dry friction on one coordinate and on the other; the terms of each lie together."""
    first = layout[DRY]
    while first < layout[PARAMETERS]:
        if terms[first, LAW] == BRISTLES:
            yield_on(b, lanes, layout, terms, first, v)
            first += 1
            continue
        last = first + 1
        while last < layout[PARAMETERS] and terms[last, ON] == terms[first, ON]:
            last += 1
        rub(b, lanes, layout, terms, curves, knots, v, shares, first, last)
        first = last
