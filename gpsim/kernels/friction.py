"""Generalised forces, dry friction that sticks, bristles and elastic drives, for lanes of rows.

See `gpsim.effects.forces`, `bristles` and `elastic`.
"""

from __future__ import annotations

import math

from gpsim.channels import FloatArray, IntArray
from gpsim.kernels import codes
from gpsim.kernels.compiling import compiled, larger, place, sign, smaller
from gpsim.kernels.lanes import (
    AGAINST,
    BEFORE,
    BEGUN,
    BENT,
    FREE,
    GIVEN,
    HOLDS,
    LANES,
    LIGHT,
    LIGHTER,
    LOAD,
    M1,
    MOST,
    ONE,
    R1,
    TWIST,
    X1,
    Y1,
    F,
    H,
    M,
    R,
    U,
)
from gpsim.kernels.laws import force, friction_limit
from gpsim.kernels.systems import mobility, normal_force, rates, turning

ROUNDS, EXACT = 60, 1e-12


@compiled
def level(force: float, still: float, slow: float, speed: float) -> float:
    """What slides at a speed."""
    more = larger(still - force, 0.0)
    return larger(force + (more * math.exp(-((speed / slow) ** 2)) if more > 0.0 else 0.0), 1e-300)


@compiled
def faded(a: float) -> tuple[float, float]:
    """(1 - e^-a) / a and what is left of 1, over a."""
    first = 1.0 - a / 2 if a < 1e-5 else -math.expm1(-a) / a
    second = 0.5 - a / 6 + a * a / 24 if a < 1e-3 else (1.0 + math.expm1(-a) / a) / a
    return first, second


@compiled
def missed(
    at: float,
    free: float,
    reacts: float,
    h: float,
    bend: float,
    damping: float,
    v: FloatArray,
    n: int,
    i: int,
) -> tuple[float, float]:
    """By how much a mean speed is not the one that its own mean force makes, and that force."""
    stiffness, way = v[n + 3, i], at * h
    a = stiffness * abs(way) / level(v[n, i], v[n + 1, i], v[n + 2, i], at)
    first, second = faded(a)
    end = bend * math.exp(-a) + way * first
    force = -(stiffness * (bend * first + way * second) + damping * (end - bend) / h)
    return at - free - h / 2 * reacts * force, force


@compiled
def mean_force(
    bend: float, speed: float, own: float, reacts: float, step: float, v: FloatArray, n: int, i: int
) -> float:
    """The mean force over a substep; the values of row i begin at n."""
    stiffness: float = v[n + 3, i]
    if step < 0.0:
        return -stiffness * bend
    h = larger(step, 1e-9)
    damping, free = math.sqrt(stiffness / reacts), speed + h / 2 * own
    furthest = larger(abs(bend), level(v[n, i], v[n + 1, i], v[n + 2, i], 0.0) / stiffness)
    most = h / 2 * reacts * (stiffness + 2 * damping / h) * furthest
    low, high = free - most, free + most
    left, force = missed(low, free, reacts, h, bend, damping, v, n, i)
    right, force = missed(high, free, reacts, h, bend, damping, v, n, i)
    close = EXACT * (abs(speed) + abs(free) + most)
    for _ in range(ROUNDS):
        at = high - right * (high - low) / (1.0 if right == left else right - left)
        off, force = missed(at, free, reacts, h, bend, damping, v, n, i)
        if abs(off) <= close:
            break
        if off * right < 0.0:
            low, left = high, right
        else:
            left *= 0.5
        high, right = at, off
    return force


@compiled
def yield_on(b: FloatArray, lanes: int, layout: IntArray, terms: IntArray, n: int, v: FloatArray) -> None:
    """Add to R what the bristles of the term n change."""
    on, at = terms[n, codes.ON], terms[n, codes.VALUE]
    mobility(b, lanes, layout[codes.SYSTEM], layout[codes.HELD], on)
    own, reacts, begun = place(R + on * LANES), place(M + on * LANES), place(X1 + 2 * on * LANES)
    bend = place(BENT + on * LANES)
    for i in range(lanes):
        force = mean_force(b[bend + i], b[begun + i], b[own + i], b[reacts + i], b[H + i], v, at, i)
        b[R + i] += b[M + i] * force
        if layout[codes.SYSTEM] == codes.CARTPOLE:
            b[R1 + i] += b[M1 + i] * force


