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
from gpsim.kernels.scalars import wrapped


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
    return states + column * LANES if column < 4 else U + (column - 4) * LANES


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
    first, end = curves[n, FIRST_KNOTS], curves[n, FIRST_END]
    for i in range(lanes):
        a = b[x + i]
        left, share = interval(wrapped(a) if curves[n, FIRST_WRAPS] else a, knots, first, end)
        if curves[n, SECOND] < 0:
            b[to + i] = (1.0 - share) * v[at + left, i] + share * v[at + left + 1, i]
            continue
        c = b[y + i]
        begin, stop = curves[n, SECOND_KNOTS], curves[n, SECOND_END]
        other, part = interval(wrapped(c) if curves[n, SECOND_WRAPS] else c, knots, begin, stop)
        low = at + left * (stop - begin) + other
        high = low + stop - begin
        b[to + i] = (1.0 - share) * ((1.0 - part) * v[low, i] + part * v[low + 1, i]) + share * (
            (1.0 - part) * v[high, i] + part * v[high + 1, i]
        )


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
