"""Effects that nobody named: free functions at the sites where laws act. They live in hypotheses, in no catalogue.

So a curve is simulated as its laws are: in every substep, behind delays, with friction that sticks, under sensors.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar, Literal

import numpy as np

from gpsim.channels import Channels, FloatArray, wrap_angle
from gpsim.diagnosis.form.basis import Basis
from gpsim.effects import (
    ActuatorEffect,
    Curve,
    Effect,
    EffectParameter,
    ForceEffect,
    FunctionOf,
    Gate,
    Place,
    RateEffect,
    SensorEffect,
    Term,
    Values,
    VehicleEffect,
    changed,
)
from gpsim.kernels import Hat
from gpsim.simulators import Memory, Simulator

FREE = "free_curve"


@dataclass(frozen=True)
class CurveTerm(Term):
    """A term whose law is in no catalogue."""

    law: Effect | None = None

    @property
    def effect(self) -> Effect:
        """The free law."""
        assert self.law is not None
        return self.law


@dataclass(frozen=True)
class HatGate(Gate):
    """A gate that opens and closes gradually along a further input: 1 at its knot, 0 at the neighbouring ones."""

    along: str = ""
    knots: tuple[float, ...] = ()
    place: int = 0

    def __bool__(self) -> bool:
        return True

    @property
    def hat(self) -> Hat:
        """For compiled code."""
        return Hat(self.along, self.knots, self.place)

    def share(
        self,
        path: tuple[FloatArray, FloatArray],
        action: FloatArray,
        t: FloatArray,
        step: FloatArray,
        channels: Channels,
        values: Values,
    ) -> FloatArray:
        """What its hat is where a substep begins."""
        column, width = channels.index(self.along), path[0].shape[-1]
        x = path[0][..., column] if column < width else action[..., column - width]
        x = wrap_angle(x) if channels.wraps[column] else x
        hat = np.interp(x, self.knots, np.eye(len(self.knots))[self.place])
        if super().__bool__():
            hat = hat * super().share(path, action, t, step, channels, values)
        return np.asarray(hat)


@dataclass(frozen=True)
class _Free(Effect):
    """What free laws share: their coefficients."""

    basis: Basis
    family: ClassVar[str] = FREE
    function_of: ClassVar[FunctionOf] = "nothing"

    def parameters(self, place: Place, variant: str = "") -> tuple[EffectParameter, ...]:
        """A coefficient at every knot, in the unit of the place."""
        return declared(self.basis, place.unit, place.span)


@dataclass(frozen=True)
class FreeForce(_Free, ForceEffect):
    """A smooth force: a function of a coordinate's speed or of its position (an angle between -pi and pi)."""

    of_speed: bool
    wraps: bool = False

    @property
    def curve(self) -> Curve:
        """For compiled code."""
        wraps = self.wraps and not self.of_speed
        return Curve("force", self.basis.axes, self.basis.names, (int(self.of_speed),), (wraps,))

    def force(self, position: FloatArray, speed: FloatArray, values: Values) -> FloatArray | None:
        """The function."""
        return self.basis.value([_argument(position, speed, self.of_speed, self.wraps)], values)


@dataclass(frozen=True)
class FreeGrip(_Free, ForceEffect):
    """Dry friction beside the named one: a function of speed, which may jump at 0, or of position."""

    of_speed: bool
    wraps: bool = False

    @property
    def curve(self) -> Curve:
        """For compiled code."""
        wraps = self.wraps and not self.of_speed
        return Curve("grip", self.basis.axes, self.basis.names, (int(self.of_speed),), (wraps,))

    def grip(
        self, position: FloatArray, speed: FloatArray, values: Values, load: FloatArray | None
    ) -> FloatArray | None:
        """The function; of what rests the mean of both directions."""
        x = _argument(position, speed, self.of_speed, self.wraps)
        out = self.basis.value([x], values)
        if self.of_speed and not speed.all():
            tiny = np.where(speed == 0.0, -np.finfo(float).tiny, speed)
            out = 0.5 * (out + self.basis.value([tiny], values))
        return out


@dataclass(frozen=True)
class FreeCommand(_Free, ActuatorEffect):
    """What becomes of a command: laws without memory, one after another, and a function of the command beside them."""

    laws: tuple[Term, ...] = ()
    order: ClassVar[int] = 20  # where the first of them stands

    def actuate(
        self, commands: FloatArray, values: Values, memory: Memory, step: FloatArray, t: FloatArray
    ) -> FloatArray:
        """What the laws make of it, and the function."""
        out = commands
        for law in self.laws:
            assert isinstance(law.effect, ActuatorEffect)
            out = law.effect.actuate(out, _held(law, 2), {}, step, t)
        return out + self.basis.value([commands], values)