@compiled
def bend_on(b: FloatArray, lanes: int, layout: IntArray, terms: IntArray, v: FloatArray) -> None:
    """Bend bristles on from X to Y, over a substep; not back in time."""
    for n in range(layout[codes.DRY], layout[codes.PARAMETERS]):
        if terms[n, codes.LAW] == codes.BRISTLES:
            at, on = terms[n, codes.VALUE], terms[n, codes.ON]
            bend, begun, ended = (
                place(BENT + on * LANES), place(X1 + 2 * on * LANES), place(Y1 + 2 * on * LANES)
            )  # fmt: skip
            for i in range(lanes):
                if b[H + i] >= 0.0:
                    speed = 0.5 * (b[begun + i] + b[ended + i])
                    way = speed * b[H + i]
                    a = v[at + 3, i] * abs(way) / level(v[at, i], v[at + 1, i], v[at + 2, i], speed)
                    first, _ = faded(a)
                    b[bend + i] = b[bend + i] * math.exp(-a) + way * first


CRITICAL = 1e-6


@compiled
def waves(gamma: float, square: float, step: float) -> tuple[float, float]:
    """e^-gh cosh(r h) and e^-gh sinh(r h) / r of an oscillator."""
    root = math.sqrt(abs(gamma * gamma - square))
    angle, faded = root * step, math.exp(-gamma * step)
    if gamma * gamma > square:
        slow, fast = math.exp(-square / (gamma + root) * step), math.exp(-(gamma + root) * step)
        cosh, sinh = (slow + fast) / 2, (slow - fast) / 2
    else:
        cosh, sinh = faded * math.cos(angle), faded * math.sin(angle)
    return cosh, faded * step if angle < CRITICAL else sinh / root


@compiled
def twisted(
    twist: float, rate: float, push: float, reacts: float, step: float, v: FloatArray, n: int, i: int
) -> tuple[float, float, float]:
    """Twist and its rate after a substep, and the mean of what it transmits; the values of row i begin at n."""
    light = 1.0 / v[n + 2, i] + reacts
    square, gamma = light * v[n, i], light * v[n + 1, i] / 2
    cosh, sinh = waves(gamma, square, step)
    rest = push / square
    end = rest + (cosh + gamma * sinh) * (twist - rest) + sinh * rate
    speed = -square * sinh * (twist - rest) + (cosh - gamma * sinh) * rate
    return end, speed, (push - (speed - rate) / step) / light


@compiled
def react(b: FloatArray, lanes: int, layout: IntArray, on: int, u: int) -> None:
    """Fill FREE with how a coordinate is accelerated without its command, LIGHT with what a unit of that adds."""
    own = place(R + on * LANES)
    for i in range(lanes):
        b[u + i] = 0.0
    rates(b, lanes, layout[codes.SYSTEM], layout[codes.HELD])
    for i in range(lanes):
        b[FREE + i], b[u + i] = b[own + i], 1.0
    rates(b, lanes, layout[codes.SYSTEM], layout[codes.HELD])
    for i in range(lanes):
        b[LIGHT + i] = b[own + i] - b[FREE + i]


