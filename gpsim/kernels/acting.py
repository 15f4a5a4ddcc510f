"""Commands of one row through its actuators, law by law (see `gpsim.effects.actuation`).

Each law takes the commands of all substeps at once: which law it is, where its memory lies and what is constant are
found once. A substep is one piece, until a delay cuts it into those of the commands that it meets: (3, .) values,
lengths [s], and when they begin [s]. An actuator's memory is what its law remembers, or the commands of a delay, the
newest last in a ring, how long each of them lasted, and where the oldest lies.
"""

from __future__ import annotations

import numpy as np

from gpsim.channels import FloatArray, IntArray
from gpsim.kernels import codes
from gpsim.kernels.compiling import F1, F2, F3, I1, I2, blended, compiled, entry
from gpsim.kernels.gates import share_of
from gpsim.kernels.laws import changed_by, late_of


@compiled
def wait(
    law: int, v: FloatArray, at: int, lane: int, depth: int, steps: FloatArray, heard: FloatArray,
    pieces: FloatArray, of: IntArray,
) -> int:  # fmt: skip
    """Cut substeps, on an even clock, into two pieces each of the commands heard; how many there are."""
    for m in range(steps.shape[1]):
        t, h = steps[0, m], steps[1, m]
        back = late_of(law, h, t, v, at, lane) / h
        back = min(back if back > 0.0 else 0.0, depth - 1.0)
        whole, i = int(back), 2 * m
        length = (back - whole) * h
        pieces[0, i], pieces[1, i], pieces[2, i] = heard[0, depth + m - whole - 1], length, t
        i += 1
        pieces[0, i], pieces[1, i], pieces[2, i] = heard[0, depth + m - whole], h - length, t + length
        of[i - 1] = of[i] = m
    return len(steps[0]) * 2


@compiled
def meet(
    law: int, v: FloatArray, at: int, lane: int, depth: int, steps: FloatArray, heard: FloatArray,
    pieces: FloatArray, of: IntArray,
) -> int:  # fmt: skip
    """The same on an uneven clock, where there may be more or fewer.

    heard: commands, and when each ends [s], the oldest of which began at 0: it is all that is known of what was before.
    """
    used, first, count = 0, 0, steps.shape[1]
    for m in range(count):
        own, begun, whole, now = depth + m, used, 0.0, steps[0, m]
        high = heard[1, own] - late_of(law, steps[1, m], now, v, at, lane)
        low = high - steps[1, m]
        high, low = (high if high > 0.0 else 0.0), (low if low > 0.0 else 0.0)
        while first < own and heard[1, first] <= low:
            first += 1
        while first > 0 and heard[1, first - 1] > low:  # of a clock that drifts
            first -= 1
        i, begin = first, heard[1, first - 1] if first > 0 else 0.0
        while i <= own and begin < high and used < len(of) - count + m:
            inside = min(heard[1, i], high) - max(begin, low)
            if inside > 0.0:
                pieces[0, used], pieces[1, used] = heard[0, i], inside
                whole += inside
                used += 1
            begin = heard[1, i]
            i += 1
        if used == begun:  # a substep of no length meets the last one that had begun
            pieces[0, used], pieces[1, used], whole = heard[0, first], 1.0, 1.0
            used += 1
        for i in range(begun, used):
            pieces[1, i] *= steps[1, m] / whole
            pieces[2, i], of[i] = now, m
            now += pieces[1, i]
    return used


@compiled
def late(
    uneven: int, times: int, depth: int, law: int, v: FloatArray, at: int, lane: int, memory: FloatArray, place: int,
    steps: FloatArray, heard: FloatArray, pieces: FloatArray, of: IntArray,
) -> int:  # fmt: skip
    """Cut commands, one a substep, into the pieces of a delay; how many there are.

    memory: of a ring each of whose `depth` commands lasted so many times a substep; where that is once it moves on.
    """
    count, deep, i = steps.shape[1], depth * times, int(memory[place + 2 * depth])
    end = 0.0
    for k in range(depth):
        for j in range(times):
            heard[0, k * times + j] = memory[place + i]
        if uneven:
            end += memory[place + depth + i]
            heard[1, k] = end
        i = i + 1 if i + 1 < depth else 0
    for m in range(count):
        heard[0, deep + m] = pieces[0, m]
    if uneven:
        for m in range(count):
            end += steps[1, m]
            heard[1, deep + m] = end
    head = int(memory[place + 2 * depth])
    for k in range(count if times == 1 else 0):
        memory[place + head], memory[place + depth + head] = (
            heard[0, deep + k],
            steps[1, k],
        )  # over the oldest
        head = head + 1 if head + 1 < depth else 0
    memory[place + 2 * depth] = head
    if uneven:
        return meet(law, v, at, lane, deep, steps, heard, pieces, of)
    return wait(law, v, at, lane, deep, steps, heard, pieces, of)


