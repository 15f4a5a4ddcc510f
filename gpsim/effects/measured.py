"""What measured curves share: a law that no family of the catalogue has, known by its values at knots.

A term of a curve keeps its shape among its values: `x0`, `x1` ... the knots along its input, `z0` ... those along a
second one, `y0` ... what the curve adds to the base simulator there. `scale`, which alone is fitted once the shape is
known, multiplies it; at 0 the curve does nothing. `freedom` is how many effective parameters the shape cost. Beyond the
outer knots, where the recording never was, what the curve adds is held.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from itertools import count, takewhile
from typing import ClassVar

import numpy as np

from gpsim.channels import FloatArray, wrap_angle
from gpsim.effects.effect import Effect, FunctionOf
from gpsim.effects.place import EffectParameter, Place
from gpsim.effects.tabled import Axis, tabled

SCALE, FREEDOM, WRAPS = "scale", "freedom", "wraps"
KNOTS, SECOND, HEIGHTS = "x", "z", "y"
LARGEST = 10.0  # times the shape that was found: a scale beyond is none of it


@dataclass(frozen=True)
class Shape:
    """Knots along one input or two, what the curve adds at each, and whether the first input is an angle."""

    axes: tuple[Axis, ...]
    heights: tuple[float, ...]
    wraps: bool = False

    def at(self, *inputs: FloatArray) -> FloatArray:
        """What the curve adds at inputs of any shape."""
        first = wrap_angle(inputs[0]) if self.wraps else inputs[0]
        return tabled((first, *inputs[1:]), self.axes, self.heights)

    def outside(self, *inputs: FloatArray) -> FloatArray:
        """Where the recording never was, so that what the curve says is held from its edge."""
        first = wrap_angle(inputs[0]) if self.wraps else inputs[0]
        found = np.zeros(np.shape(first), dtype=bool)
        for x, axis in zip((first, *inputs[1:]), self.axes, strict=True):
            found |= (x < axis[0]) | (x > axis[-1])
        return found

    def values(self, freedom: float) -> dict[str, float]:
        """As a term keeps it."""
        out = {SCALE: 1.0, FREEDOM: float(freedom), **({WRAPS: 1.0} if self.wraps else {})}
        for letter, numbers in zip((KNOTS, SECOND), self.axes, strict=False):
            out |= {f"{letter}{i}": float(x) for i, x in enumerate(numbers)}
        return out | {f"{HEIGHTS}{i}": float(y) for i, y in enumerate(self.heights)}


NO_SHAPE = Shape(((0.0, 1.0),), (0.0, 0.0))


def shape_of(values: Mapping[str, float]) -> Shape:
    """The shape among a term's values."""
    first, second = _listed(values, KNOTS), _listed(values, SECOND)
    return Shape((first, second) if second else (first,), _listed(values, HEIGHTS), WRAPS in values)


def _listed(values: Mapping[str, float], letter: str) -> tuple[float, ...]:
    names = takewhile(lambda name: name in values, (f"{letter}{i}" for i in count()))
    return tuple(float(values[name]) for name in names)


@dataclass(frozen=True)
class Measured(Effect):
    """A curve at a site. variant: of what it is a function, where there is a choice."""

    shape: Shape = NO_SHAPE
    variant: str = ""
    function_of: ClassVar[FunctionOf] = "nothing"
    gated: ClassVar[bool] = False

    def parameters(self, place: Place, variant: str = "") -> tuple[EffectParameter, ...]:
        """How many times as large as the shape says."""
        return (EffectParameter(SCALE, "1", 0.0, LARGEST, (1.0,), 1.0),)

    def of_term(self, values: Mapping[str, float], variant: str) -> Measured:
        """The law with the term's own shape."""
        return _shaped(type(self), variant, tuple(values.items()))


@lru_cache(maxsize=256)
def _shaped(kind: type[Measured], variant: str, values: tuple[tuple[str, float], ...]) -> Measured:
    return kind(shape_of(dict(values)), variant)
