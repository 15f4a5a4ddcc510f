"""Measured curves: laws that no family of the catalogue has, known by their values at knots.

Penalised splines (Eilers and Marx 1996, Statistical Science 11) of the first degree, fitted by `gpsim.diagnosis.form`.
A term of a curve keeps its shape among its values: `x0`, `x1` ... the knots along its input, `z0` ... those along a
second one, `y0` ... what the curve adds to the base simulator there. `scale`, which alone is fitted once the shape is
known, multiplies it; at 0 the curve does nothing. `freedom` is how many effective parameters the shape cost. Beyond the
outer knots, where the recording never was, what the curve adds is held.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from itertools import count, takewhile
from typing import ClassVar, Literal

import numpy as np

from gpsim.channels import FloatArray, IntArray, wrap_angle
from gpsim.effects.effect import (
    ActuatorEffect,
    Effect,
    ForceEffect,
    FunctionOf,
    SensorEffect,
    Values,
    VehicleEffect,
    changed,
)  # fmt: skip
from gpsim.effects.place import EffectParameter, Place
from gpsim.simulators import Memory

SCALE, FREEDOM, WRAPS = "scale", "freedom", "wraps"
KNOTS, SECOND, HEIGHTS = "x", "z", "y"
LARGEST = 10.0  # times the shape that was found: a scale beyond is none of it
SPEED, POSITION, FRICTION = "speed", "position", "friction"
TURN, SLIP = "w", "v_lateral"
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
        left, share = _at_knots(x, np.asarray(knots))
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


def _at_knots(x: FloatArray, knots: FloatArray) -> tuple[IntArray, FloatArray]:
    """The knot to the left of every x, and the share of the way to the next; at a jump that to its right."""
    left = np.clip(np.searchsorted(knots, x, side="right") - 1, 0, len(knots) - 2)
    way = knots[left + 1] - knots[left]
    share = np.clip((x - knots[left]) / np.where(way > 0, way, 1.0), 0.0, 1.0)
    return left, np.asarray(share)


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


@dataclass(frozen=True)
class ForceCurve(Measured, ForceEffect):
    """A measured force of a coordinate's speed or position; or friction of its speed, which also holds it at rest."""

    family: ClassVar[str] = "force_curve"
    noun: ClassVar[str] = "measured force"
    variants: ClassVar[tuple[str, ...]] = (SPEED, POSITION, FRICTION)

    @property
    def dry(self) -> bool:  # type: ignore[override]  # of families it is a class's
        """Whether it holds a body at rest."""
        return self.variant == FRICTION

    @property
    def curve(self) -> Curve:
        """For compiled code."""
        shape, of_speed = self.shape, self.variant != POSITION
        return Curve(
            "grip" if self.dry else "force",
            shape.axes,
            (),
            (int(of_speed),),
            (shape.wraps and not of_speed,),
            heights=shape.heights,
            times=SCALE,
        )

    def force(self, position: FloatArray, speed: FloatArray, values: Values) -> FloatArray | None:
        """The curve; of friction there is no smooth force."""
        if self.dry:
            return None
        return np.asarray(values[SCALE] * self.shape.at(position if self.variant == POSITION else speed))

    def friction_limit(
        self, position: FloatArray, speed: FloatArray, values: Values, load: FloatArray | None
    ) -> FloatArray | None:
        """The curve, which is how much friction there is; of what rests the mean of both directions."""
        if not self.dry:
            return None
        out = self.shape.at(speed)
        if not speed.all():
            tiny = np.where(speed == 0.0, -np.finfo(float).tiny, speed)
            out = 0.5 * (out + self.shape.at(tiny))
        return np.asarray(values[SCALE] * out)


@dataclass(frozen=True)
class ActuatorCurve(Measured, ActuatorEffect):
    """A measured motor curve: the simulator gets u + what the curve adds to the command u."""

    family: ClassVar[str] = "actuator_curve"
    noun: ClassVar[str] = "measured motor curve"
    order: ClassVar[int] = 20

    def actuate(
        self, commands: FloatArray, values: Values, memory: Memory, step: FloatArray, t: FloatArray
    ) -> FloatArray:
        """The command and what the curve adds to it."""
        return np.asarray(commands + values[SCALE] * self.shape.at(commands))


@dataclass(frozen=True)
class SensorCurve(Measured, SensorEffect):
    """A measured characteristic of a sensor: it reads y + what the curve adds to the true value y."""

    family: ClassVar[str] = "sensor_curve"
    noun: ClassVar[str] = "measured sensor curve"
    order: ClassVar[int] = 40

    def measure(
        self, measured: FloatArray, columns: tuple[int, ...], values: Values, memory: Memory, step: FloatArray
    ) -> FloatArray:
        """The value and what the curve adds to it."""
        (column,) = columns
        y = measured[:, column]
        return changed(measured, column, y + values[SCALE] * self.shape.at(y))


@dataclass(frozen=True)
class RateCurve(Measured, VehicleEffect):
    """A measured response of a vehicle: what a map of its speed and turn rate adds to its turn rate, or sideways."""

    family: ClassVar[str] = "rate_curve"
    noun: ClassVar[str] = "measured vehicle response"
    variants: ClassVar[tuple[str, ...]] = (TURN, SLIP)

    @property
    def order(self) -> int:  # type: ignore[override]  # where the laws stand that it is in the place of
        """Turn rates come before what slips."""
        return 10 if self.variant == TURN else 40

    @property
    def curve(self) -> Curve:
        """For compiled code."""
        shape, of = self.shape, "turn" if self.variant == TURN else "slip"
        return Curve(
            of,  # type: ignore[arg-type]  # it is one of the two
            shape.axes,
            (),
            (0, 1),
            (False, False),
            heights=shape.heights,
            times=SCALE,
        )

    def twist(
        self, v: FloatArray, lateral: FloatArray, w: FloatArray, values: Values
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """The twist and what the map adds to it."""
        more = values[SCALE] * self.shape.at(v, w)
        return (v, lateral, w + more) if self.variant == TURN else (v, lateral + more, w)
