"""Free curves (piecewise linear functions of one input or two), and gates: where and when a term acts.

Shares of a substep for lanes of rows (see `gpsim.effects.term.Gate`).
"""

from __future__ import annotations

import math

import numpy as np

from gpsim.channels import FloatArray, IntArray
from gpsim.kernels import codes
from gpsim.kernels.compiling import compiled, larger, place, smaller, wrapped
from gpsim.kernels.lanes import AHEAD, LANES, H, T, U, X, Y
from gpsim.kernels.systems import WHOLE


@compiled
def interval(x: float, knots: FloatArray, first: int, end: int) -> tuple[int, float]:
    """The knot to the left, counted from the first, and the share of the way to the next one."""
    left = 0
    while left < end - first - 2 and knots[first + left + 1] <= x:
        left += 1
    near, far = knots[first + left], knots[first + left + 1]
    share = (x - near) / (far - near if far > near else 1.0)
    return left, min(max(share, 0.0), 1.0)


@compiled
def channel(column: int, states: int) -> int:
    """Where a channel of state (0 to 3) or action (4, 5) lies; states: those of the begin or of a stage."""
    return place(states + column * LANES if column < 4 else U + (column - 4) * LANES)


@compiled
def curve(
    b: FloatArray,
    lanes: int,
    x: int,
    y: int,
    at: int,
    curves: IntArray,
    n: int,
    knots: FloatArray,
    v: FloatArray,
    to: int,
) -> None:
    """Fill `to` with the function n of the inputs at x and y; its coefficients are the values from `at` on."""
    x, y, to = place(x), place(y), place(to)
    first, end = curves[n, codes.FIRST_KNOTS], curves[n, codes.FIRST_END]
    if curves[n, codes.SECOND] < 0 and not curves[n, codes.FIRST_WRAPS]:
        along(b, lanes, x, at, first, end, knots, v, to)
        return
    for i in range(lanes):
        if curves[n, codes.SECOND] < 0:
            b[to + i] = curve_of(b[x + i], at, curves, n, knots, v, i)
            continue
        a, c = b[x + i], b[y + i]
        left, share = interval(wrapped(a) if curves[n, codes.FIRST_WRAPS] else a, knots, first, end)
        begin, stop = curves[n, codes.SECOND_KNOTS], curves[n, codes.SECOND_END]
        other, part = interval(wrapped(c) if curves[n, codes.SECOND_WRAPS] else c, knots, begin, stop)
        low = at + left * (stop - begin) + other
        high = low + stop - begin
        b[to + i] = (1.0 - share) * ((1.0 - part) * v[low, i] + part * v[low + 1, i]) + share * (
            (1.0 - part) * v[high, i] + part * v[high + 1, i]
        )


@compiled
def curve_of(x: float, at: int, curves: IntArray, n: int, knots: FloatArray, v: FloatArray, i: int) -> float:
    """The function n of one input in lane i."""
    first, end = curves[n, codes.FIRST_KNOTS], curves[n, codes.FIRST_END]
    left, share = interval(wrapped(x) if curves[n, codes.FIRST_WRAPS] else x, knots, first, end)
    near: float = v[at + left, i]
    far: float = v[at + left + 1, i]
    return (1.0 - share) * near + share * far


@compiled
def along(
    b: FloatArray,
    lanes: int,
    x: int,
    at: int,
    first: int,
    end: int,
    knots: FloatArray,
    v: FloatArray,
    to: int,
) -> None:
    """Fill `to` with a function of one input: piece by piece for all lanes, each keeps the last that it has reached."""
    x, to = place(x), place(to)
    for left in range(end - first - 1):
        near, far = knots[first + left], knots[first + left + 1]
        per = 1.0 / (far - near if far > near else 1.0)
        for i in range(lanes):
            share = min(max((b[x + i] - near) * per, 0.0), 1.0)
            here = (1.0 - share) * v[at + left, i] + share * v[at + left + 1, i]
            b[to + i] = here if left == 0 or b[x + i] >= near else b[to + i]


@compiled
def curve_at(
    b: FloatArray, lanes: int, at: int, curves: IntArray, n: int, knots: FloatArray, v: FloatArray, to: int
) -> None:
    """The same of the channels that the function names, in the stage's state."""
    second = curves[n, codes.SECOND]
    curve(
        b, lanes, channel(curves[n, codes.FIRST], Y), channel(max(second, 0), Y), at, curves, n, knots, v, to
    )


@compiled
def hat(x: float, knots: FloatArray, first: int, end: int, place: int) -> float:
    """1 at a knot of its own, falling to 0 at its neighbours; beyond the outer knots it is constant."""
    if x <= knots[first]:
        return 1.0 if place == 0 else 0.0
    if x >= knots[end - 1]:
        return 1.0 if place == end - first - 1 else 0.0
    left, share = interval(x, knots, first, end)
    if place == left:
        return 1.0 - share
    return share if place == left + 1 else 0.0


