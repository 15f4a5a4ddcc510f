"""Rows of a batch through all their substeps, some at once: what Python calls."""

from __future__ import annotations

import numpy as np

from gpsim.channels import FloatArray, IntArray
from gpsim.kernels.codes import ACTIONS, PER_SUBSTEP, SUBSTEPS, WIDTH
from gpsim.kernels.compiling import compiled, entry
from gpsim.kernels.lanes import LANES, SIZE, H, T, U, X
from gpsim.kernels.scalars import tamed
from gpsim.kernels.substep import advance, believe, correct


@compiled
def write(
    b: FloatArray, lanes: int, kept: IntArray, out: FloatArray, first: int, count: int, place: int
) -> None:
    """Put the states where they belong."""
    for c in range(len(kept)):
        at = X + kept[c] * LANES
        for i in range(count):
            out[first + i, place, c] = b[at + i]


@compiled
def tame(b: FloatArray, lanes: int) -> None:
    """States that may have diverged, within bounds."""
    for i in range(4 * lanes):
        b[X + i] = tamed(b[X + i])


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
    place = before + (k * layout[SUBSTEPS] + j if layout[PER_SUBSTEP] else k)
    for c in range(layout[ACTIONS]):
        for i in range(lanes):
            b[U + c * LANES + i] = commands[which[i], place, c]


@compiled
def start(
    b: FloatArray, lanes: int, kept: IntArray, rest: FloatArray, starts: FloatArray, begin: int, last: int
) -> None:
    """Fill X with where the rows from `begin` on start; what is left out stands where it rests."""
    for i in range(lanes):
        for x in range(4):
            b[X + x * LANES + i] = rest[x]
        for x in range(len(kept)):
            b[X + kept[x] * LANES + i] = starts[min(begin + i, last - 1), x]


I1, I2, F1, F2, F3 = "int64[::1]", "int64[:, ::1]", "float64[::1]", "float64[:, ::1]", "float64[:, :, ::1]"
TABLES = f"{I1}, {I2}, {I2}, {I2}, {F1}, {F1}, {I1}, {F1}"


@entry(
    f"void({TABLES}, {F2}, {F2}, {F2}, {F2}, {I1}, {I1}, {F3}, {I1}, int64, {F3}, {F3}, int64, int64, int64)"
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
    values: FloatArray,
    starts: FloatArray,
    clock: FloatArray,
    earlier: FloatArray,
    stood: IntArray,
    window: IntArray,
    commands: FloatArray,
    which: IntArray,
    before: int,
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
    """
    lanes = layout[WIDTH]
    n, columns, states = layout[SUBSTEPS], values.shape[1], len(kept)
    b, shares, v = np.zeros(SIZE), np.ones((len(terms), lanes)), np.empty((columns, lanes))
    w, c = np.empty(lanes, dtype=np.int64), np.empty(lanes, dtype=np.int64)
    for begin in range(first, last, lanes):
        count = min(lanes, last - begin)
        for i in range(lanes):
            row = min(begin + i, last - 1)
            w[i], c[i] = window[row], which[row]
            for x in range(columns):
                v[x, i] = values[row, x]
        believe(b, lanes, believed)
        correct(b, lanes, layout, terms, v, shares)
        start(b, lanes, kept, rest, starts, begin, last)
        write(b, lanes, kept, out, begin, count, 0)
        # Backwards from where the windows begin, then back to there and on.
        for m in range(min(1 - depth, 0), (clock.shape[1] - 1) * n):
            if m == 0:
                start(b, lanes, kept, rest, starts, begin, last)
                if depth > 0:
                    write(b, lanes, kept, passed, begin, count, depth - 1)
            back = m if m >= 0 else -(m + depth)
            k, j = back // n, back % n
            command(b, lanes, layout, commands, c, before, k, j)
            for i in range(lanes):
                h = (clock[w[i], max(k, 0) + 1] - clock[w[i], max(k, 0)]) / n
                t = clock[w[i], max(k, 0)] + j * h if m >= 0 else clock[w[i], 0] + (back + 1) * h
                if m < 0 and earlier.shape[1]:
                    at = earlier.shape[1] + k
                    h = (earlier[w[i], at] - earlier[w[i], at - 1]) / n
                    t = earlier[w[i], at] - (n - 1 - j) * h
                b[T + i], b[H + i] = t, h if m >= 0 else -h
            advance(b, lanes, layout, terms, conditions, curves, knots, believed, v, shares)
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
