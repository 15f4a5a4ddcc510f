"""Piecewise linear functions of one input or two: how they are evaluated, and how compiled code is told of them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from gpsim.channels import FloatArray, IntArray

Axis = tuple[float, ...]
"""Knots along an input, ascending. At one that stands twice the function may jump."""


@dataclass(frozen=True)
class Curve:
    """A law that is a piecewise linear function of one input or two, as compiled code needs it.

    axes: the knots along each input; names: of the coefficients among a term's values, the last axis running fastest.
    of: what it gives; inputs: channels of state and action, whose angles may wrap; of a force or a grip its
    coordinate's position (0) or speed (1); of a turn or a slip speed and turn rate. on: the rate or the action. beside:
    family and values of laws of the twist that act together with it. heights: the coefficients themselves, where they
    are known beforehand, with no names, and one value, called `times`, multiplies them all.
    """

    of: Literal["force", "grip", "turn", "slip", "rate", "drive"]
    axes: tuple[Axis, ...]
    names: tuple[str, ...]
    inputs: tuple[int, ...]
    wraps: tuple[bool, ...]
    on: int = 0
    beside: tuple[tuple[str, Mapping[str, float]], ...] = ()
    heights: tuple[float, ...] = ()
    times: str = ""


def corners(inputs: Sequence[FloatArray], axes: Sequence[Axis]) -> list[tuple[IntArray, FloatArray]]:
    """Around every place the coefficients that count there, by their numbers, and the share of each.

    Beyond the outer knots the function is constant. The last axis runs fastest.
    """
    out: list[tuple[IntArray, FloatArray]] = [
        (np.zeros(inputs[0].shape, dtype=np.int64), np.ones(inputs[0].shape))
    ]
    for x, knots in zip(inputs, axes, strict=True):
        left, share = _between(x, np.asarray(knots))
        out = [
            (index * len(knots) + left + step, size * part)
            for index, size in out
            for step, part in ((0, 1.0 - share), (1, share))
        ]
    return out


def tabled(inputs: Sequence[FloatArray], axes: Sequence[Axis], heights: Sequence[float]) -> FloatArray:
    """The function of these heights at its knots, at inputs of any shape."""
    table = np.asarray(heights, dtype=np.float64)
    total = np.zeros(inputs[0].shape)
    for index, share in corners(inputs, axes):
        total += share * table[index]
    return total


def _between(x: FloatArray, knots: FloatArray) -> tuple[IntArray, FloatArray]:
    """The knot to the left of every x, and the share of the way to the next; at a jump that to its right."""
    left = np.clip(np.searchsorted(knots, x, side="right") - 1, 0, len(knots) - 2)
    way = knots[left + 1] - knots[left]
    share = np.clip((x - knots[left]) / np.where(way > 0, way, 1.0), 0.0, 1.0)
    return left, np.asarray(share)