TURN = 2.0 * math.pi


@compiled
def between(begin: float, end: float, low: float, high: float) -> float:
    """The share of the way from begin to end that lies in [low, high]."""
    first, last = smaller(begin, end), larger(begin, end)
    way = last - first
    inside = smaller(last, high) - larger(first, low)
    share = smaller(larger(inside / way, 0.0), 1.0)
    return share if way > 0.0 else (1.0 if (begin >= low) & (begin <= high) else 0.0)


@compiled
def after(moment: float, t: float, step: float) -> float:
    """The share of the time from t to t + step that lies after a moment."""
    late = larger(t, t + step) - moment
    if abs(step) > 0.0:
        return smaller(larger(late / abs(step), 0.0), 1.0)
    return 1.0 if late >= 0.0 else 0.0


@compiled
def holds(
    conditions: IntArray,
    c: int,
    knots: FloatArray,
    v: FloatArray,
    i: int,
    begin: float,
    end: float,
    t: float,
    step: float,
) -> float:
    """The share of the time from t to t + step in which a condition holds; its channel goes from begin to end."""
    kind, low, high = conditions[c, codes.KIND], conditions[c, codes.LOW], conditions[c, codes.HIGH]
    if kind == codes.REGION:
        edge, other = v[low, i], v[high, i]
        if conditions[c, codes.WRAPS]:
            turns = 2.0 * math.pi * np.rint((begin - 0.5 * (edge + other)) / (2.0 * math.pi))
            begin, end = begin - turns, end - turns
        return between(begin, end, edge, other)
    if kind == codes.SINCE:
        return after(v[low, i], t, step)
    if kind == codes.UNTIL:
        return 1.0 - after(v[low, i], t, step)
    if kind == codes.EPISODE:
        return 1.0 if v[high, i] >= v[low, i] else 0.0
    x = wrapped(begin) if conditions[c, codes.WRAPS] else begin
    return hat(x, knots, conditions[c, codes.KNOTS], conditions[c, codes.KNOTS_END], low)


@compiled
def share_of(
    first: int,
    last: int,
    conditions: IntArray,
    knots: FloatArray,
    v: FloatArray,
    i: int,
    path: FloatArray,
    t: float,
    step: float,
) -> float:
    """The share in which all of the conditions first to last hold; path: (2, 6) the channels at both ends."""
    out = 1.0
    for c in range(first, last):
        column = conditions[c, codes.CHANNEL]
        out *= holds(conditions, c, knots, v, i, path[0, column], path[1, column], t, step)
    return out


@compiled
def multiply(
    b: FloatArray,
    lanes: int,
    conditions: IntArray,
    c: int,
    knots: FloatArray,
    v: FloatArray,
    looking: float,
    to: FloatArray,
) -> None:
    """Multiply `to` (lanes,) with the share of the substep in which a condition holds.

    looking: 1 where all of the substep counts, 0 where its begin does.
    """
    begin, end = channel(conditions[c, codes.CHANNEL], X), channel(conditions[c, codes.CHANNEL], AHEAD)
    kind, low, high = conditions[c, codes.KIND], conditions[c, codes.LOW], conditions[c, codes.HIGH]
    if kind == codes.REGION and conditions[c, codes.WRAPS]:
        for i in range(lanes):
            middle = 0.5 * (v[low, i] + v[high, i])
            turns = TURN * (((b[begin + i] - middle) / TURN + WHOLE) - WHOLE)
            to[i] *= between(b[begin + i] - turns, b[end + i] - turns, v[low, i], v[high, i])
    elif kind == codes.REGION:
        for i in range(lanes):
            to[i] *= between(b[begin + i], b[end + i], v[low, i], v[high, i])
    else:
        for i in range(lanes):
            step = looking * b[H + i]
            to[i] *= holds(conditions, c, knots, v, i, b[begin + i], b[end + i], b[T + i], step)


@compiled
def find_shares(
    b: FloatArray,
    lanes: int,
    layout: IntArray,
    terms: IntArray,
    conditions: IntArray,
    knots: FloatArray,
    v: FloatArray,
    shares: FloatArray,
) -> None:
    """Fill shares with how much of the substep each term behind a gate acts.

    The base simulator's own step takes what acts at its start.
    """
    looking = 1.0 if layout[codes.SCHEME] == codes.FINE else 0.0
    for n in range(layout[codes.TERMS]):
        if terms[n, codes.GATE] == terms[n, codes.GATE_END]:
            continue
        for i in range(lanes):
            shares[n, i] = 1.0
        for c in range(terms[n, codes.GATE], terms[n, codes.GATE_END]):
            multiply(b, lanes, conditions, c, knots, v, looking, shares[n])
