"""Commands on their way through one row's actuators, a substep at a time (see `gpsim.effects.actuation`).

What several commands make of one substep, after a delay, goes on in pieces: (3, .) values, lengths [s], and when they
begin [s]. An actuator's memory is a level, or the commands of a delay, the newest last in a ring, how long each of them
lasted, and where the oldest lies.
"""

from __future__ import annotations

from gpsim.channels import FloatArray, IntArray
from gpsim.kernels import codes
from gpsim.kernels.compiling import blended, compiled
from gpsim.kernels.gates import share_of
from gpsim.kernels.laws import late_of, passed_of


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
    looking = 1.0 if layout[codes.SCHEME] == codes.FINE else 0.0
    count = 1
    for n in range(len(actuators)):
        on = actuators[n, codes.ON]
        if n == 0 or actuators[n - 1, codes.ON] != on:  # a new way
            count = 1
            pieces[0, 0], pieces[1, 0], pieces[2, 0] = u[on], h, t
        gated = actuators[n, codes.GATE] < actuators[n, codes.GATE_END]
        if codes.LATE <= actuators[n, codes.LAW] < codes.PASSES:
            untouched = pieces[0, 0]
            count = delayed(actuators, n, v, lane, memory, uneven, untouched, t, h, pieces)
            if gated:
                acts = share_of(
                    actuators[n, codes.GATE],
                    actuators[n, codes.GATE_END],
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
                law, place = actuators[n, codes.LAW], actuators[n, codes.MEMORY]
                after = passed_of(
                    law, actuators[n, codes.VALUE], v, lane, memory, place, before, begin, length
                )
                if gated:
                    acts = share_of(
                        actuators[n, codes.GATE], actuators[n, codes.GATE_END], conditions, knots, v, lane, path, begin,
                        looking * length,
                    )  # fmt: skip
                    after = blended(acts, after, before)
                pieces[0, i] = after
        if not actuators[n, codes.FOLLOWED]:
            total = pieces[0, 0]
            if count > 1:
                total = 0.0
                for i in range(count):
                    total += pieces[0, i] * pieces[1, i]
                total /= h
            u[on] = total


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
    depth, at = actuators[n, codes.DEPTH], actuators[n, codes.MEMORY]
    head = int(memory[at + 2 * depth])
    delay = late_of(actuators[n, codes.LAW], h, t, v, actuators[n, codes.VALUE], lane)
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
    if not actuators[n, codes.FOLLOWED]:
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
