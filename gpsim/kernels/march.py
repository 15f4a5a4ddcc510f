"""Rows of a batch through all their substeps, some at once: what Python calls."""

from __future__ import annotations

import numpy as np

from gpsim.channels import FloatArray, IntArray
from gpsim.kernels import codes
from gpsim.kernels.acting import pass_on
from gpsim.kernels.compiling import F1, F2, F3, I1, I2, clip_diverged, compiled, entry, place
from gpsim.kernels.lanes import AHEAD, BEGAN, BENT, LANES, SIZE, TOGETHER, H, T, U, X
from gpsim.kernels.substep import advance, believe, correct, is_steady, peer


@compiled
def write(
    b: FloatArray, lanes: int, kept: IntArray, out: FloatArray, first: int, count: int, at: int
) -> None:
    """Put the states where they belong."""
    first, at = place(first), place(at)
    for c in range(len(kept)):
        of = place(X + kept[c] * LANES)
        for i in range(count):
            out[first + i, at, c] = b[of + i]


@compiled
def tame(b: FloatArray, lanes: int) -> None:
    """States that may have diverged, within bounds."""
    for c in range(4):
        for i in range(lanes):
            b[X + c * LANES + i] = clip_diverged(b[X + c * LANES + i])


@compiled
def command(
    b: FloatArray,
    lanes: int,
    layout: IntArray,
    commands: FloatArray,
    which: IntArray,
    before: int,
    k: int,
    j: int,
) -> None:
    """Fill U with what reaches the simulator at substep j of transition k; negative ones are before the window."""
    at = place(before + (k * layout[codes.SUBSTEPS] + j if layout[codes.PER_SUBSTEP] else k))
    for c in range(layout[codes.ACTIONS]):
        for i in range(lanes):
            b[U + c * LANES + i] = commands[place(which[i]), at, c]


@compiled
def acted(
    b: FloatArray, lanes: int, layout: IntArray, actuators: IntArray, conditions: IntArray, knots: FloatArray,
    believed: FloatArray, v: FloatArray, memory: FloatArray, path: FloatArray, steps: FloatArray, u: FloatArray,
    heard: FloatArray, pieces: FloatArray, was: FloatArray, of: IntArray,
) -> None:  # fmt: skip
    """Change U from what was commanded to what reaches the simulator; memory: (lanes, .) of every row."""
    peer(b, lanes, layout, believed)
    for i in range(lanes):
        for x in range(4):
            path[0, x], path[1, x] = b[X + x * LANES + i], b[AHEAD + x * LANES + i]
        for x in range(u.shape[1]):
            path[0, 4 + x] = path[1, 4 + x] = u[0, x] = b[U + x * LANES + i]
        steps[0, 0], steps[1, 0] = b[T + i], b[H + i]
        pass_on(
            layout, actuators, conditions, knots, v, i, memory[i], path, steps, u, 1, 1, u, heard, pieces, was, of
        )  # fmt: skip
        for x in range(u.shape[1]):
            b[U + x * LANES + i] = u[0, x]


@compiled
def start(
    b: FloatArray,
    lanes: int,
    kept: IntArray,
    rest: FloatArray,
    starts: FloatArray,
    bends: FloatArray,
    begin: int,
    last: int,
) -> None:
    """Fill X with where the rows from `begin` on start; what is left out stands where it rests; bristles are bent."""
    for i in range(lanes):
        for x in range(bends.shape[1]):
            b[BENT + x * LANES + i] = bends[min(begin + i, last - 1), x]
        for x in range(4):
            b[X + x * LANES + i] = rest[x]
        for x in range(len(kept)):
            b[X + kept[x] * LANES + i] = starts[min(begin + i, last - 1), x]


@compiled
def look_back(
    b: FloatArray, lanes: int, clock: FloatArray, earlier: FloatArray, w: IntArray, n: int, k: int, j: int
) -> None:
    """Fill T and H for the substep j of transition k before the window, gone through backwards; k is negative."""
    for i in range(lanes):
        h = (clock[w[i], 1] - clock[w[i], 0]) / n
        t = clock[w[i], 0] + (k * n + j + 1) * h
        if earlier.shape[1]:
            at = earlier.shape[1] + k
            h = (earlier[w[i], at] - earlier[w[i], at - 1]) / n
            t = earlier[w[i], at] - (n - 1 - j) * h
        b[T + i], b[H + i] = t, -h


TABLES = f"{I1}, {I2}, {I2}, {I2}, {F1}, {F1}, {I1}, {F1}"


