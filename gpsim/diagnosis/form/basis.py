"""Piecewise linear functions of one input or of two, with a coefficient at every knot."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from gpsim.channels import FloatArray
from gpsim.effects import Values, corners

GRID = 2001  # places at which a law is looked at for jumps
JUMP = 0.02  # of all that a law rises and falls: one step of that grid of a law without a jump is far less
HALVINGS = 40  # of a step of the grid: down to rounding
NEAR = 0.01  # of the range: two knots that are nearer do not help


@dataclass(frozen=True)
class Basis:
    """Products of hats. axes: the knots along each input, ascending; at one that stands twice the function may jump.

    Beyond the outer knots it is constant. Coefficients are in the order of the knots, the last axis running fastest.
    """

    axes: tuple[tuple[float, ...], ...]

    @property
    def size(self) -> int:
        """How many coefficients."""
        return int(np.prod([len(axis) for axis in self.axes]))

    @cached_property
    def names(self) -> tuple[str, ...]:
        """What the coefficients are called among a term's values."""
        return tuple(f"c{i}" for i in range(self.size))

    def value(self, inputs: Sequence[FloatArray], values: Values) -> FloatArray:
        """The function at inputs (B,) or (B, K) each; values: its coefficients by name, (B,) or (B, 1) each."""
        rows = np.arange(len(inputs[0])).reshape(-1, *(1,) * (inputs[0].ndim - 1))
        table = np.stack([values[name] for name in self.names]).reshape(self.size, -1)
        if table.shape[1] == 1:
            rows = np.zeros_like(rows)
        total = np.zeros(inputs[0].shape)
        for index, share in corners(inputs, self.axes):
            total += share * table[index, rows]
        return total

    def design(self, inputs: Sequence[FloatArray]) -> FloatArray:
        """(N, F): what each coefficient counts at inputs (N,) each."""
        out = np.zeros((len(inputs[0]), self.size))
        rows = np.arange(len(out))
        for index, share in corners(inputs, self.axes):
            np.add.at(out, (rows, index), share)
        return out

    def bends(self, axis: int) -> FloatArray:
        """(., F): how much it bends along an input at every inner knot; their squares add up to its mean curvature."""
        knots = np.asarray(self.axes[axis])
        x = (knots - knots[0]) / (knots[-1] - knots[0])
        rows = []
        for j in range(1, len(x) - 1):
            before, after = x[j] - x[j - 1], x[j + 1] - x[j]
            if before > 0 and after > 0:
                row = np.zeros(len(x))
                row[j - 1 : j + 2] = 1.0 / before, -1.0 / before - 1.0 / after, 1.0 / after
                rows.append(row / np.sqrt(0.5 * (before + after)))
        return self._along(axis, np.array(rows).reshape(-1, len(x)))

    def slopes(self, axis: int) -> FloatArray:
        """(., F): how steep it is along an input between every two knots; their squares add up to the mean one."""
        knots = np.asarray(self.axes[axis])
        x = (knots - knots[0]) / (knots[-1] - knots[0])
        steps = np.diff(x)
        moving = np.flatnonzero(steps > 0)
        return self._along(axis, (np.diff(np.eye(len(x)), axis=0)[moving].T / np.sqrt(steps[moving])).T)

    def _along(self, axis: int, rows: FloatArray) -> FloatArray:
        """The same of every line of knots along that axis."""
        out: FloatArray = np.ones((1, 1))
        for i, knots in enumerate(self.axes):
            out = np.asarray(np.kron(out, rows if i == axis else np.eye(len(knots))), dtype=np.float64)
        return out


def knots_of(visited: FloatArray, count: int) -> tuple[float, ...]:
    """At most so many knots over what was visited; fewer than two where it hardly moves."""
    if not len(visited):
        return ()
    places = _spread(visited, count)
    apart = np.diff(places, prepend=-np.inf) > 1e-6 * max(
        float(np.ptp(places)), 1e-300
    )  # rounding is no place
    return tuple(float(x) for x in places[apart])


def with_jumps(knots: tuple[float, ...], jumps: Sequence[float]) -> tuple[float, ...]:
    """The knots, and two at every jump inside; one that stands very near makes room."""
    out = list(knots)
    near = NEAR * (knots[-1] - knots[0])
    for jump in jumps:
        if knots[0] + near < jump < knots[-1] - near:
            out = [k for k in out if abs(k - jump) > near or k in (knots[0], knots[-1])] + [jump, jump]
    return tuple(sorted(out))


def jumps_of(law: Callable[[FloatArray], FloatArray], low: float, high: float) -> list[float]:
    """Where a law of one input jumps between low and high: found on an even grid, then halved down to a point."""
    x = np.linspace(low, high, GRID)
    steps = np.abs(np.diff(law(x)))
    places = np.flatnonzero(steps > JUMP * max(float(steps.sum()), 1e-300))
    out = []
    for left, right in zip(x[places], x[places + 1], strict=True):
        for _ in range(HALVINGS):
            middle = 0.5 * (left + right)
            ends = law(np.array([left, middle, right]))
            left, right = (
                (left, middle) if abs(ends[1] - ends[0]) > abs(ends[2] - ends[1]) else (middle, right)
            )
        out.append(float(right))
    return out


def _spread(visited: FloatArray, count: int) -> FloatArray:
    """Places halfway between quantiles and even ones: close where there are many samples, not too far in the tails."""
    shares = np.linspace(0, 1, count)
    low, high = visited.min(), visited.max()
    return np.unique(0.5 * (np.quantile(visited, shares) + low + shares * (high - low)))


def speed_knots(visited: FloatArray, count: int) -> tuple[float, ...]:
    """Knots over a speed, and at 0, which friction knows."""
    knots = knots_of(visited, count)
    if len(knots) < 2 or not knots[0] < 0.0 < knots[-1]:
        return knots
    nearest = int(np.argmin(np.abs(knots)))
    others = [k for i, k in enumerate(knots) if i != nearest or i in (0, len(knots) - 1)]
    return tuple(sorted({*others, 0.0}))


def two_sided_knots(visited: FloatArray, count: int, least_side: float) -> tuple[float, ...]:
    """Knots of a function that may jump at speed 0: half of them on either side, none where it hardly ever moves so."""
    out: list[float] = []
    for sign in (-1.0, 1.0):
        side = np.abs(visited[sign * visited > 0])
        if len(side) > max(least_side * len(visited), 2):
            places = _spread(np.append(side, 0.0), count // 2 + 1)
            out += [float(sign * x) for x in places[1:]] + [0.0]
    return tuple(sorted(out))
