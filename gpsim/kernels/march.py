"""Rows of a batch through all their substeps: what Python calls."""

from __future__ import annotations

import numpy as np

from gpsim.channels import FloatArray, IntArray
from gpsim.kernels.codes import ACTIONS, CHANGING, PER_SUBSTEP, SUBSTEPS
from gpsim.kernels.compiling import compiled, entry
from gpsim.kernels.scalars import tamed
from gpsim.kernels.substep import advance, corrected
from gpsim.kernels.systems import State


@compiled
def commanded(layout: IntArray, commands: FloatArray, row: int, place: int) -> tuple[float, float]:
    """What reaches the simulator then."""
    second = commands[row, place, 1] if layout[ACTIONS] > 1 else 0.0
    return commands[row, place, 0], second


@compiled
def loaded(kept: IntArray, rest: FloatArray, states: FloatArray, row: int) -> State:
    """A row's full state: what is left out stands where it rests."""
    full = rest.copy()
    for i in range(len(kept)):
        full[kept[i]] = states[row, i]
    return full[0], full[1], full[2], full[3]


@compiled
def written(kept: IntArray, x: State, out: FloatArray, row: int, place: int) -> None:
    """Put a state where it belongs."""
    for i in range(len(kept)):
        out[row, place, i] = x[kept[i]]


@compiled
def retreat(
    layout: IntArray,
    terms: IntArray,
    conditions: IntArray,
    curves: IntArray,
    knots: FloatArray,
    believed: FloatArray,
    kept: IntArray,
    v: FloatArray,
    shares: FloatArray,
    p: FloatArray,
    start: State,
    clock: FloatArray,
    earlier: FloatArray,
    commands: FloatArray,
    before: int,
    row: int,
    which: int,
    depth: int,
    stood: bool,
    out: FloatArray,
) -> None:
    """Fill out (row, depth - 2 to 0) with the states before a row's window: backwards from where it starts.

    clock: (L + 1,), earlier: (M + 1,) s, the window's and what was before it, of no entries where both are even.
    """
    n, x = layout[SUBSTEPS], start
    for back in range(1, depth):
        k, j = -((back + n - 1) // n), (-back) % n
        h = (clock[1] - clock[0]) / n
        end = clock[0] - (back - 1) * h
        if len(earlier):
            h = (earlier[len(earlier) + k] - earlier[len(earlier) + k - 1]) / n
            end = earlier[len(earlier) + k] - (n - 1 - j) * h
        u = commanded(layout, commands, which, before + (k * n + j if layout[PER_SUBSTEP] else k))
        if not stood:
            x = advance(
                layout, terms, conditions, curves, knots, believed, v, shares, p, x, u, end, -h, (0.0, 0.0, 0.0)
            )
            x = tamed(x[0]), tamed(x[1]), tamed(x[2]), tamed(x[3])
        written(kept, x, out, row, depth - 1 - back)


I1, I2, F1, F2, F3 = "int64[::1]", "int64[:, ::1]", "float64[::1]", "float64[:, ::1]", "float64[:, :, ::1]"
TABLES = f"{I1}, {I2}, {I2}, {I2}, {F1}, {F1}, {I1}, {F1}"


@entry(f"void({TABLES}, {F2}, {F2}, {F2}, {F2}, {I1}, {I1}, {F3}, {I1}, int64, {F3}, {F3}, int64, int64, int64)")
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
    n = layout[SUBSTEPS]
    shares, p = np.ones(len(terms)), np.empty(len(believed))
    for row in range(first, last):
        v, w, c = values[row], window[row], which[row]
        x = loaded(kept, rest, starts, row)
        written(kept, x, out, row, 0)
        if not layout[CHANGING]:
            corrected(layout, terms, v, shares, believed, p)
        if depth > 0:
            written(kept, x, passed, row, depth - 1)
            retreat(
                layout, terms, conditions, curves, knots, believed, kept, v, shares, p, x, clock[w], earlier[w],
                commands, before, row, c, depth, stood[w] != 0, passed,
            )  # fmt: skip
        for k in range(clock.shape[1] - 1):
            begin = clock[w, k]
            h = (clock[w, k + 1] - begin) / n
            for j in range(n):
                u = commanded(layout, commands, c, before + (k * n + j if layout[PER_SUBSTEP] else k))
                x = advance(
                    layout, terms, conditions, curves, knots, believed, v, shares, p, x, u, begin + j * h, h,
                    (0.0, 0.0, 0.0),
                )  # fmt: skip
                if depth > 0:
                    written(kept, x, passed, row, depth + k * n + j)
            x = tamed(x[0]), tamed(x[1]), tamed(x[2]), tamed(x[3])
            written(kept, x, out, row, k + 1)
