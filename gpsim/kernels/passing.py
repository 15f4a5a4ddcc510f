"""Commands of one row through the actuators on one way, law by law, where nothing depends on the state.

It gives what `gpsim.kernels.acting` gives a substep at a time, but each law takes the commands of all substeps at once:
which law it is, where its memory lies and what is constant are found once.
"""

from __future__ import annotations

import math

import numpy as np

from gpsim.channels import FloatArray, IntArray
from gpsim.kernels.acting import act, late_by, passed
from gpsim.kernels.codes import (
    BIAS,
    DEAD_ZONE,
    DELAY,
    DEPTH,
    FINE,
    FOLLOWED,
    GAIN,
    GATE,
    GATE_END,
    LAG,
    LAW,
    MEMORY,
    ON,
    SCHEME,
    SUBSTEPS,
    UNEVEN,
    VALUE,
)
from gpsim.kernels.compiling import F1, F2, F3, I1, I2, compiled, entry
from gpsim.kernels.gates import share_of
from gpsim.kernels.scalars import blended, larger


@compiled
def move(
    layout: IntArray,
    actuators: IntArray,
    n: int,
    conditions: IntArray,
    knots: FloatArray,
    v: FloatArray,
    memory: FloatArray,
    t: FloatArray,
    h: FloatArray,
    before: FloatArray,
    s: FloatArray,
) -> None:
    """Change the commands s (M,), one a substep of h [s] that begins at t [s] each, to what actuator n makes of them.

    memory of the row moves on; before: (depth + M,) room for what was commanded.
    """
    law, at, place, count = actuators[n, LAW], actuators[n, VALUE], actuators[n, MEMORY], len(s)
    gated = actuators[n, GATE] < actuators[n, GATE_END]
    # A delay has what it remembers before what is commanded now.
    depth = actuators[n, DEPTH] if law == DELAY else 0
    if gated or law == DELAY:
        for m in range(count):
            before[depth + m] = s[m]
    first, lane = v[at, 0], int(np.int64(0))
    if law == DELAY:
        wait(first, v[at + 1, 0], memory, place, depth, t, h, before, s)
    elif law == GAIN:
        for m in range(count):
            s[m] *= first
    elif law == BIAS:
        for m in range(count):
            s[m] += first
    elif law == DEAD_ZONE:
        for m in range(count):
            s[m] = 0.0 if abs(s[m]) < first else s[m]
    elif law == LAG:
        follow(first, memory, place, h, s)
    else:
        for m in range(count):
            s[m] = passed(law, at, v, lane, memory, place, s[m], t[m], h[m])
    if gated:
        looking, path = (1.0 if layout[SCHEME] == FINE else 0.0), np.zeros((2, 6))
        for m in range(count):
            acts = share_of(
                actuators[n, GATE], actuators[n, GATE_END], conditions, knots, v, lane, path, t[m], looking * h[m]
            )  # fmt: skip
            s[m] = blended(acts, s[m], before[depth + m])


@compiled
def follow(constant: float, memory: FloatArray, place: int, h: FloatArray, s: FloatArray) -> None:
    """A lag of a time constant [s]; each command becomes its mean over its substep."""
    level, last, kept, mean = memory[place], np.nan, 0.0, 0.0
    for m in range(len(s)):
        if h[m] != last:
            last = h[m]
            ratio = larger(last, 1e-12) / larger(constant, 1e-9)
            kept, mean = math.exp(-ratio), -math.expm1(-ratio) / ratio
        u = s[m]
        behind = level - u
        level = behind * kept + u
        s[m] = u + behind * mean
    memory[place] = level


@compiled
def wait(
    delay: float,
    drift: float,
    memory: FloatArray,
    at: int,
    depth: int,
    t: FloatArray,
    h: FloatArray,
    heard: FloatArray,
    s: FloatArray,
) -> None:
    """A delay [s], or a drift [ppm], on an even clock; each command becomes the mean of the two that its substep meets.

    memory: a ring of `depth` commands and where the oldest lies; heard: (depth + M,) those and the ones since.
    """
    head, count = int(memory[at + 2 * depth]), len(s)
    for i in range(depth):
        heard[i] = memory[at + (head + i) % depth]
    for m in range(count):
        back = min(late_by(delay, drift, t[m], h[m]) / h[m], depth - 1.0)
        whole = int(back)
        newer, older = heard[depth + m - whole], heard[depth + m - whole - 1]
        s[m] = newer + (back - whole) * (older - newer)
    head = (head + count) % depth
    for i in range(depth):
        memory[at + (head + i) % depth] = heard[count + i]
    memory[at + 2 * depth] = head


@entry(f"void({I1}, {I2}, {I2}, {F1}, {F2}, {F2}, {I1}, {F3}, {F2}, {F3}, int64, int64)")
def travel(
    layout: IntArray,
    actuators: IntArray,
    conditions: IntArray,
    knots: FloatArray,
    values: FloatArray,
    clock: FloatArray,
    window: IntArray,
    given: FloatArray,
    memories: FloatArray,
    out: FloatArray,
    first: int,
    last: int,
) -> None:
    """Fill out (U, K, A), the last L n of K, with what reaches the simulator in the windows, whatever its state.

    values: (U, V); clock: (W, L + 1) s and given: (W, L, A), the commands, of each row's `window` (U,); memories:
    (U, .) at the windows' start, which move on.
    """
    n, length, actions = layout[SUBSTEPS], given.shape[1], given.shape[2]
    count, ways = length * n, len(actuators)
    path, pieces, u = np.zeros((2, 6)), np.empty((3, memories.shape[1] + 2)), np.empty(2)
    v, s, room = np.empty((values.shape[1], 1)), np.empty(count), np.empty(memories.shape[1] + count)
    t, h = np.empty(count), np.empty(count)
    before, lane = (
        out.shape[1] - count,
        int(np.int64(0)),
    )  # a literal 0 would have all it is given to compiled once more
    for row in range(first, last):
        w, memory = window[row], memories[row]
        v[:, 0] = values[row]
        for k in range(length):
            step = (clock[w, k + 1] - clock[w, k]) / n
            for j in range(n):
                t[k * n + j], h[k * n + j] = clock[w, k] + j * step, step
        for x in range(actions):
            for k in range(length):
                for j in range(n):
                    s[k * n + j] = given[w, k, x]
            begin = 0
            while begin < ways and actuators[begin, ON] != x:
                begin += 1
            end, pieced = begin, False
            while end < ways and actuators[end, ON] == x:
                late = actuators[end, LAW] == DELAY
                pieced = pieced or (late and (actuators[end, FOLLOWED] or layout[UNEVEN]))
                end += 1
            if pieced:  # what follows meets several commands within a substep
                way = actuators[begin:end]
                for m in range(count):
                    u[x] = s[m]
                    act(
                        layout, way, conditions, knots, v, lane, path, memory, layout[UNEVEN], t[m], h[m], pieces, u
                    )  # fmt: skip
                    s[m] = u[x]
            else:
                for line in range(begin, end):
                    move(layout, actuators, line, conditions, knots, v, memory, t, h, room, s)
            for m in range(count):
                out[row, before + m, x] = s[m]