@dataclass(frozen=True)
class FreeTurn(_Free, VehicleEffect):
    """What becomes of a vehicle's turn rate: laws, and a function of its speed and turn rate beside them."""

    laws: tuple[Term, ...] = ()
    order: ClassVar[int] = 10  # where the first of them stands
    changes: ClassVar[str] = "w"

    @property
    def curve(self) -> Curve:
        """For compiled code."""
        of: Literal["turn", "slip"] = "turn" if self.changes == "w" else "slip"
        beside = tuple((law.family, law.values) for law in self.laws)
        return Curve(of, self.basis.axes, self.basis.names, (0, 1), (False, False), beside=beside)

    def twist(
        self, v: FloatArray, lateral: FloatArray, w: FloatArray, values: Values
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """What the laws make of it, and the function."""
        out = v, lateral, w
        for law in self.laws:
            assert isinstance(law.effect, VehicleEffect)
            out = law.effect.twist(*out, _held(law, 1))
        more = self.basis.value([v, w], values)
        return (out[0], out[1], out[2] + more) if self.changes == "w" else (out[0], out[1] + more, out[2])


@dataclass(frozen=True)
class FreeSlip(FreeTurn):
    """The same of its sideways speed."""

    order: ClassVar[int] = 40
    changes: ClassVar[str] = "v_lateral"


@dataclass(frozen=True)
class FreeReading(_Free, SensorEffect):
    """What a sensor reads: laws without memory, and a function of the true value beside them."""

    laws: tuple[Term, ...] = ()
    wraps: bool = False
    order: ClassVar[int] = 40

    def measure(
        self, measured: FloatArray, columns: tuple[int, ...], values: Values, memory: Memory, step: FloatArray
    ) -> FloatArray:
        """What the laws make of it, and the function."""
        (column,) = columns
        x, out = measured[:, column], measured
        for law in self.laws:
            assert isinstance(law.effect, SensorEffect)
            out = law.effect.measure(out, columns, _held(law, 1), {}, step)
        more = self.basis.value([wrap_angle(x) if self.wraps else x], values)
        return changed(out, column, out[:, column] + more)


@dataclass(frozen=True)
class FreeRate(_Free, RateEffect):
    """A rate, and the state channels and commands that a function of them is added to it."""

    rate: int
    inputs: tuple[int, ...]
    wraps: tuple[bool, ...]

    @property
    def curve(self) -> Curve:
        """For compiled code."""
        return Curve("rate", self.basis.axes, self.basis.names, self.inputs, self.wraps, self.rate)

    def added(
        self,
        simulator: Simulator,
        state: FloatArray,
        action: FloatArray,
        parameters: Mapping[str, float | FloatArray],
        values: Values,
        on: str,
    ) -> FloatArray:
        """The function."""
        out = np.zeros((len(state), len(simulator.rate)))
        out[:, self.rate] = self.basis.value(_columns(state, action, self.inputs, self.wraps), values)
        return out


@dataclass(frozen=True)
class FreeDrive(_Free, RateEffect):
    """A function of a command and of something else, added to the command as it reaches the simulator."""

    action: int
    inputs: tuple[int, ...]
    wraps: tuple[bool, ...]

    @property
    def curve(self) -> Curve:
        """For compiled code."""
        return Curve("drive", self.basis.axes, self.basis.names, self.inputs, self.wraps, self.action)

    def added(
        self,
        simulator: Simulator,
        state: FloatArray,
        action: FloatArray,
        parameters: Mapping[str, float | FloatArray],
        values: Values,
        on: str,
    ) -> FloatArray:
        """What the function changes of the rates."""
        other = np.array(action)
        other[:, self.action] += self.basis.value(_columns(state, action, self.inputs, self.wraps), values)
        return simulator.rates(state, other, parameters) - simulator.rates(state, action, parameters)


def declared(
    basis: Basis, unit: str, scale: float, low: FloatArray | None = None
) -> tuple[EffectParameter, ...]:
    """A free law's coefficients, of about that size; low: (F,) the least that each may be."""
    least = np.full(basis.size, -np.inf) if low is None else low
    return tuple(
        EffectParameter(name, unit, float(lowest), np.inf, (0.0,), scale)
        for name, lowest in zip(basis.names, least, strict=True)
    )


def _argument(position: FloatArray, speed: FloatArray, of_speed: bool, wraps: bool) -> FloatArray:
    if of_speed:
        return speed
    return wrap_angle(position) if wraps else position


def _columns(
    state: FloatArray, action: FloatArray, inputs: tuple[int, ...], wraps: tuple[bool, ...]
) -> list[FloatArray]:
    both = np.concatenate([state, action], axis=1)
    return [wrap_angle(both[:, i]) if w else both[:, i] for i, w in zip(inputs, wraps, strict=True)]


def _held(law: Term, dimensions: int) -> dict[str, FloatArray]:
    """A law's values as a batch of one."""
    return {name: np.full((1,) * dimensions, value) for name, value in law.values.items()}