@compiled
def pass_on(
    layout: IntArray, actuators: IntArray, conditions: IntArray, knots: FloatArray, v: FloatArray, lane: int,
    memory: FloatArray, path: FloatArray, steps: FloatArray, given: FloatArray, n: int, times: int, out: FloatArray,
    heard: FloatArray, pieces: FloatArray, was: FloatArray, of: IntArray,
) -> None:  # fmt: skip
    """Fill out (L n, A), unless it has no rows, with what becomes of commands given (L, A); memory moves on.

    path: (2, 6) the channels at both ends, for gates that look at them; steps: (2, L n) s, when each of n substeps of a
    command begins and how long it is; times: so many of them a command lasted that a delay has in its memory.
    """
    count = steps.shape[1]
    for x in range(given.shape[1]):
        for k in range(len(given)):
            for m in range(k * n, k * n + n):
                pieces[0, m] = given[k, x]
        for m in range(count):
            pieces[1, m], pieces[2, m], of[m] = steps[1, m], steps[0, m], m
        used = count
        for line in range(len(actuators)):
            if actuators[line, codes.ON] != x:
                continue
            law, at, place = (
                actuators[line, codes.LAW],
                actuators[line, codes.VALUE],
                actuators[line, codes.MEMORY],
            )
            first, end = actuators[line, codes.GATE], actuators[line, codes.GATE_END]
            if first < end:
                for i in range(used):
                    was[i] = pieces[0, i]
            if codes.LATE <= law < codes.PASSES:
                depth = actuators[line, codes.DEPTH]
                used = late(
                    layout[codes.UNEVEN],
                    times,
                    depth,
                    law,
                    v,
                    at,
                    lane,
                    memory,
                    place,
                    steps,
                    heard,
                    pieces,
                    of,
                )
            else:
                changed_by(law, at, v, lane, memory, place, pieces, used)
            if first < end:
                looking = 1.0 if layout[codes.SCHEME] == codes.FINE else 0.0
                for i in range(used):  # of what a delay does, the share of the substep counts
                    m = of[i] if law < codes.PASSES else i
                    t, h = (steps[0, m], steps[1, m]) if law < codes.PASSES else (pieces[2, i], pieces[1, i])
                    acts = share_of(first, end, conditions, knots, v, lane, path, t, looking * h)
                    pieces[0, i] = blended(acts, pieces[0, i], was[m])
        if used == count:
            for m in range(len(out)):
                out[m, x] = pieces[0, m]
        elif len(out):
            for m in range(count):
                out[m, x] = 0.0
            for i in range(used):
                out[of[i], x] += pieces[0, i] * pieces[1, i]
            for m in range(count):
                out[m, x] /= steps[1, m]


@compiled
def substeps(clock: FloatArray, n: int) -> FloatArray:
    """(2, L n) s, when each of n substeps of a transition begins, and how long it is; clock: (L + 1,) s."""
    out = np.empty((2, (len(clock) - 1) * n))
    for k in range(len(clock) - 1):
        step = (clock[k + 1] - clock[k]) / n
        for j in range(n):
            out[0, k * n + j], out[1, k * n + j] = clock[k] + j * step, step
    return out


@entry(f"void({I1}, {I2}, {I2}, {F1}, {F2}, {F2}, {F3}, {F2}, {I1}, {F3}, {F2}, {F3}, int64, int64)")
def travel(
    layout: IntArray,
    actuators: IntArray,
    conditions: IntArray,
    knots: FloatArray,
    values: FloatArray,
    earlier: FloatArray,
    led: FloatArray,
    clock: FloatArray,
    window: IntArray,
    given: FloatArray,
    memories: FloatArray,
    out: FloatArray,
    first: int,
    last: int,
) -> None:
    """Fill out (U, L n, A) with what reaches the simulator in the windows, whatever its state.

    values: (U, V); clock: (W, L + 1) s and given: (W, L, A), the commands, of each row's `window` (U,); earlier:
    (W, M + 1) s and led: (W, M, A), those of whole control steps before; memories: (U, .) at their start, or (1, .).
    """
    n, width = layout[codes.SUBSTEPS], memories.shape[1]
    count, times = given.shape[1] * n, n if led.shape[1] else 1
    most = max(count, led.shape[1]) + n * width  # twice what a delay remembers at least, and what comes
    heard, pieces, was = np.empty((2, 3 * most)), np.empty((3, 3 * most)), np.empty(3 * most)
    of, v = np.empty(3 * most, dtype=np.int64), np.empty((values.shape[1], 1))
    memory, nothing, path = np.empty(width), np.empty((0, given.shape[2])), np.zeros((2, 6))
    lane = int(np.int64(0))  # a literal 0 would have what it is given to compiled once more
    for row in range(first, last):
        w = window[row]
        v[:, 0] = values[row]
        memory[:] = memories[row if len(memories) > 1 else 0]
        tables = (layout, actuators, conditions, knots, v, lane, memory, path)
        if led.shape[1]:
            pass_on(*tables, substeps(earlier[w], 1), led[w], 1, 1, nothing, heard, pieces, was, of)
        pass_on(*tables, substeps(clock[w], n), given[w], n, times, out[row], heard, pieces, was, of)
