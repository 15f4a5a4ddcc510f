"""What a simulator declares (channels, parameters, coordinates) and how it steps: rates, then integration."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import ClassVar, Literal

import numpy as np

from gpsim.channels import BoolArray, Channels, FloatArray, difference
from gpsim.errors import UsageError

Integrator = Literal["euler", "semi_implicit", "rk4"]
INTEGRATORS: tuple[Integrator, ...] = ("euler", "semi_implicit", "rk4")
Parameters = Mapping[str, float | FloatArray]
"""Parameter values: one number for the whole batch, or (B,) one value a row."""
RateFunction = Callable[[FloatArray], FloatArray]


SMALLEST = float(np.finfo(float).tiny)
"""The low bound of what must be more than 0: how small a mass may be depends on the unit, not on physics."""


@dataclass(frozen=True)
class Parameter:
    """One physical parameter: unit, default, and the bounds it makes sense in, closed.

    additive: the size that a difference from what is believed may have, where a ratio says nothing (of a place, which
    may be 0); 0 where it is a ratio.
    """

    unit: str
    default: float
    low: float
    high: float
    text: str
    additive: float = 0.0

    @property
    def range(self) -> str:
        """The bounds in words."""
        if self.high == math.inf and self.low in (0.0, SMALLEST):
            return "expected a finite number of at least 0" if self.low == 0.0 else "expected more than 0"
        return f"outside [{self.low:g}, {self.high:g}]"


@dataclass(frozen=True)
class ModelPlace:
    """Where a family acts that only some simulators know: unit and typical size of what it changes, a length there [m].

    least: by how much less than believed it may be; centre: of a body, in its frame; steers: does a servo go by it?
    afloat: the rates that say how a body that floats is moved there; its size is then its mass or moment of inertia.
    along: coordinates, and how often each turns what acts there: a drive's speed is their sum or difference.
    """

    unit: str
    size: float
    reach: float = 1.0
    least: float = 0.0
    centre: tuple[float, ...] = ()
    steers: bool = False
    afloat: tuple[str, ...] = ()
    along: tuple[tuple[str, float], ...] = ()


@dataclass(frozen=True)
class Coordinate:
    """A generalised coordinate: its position, velocity and rate channels and the unit of its force.

    damping [force per speed], friction [force]: what a simulator has of them there that may be less in truth.
    """

    name: str
    velocity: str
    rate: str
    force_unit: str
    damping: float = 0.0
    friction: float = 0.0


class Simulator(ABC):
    """A chain command -> rates(state, action, parameters, forces) -> integration; it knows no reward.

    Arrays are batched: state (B, S), action (B, A), forces (B, C) (generalised, on `coordinates`), rates (B, R).
    A subclass declares the class variables and writes `rates`, `derivative` and `measured_rates`.
    """

    name: ClassVar[str]
    state: ClassVar[Channels]
    action: ClassVar[Channels]
    rate: ClassVar[Channels]
    parameters: ClassVar[Mapping[str, Parameter]]
    coordinates: ClassVar[tuple[Coordinate, ...]] = ()
    integrator: Integrator = "euler"  # where neither recording nor settings name one
    start: Mapping[str, float] = MappingProxyType(
        {}
    )  # a guess for every state channel that may go unmeasured
    guesses_speeds: bool = False  # may velocities go unmeasured without one?
    as_measured: tuple[str, ...] = ()  # states of which no effect is asked
    settled: tuple[str, ...] = ()  # states that others settle: a quaternion's real part, its length being 1
    model_places: Mapping[str, Mapping[str, ModelPlace]] = MappingProxyType(
        {}
    )  # of families that few simulators know

    @property
    def levels(self) -> tuple[str, ...]:
        """States of the first order, whose rate is their own: neither coordinates nor velocities."""
        return tuple(n for n in self.state.names if f"{n}_rate" in self.rate.names)

    @property
    def stand_ins(self) -> Mapping[str, tuple[str, ...]]:
        """Of an action without a column of its own, columns of a log that may stand for it."""
        return {}

    @property
    def drives(self) -> Mapping[str, str]:
        """Of an action what it drives, where the simulator says so itself."""
        return {}

    @property
    def kinematic(self) -> bool:
        """Whether the rates follow from action and parameters alone: they stay the same while an action is held."""
        return False

    @abstractmethod
    def rates(
        self, state: FloatArray, action: FloatArray, parameters: Parameters, forces: FloatArray | None = None
    ) -> FloatArray:
        """(B, R): what integration turns into the next state."""

    @abstractmethod
    def derivative(self, state: FloatArray, rates: FloatArray) -> FloatArray:
        """(B, S): d state / dt that the rates imply."""

    @abstractmethod
    def measured_rates(self, state: FloatArray, next_state: FloatArray, dt: FloatArray) -> FloatArray:
        """(B, R): the mean rates over a step of dt (B,) s that the two states show."""

    def mobility(self, state: FloatArray, parameters: Parameters, coordinate: int) -> FloatArray | None:
        """(B, R) by how much a unit force on a coordinate changes the rates; None where only `rates` tells."""
        return None

    @property
    def served(self) -> tuple[str, ...]:
        """Coordinates whose drive has a law of its own: what is commanded is not what it gives (see `given`)."""
        return ()

    def given(self, state: FloatArray, action: FloatArray, parameters: Parameters) -> dict[str, FloatArray]:
        """Of those that are served (B,) each: what their drives give [the coordinate's force unit]."""
        return {}

    def driven(self) -> dict[str, str]:
        """Action -> the coordinate that it drives: what a unit of it does to the rates is what a force there does.

        Tried at one state; an action that drives several coordinates, or none, is left out.
        """
        state, parameters = np.full((1, len(self.state)), 0.1), self.defaults()
        count = len(self.coordinates)
        if not count:
            return {}
        none = np.zeros((1, len(self.action)))
        free = self.rates(state, none, parameters, np.zeros((1, count)))[0]
        pushed = [self.rates(state, none, parameters, np.eye(count)[[i]])[0] - free for i in range(count)]
        found = {}
        for column, action in enumerate(self.action.names):
            acts = self.rates(state, np.eye(len(self.action))[[column]], parameters, np.zeros((1, count)))[0]
            of = [c.name for c, p in zip(self.coordinates, pushed, strict=True) if _parallel(acts - free, p)]
            if len(of) == 1:
                found[action] = of[0]
        return found

    def coupled(self) -> dict[str, tuple[str, float]]:
        """Action -> the coordinate that its drive may turn through a spring, and what force a unit of it is."""
        return {action: (on, 1.0) for action, on in self.driven().items()}

    def with_state(self, state: Channels) -> Simulator | None:
        """The same with channels of which others wrap, from a simulator that makes it itself; else None."""
        return None

    def without(self, fixed: Mapping[str, float], held: Collection[str]) -> Simulator | None:
        """The same without the states `fixed`, from a simulator that makes it itself; else None (see `reduced`)."""
        return None

    def state_error(self, measured: FloatArray, said: FloatArray) -> FloatArray:
        """(..., S): measured states minus simulated ones; in the tangent space where they lie on a curved one."""
        return difference(measured, said, self.state)

    def touching(self, state: FloatArray) -> BoolArray | None:
        """(B,) whether something touches in each state (B, S); None of a simulator that knows no contacts."""
        return None

    def speed(self, on: str, state: FloatArray) -> FloatArray:
        """(B,) along or about an axis of a body that floats, as `model_places` names it, in states (B, S)."""
        raise UsageError(f"simulator {self.name}: no body floats at {on}")

    @property
    def velocities(self) -> frozenset[str]:
        """State channels that are velocities of others, from which they follow."""
        return frozenset(c.velocity for c in self.coordinates)

    @property
    def unlikely(self) -> frozenset[str]:
        """Places of what floats where nothing is usually missing: a drawing weighs its parts, and masses pull down."""
        return frozenset()

    def followed(
        self, name: str, columns: Mapping[str, FloatArray], slope: Callable[[FloatArray], FloatArray]
    ) -> FloatArray | None:
        """(K,) a velocity that is no coordinate's, from recorded `columns`, by a slope of paths (K,); else None."""
        return None

    def stands(self, state: FloatArray) -> bool:
        """Whether something touches in a good part of these states (N, S)."""
        return False

    @property
    def heights(self) -> tuple[int, ...]:
        """Columns of a state that lift what may stand on something."""
        return ()

    @property
    def floating(self) -> frozenset[str]:
        """Coordinates that say where a body is that nothing holds: no joint is there that could rub."""
        return frozenset()

    def untouched(self, state: FloatArray) -> frozenset[str]:
        """Parameters of contacts that none of these states (B, S) makes; none of a simulator that knows none."""
        return frozenset()

    def normal_force(
        self,
        state: FloatArray,
        rates: FloatArray,
        parameters: Parameters,
    ) -> dict[str, FloatArray]:
        """Coordinate -> (B,) N: what presses it on its guide, where the simulator knows; affine in the rates."""
        return {}

    def defaults(self, given: Mapping[str, float] | None = None) -> dict[str, float]:
        """All parameter values, `given` ones checked against the declaration."""
        given = dict(given or {})
        unknown = sorted(set(given) - set(self.parameters))
        if unknown:
            known = ", ".join(self.parameters)
            raise UsageError(
                f"simulator {self.name}: no parameter '{unknown[0]}'; it has: {known or 'none'} (remove it from "
                "`parameters:` in recording.yaml, or in the simulator/NAME.yaml of a --config-dir)"
            )
        for name, value in given.items():
            bounds = self.parameters[name]
            if not (bounds.low <= value <= bounds.high and math.isfinite(value)):
                raise UsageError(f"simulator {self.name}: {name}={value:g} {bounds.unit}: {bounds.range}")
        return {name: float(given.get(name, p.default)) for name, p in self.parameters.items()}

    def integrate(
        self, state: FloatArray, rates_of: RateFunction, dt: FloatArray, integrator: Integrator
    ) -> FloatArray:
        """One step of dt (B,) s; `rates_of(state)` gives the (corrected) rates with the action held.

        euler is explicit; semi_implicit steps the velocities first and the positions with the new ones;
        rk4 is the classical Runge-Kutta scheme.
        """
        h = dt[:, None]
        if integrator == "euler":
            return state + h * self.derivative(state, rates_of(state))
        if integrator == "semi_implicit":
            rates = rates_of(state)
            ahead = state + h * self.derivative(state, rates)
            new = ahead.copy()
            for coordinate in self.coordinates:
                column = self.state.index(coordinate.name)
                new[:, column] = state[:, column] + dt * ahead[:, self.state.index(coordinate.velocity)]
            return new
        if integrator == "rk4":
            k1 = self.derivative(state, rates_of(state))
            second = state + h / 2 * k1
            k2 = self.derivative(second, rates_of(second))
            third = state + h / 2 * k2
            k3 = self.derivative(third, rates_of(third))
            fourth = state + h * k3
            k4 = self.derivative(fourth, rates_of(fourth))
            return state + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
        raise UsageError(f"unknown integrator '{integrator}'; choose one of {', '.join(INTEGRATORS)}")

    def step(
        self,
        state: FloatArray,
        action: FloatArray,
        parameters: Parameters,
        dt: FloatArray,
        integrator: Integrator,
    ) -> FloatArray:
        """(B, S): the state after dt (B,) s with the action held."""
        return self.integrate(state, lambda s: self.rates(s, action, parameters), dt, integrator)


def _parallel(one: FloatArray, other: FloatArray) -> bool:
    """Whether one vector is the other times a number above 0."""
    size = float(np.linalg.norm(one) * np.linalg.norm(other))
    return size > 0.0 and float(one @ other) > (1.0 - 1e-9) * size


class MechanicalSimulator(Simulator):
    """A simulator whose state is (position, velocity) per coordinate and whose rates are the accelerations."""

    def derivative(self, state: FloatArray, rates: FloatArray) -> FloatArray:
        """Velocities and accelerations in state order."""
        out = np.empty_like(state)
        out[:, 0::2] = state[:, 1::2]
        out[:, 1::2] = rates
        return out

    def measured_rates(self, state: FloatArray, next_state: FloatArray, dt: FloatArray) -> FloatArray:
        """Velocity differences over dt."""
        return difference(next_state, state, self.state)[:, 1::2] / dt[:, None]