@compiled
def transmit(b: FloatArray, lanes: int, layout: IntArray, terms: IntArray, v: FloatArray) -> None:
    """Change U to what elastic drives transmit of it, a mean over the substep."""
    for n in range(layout[codes.FORCES]):
        if terms[n, codes.LAW] == codes.ELASTIC:
            u, at, z = (
                place(U + terms[n, codes.CURVE] * LANES),
                terms[n, codes.VALUE],
                place(TWIST + 2 * terms[n, codes.CURVE] * LANES),
            )
            for i in range(lanes):
                b[GIVEN + i] = b[u + i]
            react(b, lanes, layout, terms[n, codes.ON], u)
            for i in range(lanes):
                held = v[at, i] * b[z + i] + v[at + 1, i] * b[z + LANES + i]
                push = b[GIVEN + i] / v[at + 2, i] - b[FREE + i]
                _, _, mean = twisted(
                    b[z + i], b[z + LANES + i], push, b[LIGHT + i], larger(b[H + i], 1e-9), v, at, i
                )
                b[u + i] = held if b[H + i] < 0.0 else mean


@compiled
def turn_on(b: FloatArray, lanes: int, layout: IntArray, terms: IntArray, v: FloatArray) -> None:
    """Twist elastic drives on, from X to Y, over a substep, by what drives gave in U; not back in time."""
    for n in range(layout[codes.FORCES]):
        if terms[n, codes.LAW] == codes.ELASTIC:
            on, at = terms[n, codes.ON], terms[n, codes.VALUE]
            u, z = place(U + terms[n, codes.CURVE] * LANES), place(TWIST + 2 * terms[n, codes.CURVE] * LANES)
            begun, ended = place(X1 + 2 * on * LANES), place(Y1 + 2 * on * LANES)
            for i in range(lanes):
                b[GIVEN + i] = b[u + i]
            turning(b, lanes, layout[codes.SYSTEM])
            react(b, lanes, layout, on, u)
            for i in range(lanes):
                b[u + i], h, free = b[GIVEN + i], larger(b[H + i], 1e-9), b[GIVEN + i] / v[at + 2, i]
                moved, reacts = (b[ended + i] - b[begun + i]) / h, b[LIGHT + i]
                _, _, mean = twisted(b[z + i], b[z + LANES + i], free, reacts, h, v, at, i)
                _, _, less = twisted(0.0, 0.0, 1.0, reacts, h, v, at, i)
                own = (moved - reacts * mean) / (1.0 - reacts * less)
                end, speed, _ = twisted(b[z + i], b[z + LANES + i], free - own, reacts, h, v, at, i)
                if b[H + i] >= 0.0:
                    b[z + i], b[z + LANES + i] = end, speed


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
    for n in range(layout[codes.FORCES], layout[codes.DRY]):
        force(b, lanes, terms, n, v, shares, curves, knots, place(F + terms[n, codes.ON] * LANES))


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
def apply_friction(
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
    on, fine = terms[first, codes.ON], layout[codes.SCHEME] == codes.FINE
    mobility(b, lanes, layout[codes.SYSTEM], layout[codes.HELD], on)
    look_at(b, lanes, on, fine)
    weighs = False
    for n in range(first, last):
        weighs = weighs or codes.WEIGHED <= terms[n, codes.LAW] < codes.LOADED
    loaded = weighs and layout[codes.SYSTEM] == codes.CARTPOLE and on == 0
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
            friction_limit(b, lanes, terms, n, v, shares, loaded, curves, knots)
    if loaded:
        for i in range(lanes):
            most = b[BEFORE + i]
            slope = (b[MOST + i] - most) / most if most > 0.0 else 0.0
            b[MOST + i] = most / larger(1.0 - slope, 0.1)
    stick(b, lanes, on, fine)
    for i in range(lanes):
        b[R + i] += b[M + i] * b[ONE + i]
    if layout[codes.SYSTEM] == codes.CARTPOLE:
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
    first = layout[codes.DRY]
    while first < layout[codes.PARAMETERS]:
        if terms[first, codes.LAW] == codes.BRISTLES:
            yield_on(b, lanes, layout, terms, first, v)
            first += 1
            continue
        last = first + 1
        while last < layout[codes.PARAMETERS] and terms[last, codes.ON] == terms[first, codes.ON]:
            last += 1
        apply_friction(b, lanes, layout, terms, curves, knots, v, shares, first, last)
        first = last
