"""Commands on their way through one row's actuators, a substep at a time (see `gpsim.effects.commands`).

What several commands make of one substep, after a delay, goes on in pieces: (3, .) values, lengths [s], and when they
begin [s]. An actuator's memory is a level, or the commands of a delay, the newest last in a ring, how long each of them
lasted, and where the oldest lies.
"""

from __future__ import annotations

import math

from gpsim.channels import FloatArray, IntArray
from gpsim.kernels.catalogue import passed_of
from gpsim.kernels.codes import (
    ASYMMETRY,
    BACKLASH,
    BIAS,
    DEAD_ZONE,
    DELAY,
    DEPTH,
    FINE,
    FOLLOWED,
    GAIN,
    GATE,
    GATE_END,
    LAW,
    MEMORY,
    ON,
    OWN,
    RATE_LIMIT,
    SAG,
    SATURATION,
    SCHEME,
    VALUE,
)
from gpsim.kernels.compiling import compiled
from gpsim.kernels.gates import share_of
from gpsim.kernels.scalars import blended, clipped, larger, smaller


@compiled
def act(
    layout: IntArray,
    actuators: IntArray,
    conditions: IntArray,
    knots: FloatArray,
    v: FloatArray,
    lane: int,
    path: FloatArray,
    memory: FloatArray,
    uneven: int,
    t: float,
    h: float,
    pieces: FloatArray,
    u: FloatArray,
) -> None:
    """Change the commands u (A,) to what reaches the simulator in a substep of h [s] that begins at t [s].

    path: (2, 6) the channels at both ends of it, commands as they were given; memory of the row moves on.
    """
    looking = 1.0 if layout[SCHEME] == FINE else 0.0
    count = 1
    for n in range(len(actuators)):
        on = actuators[n, ON]
        if n == 0 or actuators[n - 1, ON] != on:  # a new way
            count = 1
            pieces[0, 0], pieces[1, 0], pieces[2, 0] = u[on], h, t
        gated = actuators[n, GATE] < actuators[n, GATE_END]
        if actuators[n, LAW] == DELAY:
            untouched = pieces[0, 0]
            count = delayed(actuators, n, v, lane, memory, uneven, untouched, t, h, pieces)
            if gated:
                acts = share_of(
                    actuators[n, GATE],
                    actuators[n, GATE_END],
                    conditions,
                    knots,
                    v,
                    lane,
                    path,
                    t,
                    looking * h,
                )
                for i in range(count):
                    pieces[0, i] = blended(acts, pieces[0, i], untouched)
        else:
            for i in range(count):
                begin, length, before = pieces[2, i], pieces[1, i], pieces[0, i]
                law, place = actuators[n, LAW], actuators[n, MEMORY]
                after = passed(law, actuators[n, VALUE], v, lane, memory, place, before, begin, length)
                if gated:
                    acts = share_of(
                        actuators[n, GATE], actuators[n, GATE_END], conditions, knots, v, lane, path, begin,
                        looking * length,
                    )  # fmt: skip
                    after = blended(acts, after, before)
                pieces[0, i] = after
        if not actuators[n, FOLLOWED]:
            total = pieces[0, 0]
            if count > 1:
                total = 0.0
                for i in range(count):
                    total += pieces[0, i] * pieces[1, i]
                total /= h
            u[on] = total


