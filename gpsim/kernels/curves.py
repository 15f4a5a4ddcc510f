"""Free curves (piecewise linear functions of one input or two) and the hats of their gates."""

from __future__ import annotations

from gpsim.channels import FloatArray, IntArray
from gpsim.kernels.codes import (
    FIRST,
    FIRST_END,
    FIRST_KNOTS,
    FIRST_WRAPS,
    SECOND,
    SECOND_END,
    SECOND_KNOTS,
    SECOND_WRAPS,
)
from gpsim.kernels.compiling import compiled
from gpsim.kernels.lanes import LANES, U, Y
from gpsim.kernels.scalars import place, wrapped


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
    first, end = curves[n, FIRST_KNOTS], curves[n, FIRST_END]
    if curves[n, SECOND] < 0 and not curves[n, FIRST_WRAPS]:
        along(b, lanes, x, at, first, end, knots, v, to)
        return
    for i in range(lanes):
        if curves[n, SECOND] < 0:
            b[to + i] = curve_of(b[x + i], at, curves, n, knots, v, i)
            continue
        a, c = b[x + i], b[y + i]
        left, share = interval(wrapped(a) if curves[n, FIRST_WRAPS] else a, knots, first, end)
        begin, stop = curves[n, SECOND_KNOTS], curves[n, SECOND_END]
        other, part = interval(wrapped(c) if curves[n, SECOND_WRAPS] else c, knots, begin, stop)
        low = at + left * (stop - begin) + other
        high = low + stop - begin
        b[to + i] = (1.0 - share) * ((1.0 - part) * v[low, i] + part * v[low + 1, i]) + share * (
            (1.0 - part) * v[high, i] + part * v[high + 1, i]
        )


@compiled
def curve_of(x: float, at: int, curves: IntArray, n: int, knots: FloatArray, v: FloatArray, i: int) -> float:
    """The function n of one input in lane i."""
    first, end = curves[n, FIRST_KNOTS], curves[n, FIRST_END]
    left, share = interval(wrapped(x) if curves[n, FIRST_WRAPS] else x, knots, first, end)
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
    second = curves[n, SECOND]
    curve(b, lanes, channel(curves[n, FIRST], Y), channel(max(second, 0), Y), at, curves, n, knots, v, to)


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