@entry(
    f"void({TABLES}, {I2}, {F2}, {F2}, {F2}, {F2}, {I1}, {I1}, {F3}, {I1}, int64, {F3}, {F2},"
    f" {F2}, {F3}, {F3}, int64, int64, int64)"
)
def march(
    layout: IntArray,
    terms: IntArray,
    conditions: IntArray,
    curves: IntArray,
    knots: FloatArray,
    believed: FloatArray,
    kept: IntArray,
    rest: FloatArray,
    actuators: IntArray,
    values: FloatArray,
    starts: FloatArray,
    clock: FloatArray,
    earlier: FloatArray,
    stood: IntArray,
    window: IntArray,
    commands: FloatArray,
    which: IntArray,
    before: int,
    given: FloatArray,
    memories: FloatArray,
    bends: FloatArray,
    out: FloatArray,
    passed: FloatArray,
    depth: int,
    first: int,
    last: int,
) -> None:
    """Fill out (B, L + 1, S) with the states of the rows first to last, at every transition's end.

    values: (B, V); starts: (B, S); clock: (W, L + 1) s, of each row's `window` (B,); commands: (U, K, A), of each row's
    `which` (B,), `before` of them before the window, one a substep or one a transition.
    passed: (B, depth + L n, S) the states at every substep's end, the first `depth` of them up to the window's start;
    nobody wants them where depth is 0. earlier: (W, M + 1) s, the clock up to the windows' start, (W, 0) where it is
    even; stood: (W,) whether a window's system stood still before it.
    Where actuators look at the state, what is commanded in the windows is given, (W, L, A), and goes through them;
    their memories (U, .) are those at the windows' start.
    bends: (B, 6) how far bristles are bent and drives twisted as the windows begin, (B, 0) where there are none.
    """
    n, columns, states = layout[codes.SUBSTEPS], values.shape[1], len(kept)
    b, shares, v = np.zeros(SIZE), np.ones((len(terms), LANES)), np.empty((columns, LANES))
    memory, path, most = np.empty((LANES, memories.shape[1])), np.zeros((2, 6)), 3 * memories.shape[1] + 6
    steps, u = np.empty((2, 1)), np.empty((1, layout[codes.ACTIONS]))
    heard, pieces, was, of = (
        np.empty((2, most)),
        np.empty((3, most)),
        np.empty(most),
        np.empty(most, np.int64),
    )
    w, c = np.empty(LANES, dtype=np.int64), np.empty(LANES, dtype=np.int64)
    steady = is_steady(layout, terms)
    for begin in range(first, last, LANES):
        count = min(LANES, last - begin)
        lanes = min(-(-count // TOGETHER) * TOGETHER, layout[codes.WIDTH])
        for i in range(lanes):
            row = min(begin + i, last - 1)
            w[i], c[i] = window[row], which[row]
            for x in range(columns):
                v[x, i] = values[row, x]
            for x in range(memories.shape[1]):
                memory[i, x] = memories[which[row], x]
        believe(b, lanes, believed)
        correct(b, lanes, layout, terms, v, shares)
        start(b, lanes, kept, rest, starts, bends, begin, last)
        write(b, lanes, kept, out, begin, count, 0)
        # Backwards from where the windows begin, then back to there and on.
        for m in range(min(1 - depth, 0), (clock.shape[1] - 1) * n):
            if m == 0:
                start(b, lanes, kept, rest, starts, bends, begin, last)
                if depth > 0:
                    write(b, lanes, kept, passed, begin, count, depth - 1)
            back = m if m >= 0 else -(m + depth)
            k, j = back // n, back % n
            looks = m >= 0 and layout[codes.LOOKS] != 0
            if looks:
                for x in range(layout[codes.ACTIONS]):
                    for i in range(lanes):
                        b[U + x * LANES + i] = given[w[i], k, x]
            elif m <= 0 or j == 0 or layout[codes.PER_SUBSTEP]:
                command(b, lanes, layout, commands, c, before, k, j)
            if m < 0:
                look_back(b, lanes, clock, earlier, w, n, k, j)
            else:
                if j == 0:
                    for i in range(lanes):
                        b[BEGAN + i] = clock[w[i], k]
                        b[H + i] = (clock[w[i], k + 1] - clock[w[i], k]) / n
                for i in range(lanes):
                    b[T + i] = b[BEGAN + i] + j * b[H + i]
            if looks:
                acted(
                    b, lanes, layout, actuators, conditions, knots, believed, v, memory, path, steps, u,
                    heard, pieces, was, of,
                )  # fmt: skip
            advance(b, lanes, layout, terms, conditions, curves, knots, believed, v, shares, steady)
            if m < 0 or (m + 1) % n == 0:
                tame(b, lanes)
            if m < 0:
                for i in range(lanes):
                    if stood[w[i]]:
                        for x in range(states):
                            b[X + kept[x] * LANES + i] = starts[min(begin + i, last - 1), x]
            if depth > 0:
                write(b, lanes, kept, passed, begin, count, depth - 1 + back if m < 0 else depth + m)
            if m >= 0 and (m + 1) % n == 0:
                write(b, lanes, kept, out, begin, count, k + 1)