@compiled
def passed(
    law: int, at: int, v: FloatArray, i: int, memory: FloatArray, place: int, u: float, t: float, h: float
) -> float:
    """What a law makes of a command that is held for h [s] from t [s] on, a mean over that time."""
    first: float = v[at, i]
    if law >= OWN:
        return passed_of(law, u, v, at, i)
    if law == GAIN:
        return first * u
    if law == BIAS:
        return u + first
    if law == DEAD_ZONE:
        return 0.0 if abs(u) < first else u
    if law == SATURATION:
        return clipped(u, -first, first)
    if law == ASYMMETRY:
        below: float = v[at + 1, i]
        return (first if u > 0.0 else below) * u
    if law == SAG:
        return u * larger(1.0 - first * t, 0.0)
    level: float = memory[place]
    if law == BACKLASH:
        held = smaller(larger(u - first, level), u + first)
        memory[place] = held
        return held
    if law == RATE_LIMIT:
        reach = first * h
        now = smaller(larger(u, level - reach), level + reach)
        moved, memory[place] = now - level, now
        return now - moved * abs(moved) / larger(2.0 * reach, 1e-300)
    ratio = larger(h, 1e-12) / larger(first, 1e-9)
    behind = level - u
    memory[place] = behind * math.exp(-ratio) + u
    return u + behind * (-math.expm1(-ratio) / ratio)


@compiled
def late_by(delay: float, drift: float, t: float, h: float) -> float:
    """By how much [s] commands are late in a substep of h [s] from t [s] on: a delay [s], and a clock's drift [ppm]."""
    return delay + 1e-6 * drift * larger(t + h / 2, 0.0)


@compiled
def delayed(
    actuators: IntArray,
    n: int,
    v: FloatArray,
    lane: int,
    memory: FloatArray,
    uneven: int,
    u: float,
    t: float,
    h: float,
    pieces: FloatArray,
) -> int:
    """Fill pieces with the commands of a delay ago, and their mean where nobody follows; how many there are."""
    depth, at = actuators[n, DEPTH], actuators[n, MEMORY]
    value, head = actuators[n, VALUE], int(memory[at + 2 * depth])
    delay = late_by(v[value, lane], v[value + 1, lane], t, h)
    if uneven:
        count = met(memory, at, depth, head, delay, u, h, pieces)
    else:
        back = min(delay / h, depth - 1.0)
        whole = int(back)
        pieces[0, 0] = memory[at + (head - whole - 1) % depth]
        memory[at + head] = u  # over the oldest
        pieces[0, 1] = memory[at + (head - whole) % depth]
        pieces[1, 0], count = back - whole, 2
        pieces[1, 1] = 1.0 - pieces[1, 0]
    memory[at + 2 * depth] = (head + 1) % depth
    if not actuators[n, FOLLOWED]:
        total = 0.0
        if uneven:
            for i in range(count):
                total += pieces[0, i] * pieces[1, i]
        else:
            total = pieces[0, 1] + pieces[1, 0] * (pieces[0, 0] - pieces[0, 1])
        pieces[0, 0], count = total, 1
        pieces[1, 0] = 1.0
    begin = 0.0
    for i in range(count):
        pieces[1, i] *= h
        begin += pieces[1, i]
        pieces[2, i] = t + begin - pieces[1, i]
    return count


@compiled
def met(
    memory: FloatArray, at: int, depth: int, head: int, delay: float, u: float, h: float, pieces: FloatArray
) -> int:
    """Fill pieces with the commands that a substep meets a delay ago, and their shares, on an uneven clock.

    Ages [s] are counted back from the substep's end; the oldest command is all that is known of what was before.
    """
    total = h
    for i in range(depth):
        total += memory[at + depth + i]
    high, low = total - delay, total - h - delay
    high, low = (high if high > 0.0 else 0.0), (low if low > 0.0 else 0.0)
    count, whole, begin = 0, 0.0, 0.0
    for i in range(depth + 1):
        place = (head + i) % depth
        length = memory[at + depth + place] if i < depth else h
        command = memory[at + place] if i < depth else u
        end = begin + length
        inside = min(end, high) - max(begin, low)
        if inside > 0.0:
            pieces[0, count], pieces[1, count] = command, inside
            whole += inside
            count += 1
        elif begin <= low and count == 0:
            pieces[0, count] = command  # a substep of no length meets the last one that had begun
        begin = end
    memory[at + head], memory[at + depth + head] = u, h
    if count == 0:
        pieces[1, 0], whole, count = 1.0, 1.0, 1
    for i in range(count):
        pieces[1, i] /= whole
    return count
