"""Generalised forces, and dry friction that sticks, for lanes of rows (see `gpsim.effects.forces`)."""

from __future__ import annotations

from gpsim.channels import FloatArray, IntArray
from gpsim.kernels.codes import (
    CARTPOLE,
    COEFFICIENT,
    DRY,
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
from gpsim.kernels.lanes import (
    AGAINST,
    BEFORE,
    BEGUN,
    F1,
    LIGHTER,
    LOAD,
    M1,
    MOST,
    ONE,
    OWN,
    POSITION,
    R1,
    REACTS,
    SPEED,
    X1,
    X3,
    Y1,
    Y2,
    Y3,
    F,
    H,
    M,
    R,
    Y,
)
from gpsim.kernels.laws import force, grip
from gpsim.kernels.scalars import larger, sign, smaller
from gpsim.kernels.systems import mobility, normal_force


@compiled
def coordinate(b: FloatArray, lanes: int, on: int) -> None:
    """Fill POSITION and SPEED with those of a coordinate in the stage's state."""
    if on == 0:
        for i in range(lanes):
            b[POSITION + i], b[SPEED + i] = b[Y + i], b[Y1 + i]
    else:
        for i in range(lanes):
            b[POSITION + i], b[SPEED + i] = b[Y2 + i], b[Y3 + i]


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
    for i in range(2 * lanes):
        b[F + i] = 0.0
    for n in range(layout[FORCES], layout[DRY]):
        coordinate(b, lanes, terms[n, ON])
        force(b, lanes, terms, n, v, curves, knots)
        if terms[n, GATE] < terms[n, GATE_END]:
            for i in range(lanes):
                b[ONE + i] *= shares[n, i]
        if terms[n, ON] == 0:
            for i in range(lanes):
                b[F + i] += b[ONE + i]
        else:
            for i in range(lanes):
                b[F1 + i] += b[ONE + i]


@compiled
def look_at(b: FloatArray, lanes: int, on: int, fine: bool) -> None:
    """Fill OWN and REACTS, and BEGUN with the speed that friction is against: at the substep's begin, if it sticks."""
    if on == 0:
        for i in range(lanes):
            b[OWN + i], b[REACTS + i] = b[R + i], b[M + i]
            b[BEGUN + i] = b[X1 + i] if fine else b[Y1 + i]
    else:
        for i in range(lanes):
            b[OWN + i], b[REACTS + i] = b[R1 + i], b[M1 + i]
            b[BEGUN + i] = b[X3 + i] if fine else b[Y3 + i]
    for i in range(lanes):
        against = -sign(b[OWN + i] / b[REACTS + i])
        b[AGAINST + i] = against if fine and b[BEGUN + i] == 0.0 else -sign(b[BEGUN + i])


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
        weighs = weighs or terms[n, LAW] == COEFFICIENT
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
        grips(b, lanes, terms, curves, knots, v, shares, loaded, first, last)
    if loaded:
        for i in range(lanes):
            most = b[BEFORE + i]
            slope = (b[MOST + i] - most) / most if most > 0.0 else 0.0
            b[MOST + i] = most / larger(1.0 - slope, 0.1)
    stick(b, lanes, fine)
    for i in range(lanes):
        b[R + i] += b[M + i] * b[ONE + i]
    if layout[SYSTEM] == CARTPOLE:
        for i in range(lanes):
            b[R1 + i] += b[M1 + i] * b[ONE + i]


@compiled
def stick(b: FloatArray, lanes: int, fine: bool) -> None:
    """Fill ONE with the friction force, a mean over the substep."""
    for i in range(lanes):
        b[ONE + i] = b[AGAINST + i] * b[MOST + i]
    if not fine:
        return
    for i in range(lanes):
        most, moves, speed = b[MOST + i], b[ONE + i], b[BEGUN + i]
        after = speed + b[H + i] * (b[OWN + i] + b[REACTS + i] * moves)
        holding = smaller(larger(-b[OWN + i] / b[REACTS + i], -most), most)
        part = speed / (1.0 if speed == after else speed - after)
        stopped = part * moves + (1.0 - part) * holding
        b[ONE + i] = stopped if speed * after <= 0.0 else moves


@compiled
def grips(
    b: FloatArray,
    lanes: int,
    terms: IntArray,
    curves: IntArray,
    knots: FloatArray,
    v: FloatArray,
    shares: FloatArray,
    loaded: bool,
    first: int,
    last: int,
) -> None:
    """Fill MOST with the most that all of the terms first to last can hold together."""
    for i in range(lanes):
        b[MOST + i] = 0.0
    for n in range(first, last):
        coordinate(b, lanes, terms[n, ON])
        grip(b, lanes, terms, n, v, loaded, curves, knots)
        if terms[n, GATE] < terms[n, GATE_END]:
            for i in range(lanes):
                b[MOST + i] += b[ONE + i] * shares[n, i]
        else:
            for i in range(lanes):
                b[MOST + i] += b[ONE + i]


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
    """Dry friction on one coordinate, then on the other; the terms of each lie together."""
    first = layout[DRY]
    while first < layout[PARAMETERS]:
        last = first + 1
        while last < layout[PARAMETERS] and terms[last, ON] == terms[first, ON]:
            last += 1
        rub(b, lanes, layout, terms, curves, knots, v, shares, first, last)
        first = last
