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
from gpsim.kernels.scalars import wrapped
from gpsim.kernels.systems import State


@compiled
def channel(x: State, u: tuple[float, float], column: int) -> float:
    """A channel of state (0 to 3) or action (4, 5)."""
    if column < 4:
        return x[column]
    return u[column - 4]


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
def curve(a: float, b: float, about: IntArray, knots: FloatArray, values: FloatArray, at: int) -> float:
    """The function at its inputs, whose coefficients are values[at], ..., the second input's running fastest."""
    left, share = interval(wrapped(a) if about[FIRST_WRAPS] else a, knots, about[FIRST_KNOTS], about[FIRST_END])
    if about[SECOND] < 0:
        return (1.0 - share) * values[at + left] + share * values[at + left + 1]
    size = about[SECOND_END] - about[SECOND_KNOTS]
    other, part = interval(wrapped(b) if about[SECOND_WRAPS] else b, knots, about[SECOND_KNOTS], about[SECOND_END])
    low, high = at + left * size + other, at + (left + 1) * size + other
    return (1.0 - share) * ((1.0 - part) * values[low] + part * values[low + 1]) + share * (
        (1.0 - part) * values[high] + part * values[high + 1]
    )


@compiled
def curve_at(
    x: State, u: tuple[float, float], about: IntArray, knots: FloatArray, values: FloatArray, at: int
) -> float:
    """The function of the channels that it names."""
    b = channel(x, u, about[SECOND]) if about[SECOND] >= 0 else 0.0
    return curve(channel(x, u, about[FIRST]), b, about, knots, values, at)


@compiled
def hat(x: float, knots: FloatArray, first: int, end: int, place: int) -> float:
    """1 at a knot of its own, falling to 0 at its neighbours, as far out as the outer knots are constant."""
    if x <= knots[first]:
        return 1.0 if place == 0 else 0.0
    if x >= knots[end - 1]:
        return 1.0 if place == end - first - 1 else 0.0
    left, share = interval(x, knots, first, end)
    if place == left:
        return 1.0 - share
    return share if place == left + 1 else 0.0
