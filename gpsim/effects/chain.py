"""The chain with effects in it: command -> rates -> integration -> measurement, one substep of a batch at a time."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np

from gpsim.channels import Channels, FloatArray
from gpsim.effects.effect import (
    ActuatorEffect,
    ForceEffect,
    ParameterEffect,
    SensorEffect,
    Values,
    VehicleEffect,
    columns_of,
)
from gpsim.effects.term import Term
from gpsim.simulators import Integrator, Simulator
from gpsim.simulators.plant import Memory

Scheme = Literal["fine"] | Integrator
"""fine: midpoint rule on a fine grid, friction sticks; else the base simulator's own step, friction is -m sgn(v)."""
LONGEST_DELAY = 12.0  # in steps of the recording: what delays remember


@dataclass(frozen=True)
class Chain:
    """A simulator with terms. Parameter values are given at each call, (B,) a name, one mapping a term."""

    simulator: Simulator
    parameters: Mapping[str, float]
    terms: tuple[Term, ...]
    scheme: Scheme
    dt: float

    @cached_property
    def channels(self) -> Channels:
        """State and action: what a gate may look at."""
        return self.simulator.state + self.simulator.action

    def rest(self, count: int, step: float) -> Memory:
        """The actuators' memory at rest, for a grid of `step` [s]."""
        memory: Memory = {}
        for i, effect, _ in self._actuators:
            part = effect.begin(count, LONGEST_DELAY * self.dt, step)
            memory |= {f"{i}/{key}": values for key, values in part.items()}
        return memory

    def command(
        self,
        action: FloatArray,
        state: FloatArray,
        values: Sequence[Values],
        memory: Memory,
        step: FloatArray,
        t: FloatArray,
    ) -> FloatArray:
        """(B, A): what reaches the simulator during a substep that starts at t; memory moves on."""
        if not self._actuators:
            return action
        out = np.array(action)
        for i, effect, column in self._actuators:
            gate = self.terms[i].gate
            acted = effect.actuate(out[:, column], values[i], _part(memory, i), step, t)
            out[:, column] = (
                np.where(gate.open(state, action, t, self.channels), acted, out[:, column]) if gate else acted
            )
        return out

    def advance(
        self,
        state: FloatArray,
        action: FloatArray,
        values: Sequence[Values],
        step: FloatArray,
        t: FloatArray,
        extra: FloatArray | None = None,
    ) -> FloatArray:
        """(B, S) after a substep; `action` is what `command` returned, `extra` (B, R) is added to the rates."""
        parameters = self._corrected(state, action, values, t)
        if self.scheme != "fine":
            return self.simulator.integrate(
                state,
                lambda s: _sum(self._rates(s, action, parameters, values, t, None), extra),
                step,
                self.scheme,
            )
        h = step[:, None]
        first = _sum(self._rates(state, action, parameters, values, t, (state, step)), extra)
        middle = state + h / 2 * self.simulator.derivative(state, first)
        second = _sum(self._rates(middle, action, parameters, values, t, (state, step)), extra)
        return state + h * self.simulator.derivative(middle, second)

    def slope(
        self, state: FloatArray, action: FloatArray, values: Sequence[Values], t: FloatArray
    ) -> FloatArray:
        """(B, S): d state / dt."""
        parameters = self._corrected(state, action, values, t)
        return self.simulator.derivative(state, self._rates(state, action, parameters, values, t, None))

    def watchers(self, state: FloatArray, slope: FloatArray, step: FloatArray) -> Memory:
        """The sensors' memory at the start of a batch."""
        memory: Memory = {}
        for i, effect, _ in self._sensors:
            part = effect.begin(state, slope, LONGEST_DELAY * self.dt, step)
            memory |= {f"{i}/{key}": values for key, values in part.items()}
        return memory

    def watch(self, state: FloatArray, memory: Memory) -> None:
        """Let sensors that remember see the newest state."""
        for i, effect, columns in self._sensors:
            effect.watch(state, columns[0], _part(memory, i))

    def measure(
        self, state: FloatArray, values: Sequence[Values], memory: Memory, step: FloatArray
    ) -> FloatArray:
        """(B, S): what the sensors say."""
        out = state
        for i, effect, columns in self._sensors:
            out = effect.measure(out, columns, values[i], _part(memory, i), step)
        return out

    @cached_property
    def watches(self) -> bool:
        """Whether a sensor remembers, and `watch` must be called at every substep."""
        return any(type(effect).watch is not SensorEffect.watch for _, effect, _ in self._sensors)

    @cached_property
    def _actuators(self) -> list[tuple[int, ActuatorEffect, int]]:
        found = [
            (i, term.effect, self.simulator.action.index(term.on))
            for i, term in enumerate(self.terms)
            if isinstance(term.effect, ActuatorEffect)
        ]
        return sorted(found, key=lambda item: item[1].order)

    @cached_property
    def _forces(self) -> list[tuple[int, ForceEffect, int]]:
        names = [c.name for c in self.simulator.coordinates]
        return [
            (i, term.effect, names.index(term.on))
            for i, term in enumerate(self.terms)
            if isinstance(term.effect, ForceEffect)
        ]

    @cached_property
    def _parameter_terms(self) -> list[tuple[int, ParameterEffect]]:
        return [(i, t.effect) for i, t in enumerate(self.terms) if isinstance(t.effect, ParameterEffect)]

    @cached_property
    def _vehicle_terms(self) -> list[tuple[int, VehicleEffect]]:
        return [(i, t.effect) for i, t in enumerate(self.terms) if isinstance(t.effect, VehicleEffect)]

    @cached_property
    def _sensors(self) -> list[tuple[int, SensorEffect, tuple[int, ...]]]:
        return [
            (i, t.effect, columns_of(t.on, self.simulator))
            for i, t in enumerate(self.terms)
            if isinstance(t.effect, SensorEffect)
        ]

    @cached_property
    def _twist_columns(self) -> tuple[int, int, int]:
        rate = self.simulator.rate
        return rate.index("v"), rate.index("v_lateral"), rate.index("w")

    @cached_property
    def _coordinate_columns(self) -> list[tuple[int, int, int]]:
        """Position, velocity and rate column of every coordinate."""
        state, rate = self.simulator.state, self.simulator.rate
        return [
            (state.index(c.name), state.index(c.velocity), rate.index(c.rate))
            for c in self.simulator.coordinates
        ]

    def _corrected(
        self, state: FloatArray, action: FloatArray, values: Sequence[Values], t: FloatArray
    ) -> dict[str, float | FloatArray]:
        out: dict[str, float | FloatArray] = dict(self.parameters)
        for i, effect in self._parameter_terms:
            term = self.terms[i]
            believed = np.asarray(out[term.on] + 0.0 * t)
            value = effect.corrected(believed, values[i])
            if term.gate:
                value = np.where(term.gate.open(state, action, t, self.channels), value, believed)
            out[term.on] = value
        return out

    def _rates(
        self,
        state: FloatArray,
        action: FloatArray,
        parameters: Mapping[str, float | FloatArray],
        values: Sequence[Values],
        t: FloatArray,
        substep: tuple[FloatArray, FloatArray] | None,
    ) -> FloatArray:
        """Rates with every force; `substep` (state at its start, step) makes dry friction stick instead of chatter."""
        if not self._forces:
            rates = self.simulator.rates(state, action, parameters)
            return self._twisted(rates, state, action, values, t) if self._vehicle_terms else rates
        smooth, dry = self._applied(state, action, values, t)
        rates = self.simulator.rates(state, action, parameters, smooth)
        for coordinate in dry:
            unit = np.zeros_like(smooth)
            unit[:, coordinate] = 1.0
            mobility = self.simulator.rates(state, action, parameters, smooth + unit) - rates
            friction = self._dry_friction(
                coordinate, state, rates, mobility, action, parameters, values, t, substep
            )
            rates = rates + mobility * friction[:, None]
            smooth[:, coordinate] += friction
        return rates

    def _applied(
        self, state: FloatArray, action: FloatArray, values: Sequence[Values], t: FloatArray
    ) -> tuple[FloatArray, list[int]]:
        """The smooth generalised forces (B, C), and the coordinates on which some dry friction acts."""
        smooth = np.zeros((len(state), len(self._coordinate_columns)))
        dry: list[int] = []
        for i, effect, coordinate in self._forces:
            position, velocity, _ = self._coordinate_columns[coordinate]
            force = effect.force(state[:, position], state[:, velocity], values[i])
            if force is None:
                dry += [coordinate] if coordinate not in dry else []
                continue
            gate = self.terms[i].gate
            smooth[:, coordinate] += force * gate.open(state, action, t, self.channels) if gate else force
        return smooth, dry

    def _dry_friction(
        self,
        coordinate: int,
        state: FloatArray,
        rates: FloatArray,
        mobility: FloatArray,
        action: FloatArray,
        parameters: Mapping[str, float | FloatArray],
        values: Sequence[Values],
        t: FloatArray,
        substep: tuple[FloatArray, FloatArray] | None,
    ) -> FloatArray:
        """(B,) the friction force, a mean over the substep. Rates are affine in it: rates + mobility * force.

        A body that would reverse within the substep stops on the way, after a share of it; for the rest it is held,
        as far as the grip allows, or starts the other way.
        """
        position, velocity, rate = self._coordinate_columns[coordinate]
        name = self.simulator.coordinates[coordinate].name
        speed = state[:, velocity] if substep is None else substep[0][:, velocity]
        free = -rates[:, rate] / mobility[:, rate]  # the force that would leave no acceleration
        sign = np.where(speed != 0, -np.sign(speed), np.sign(free) if substep is not None else 0.0)
        load = self.simulator.normal_force(state, rates, parameters).get(name)
        change = None
        if load is not None:
            change = self.simulator.normal_force(state, rates + mobility, parameters)[name] - load

        def grip(at: FloatArray | None) -> FloatArray:
            total = np.zeros(len(state))
            for i, effect, on in self._forces:
                if on != coordinate:
                    continue
                most = effect.grip(state[:, position], state[:, velocity], values[i], at)
                if most is not None:
                    gate = self.terms[i].gate
                    total += most * gate.open(state, action, t, self.channels) if gate else most
            return total

        most = grip(load)
        if load is not None and change is not None:
            # The load depends on the friction and the friction on the load, both affinely: m = m0 + k m.
            slope = grip(load + change * sign * most) - most
            share = np.divide(slope, most, out=np.zeros_like(most), where=most > 0)
            most = most / np.maximum(1.0 - share, 0.1)
        sliding = sign * most
        if substep is None:
            return np.asarray(sliding)
        after = speed + substep[1] * (rates[:, rate] + mobility[:, rate] * sliding)
        crosses = speed * after <= 0
        gap = np.where(speed == after, 1.0, speed - after)
        share = np.where(crosses, speed / gap, 1.0)
        return np.asarray(share * sliding + (1.0 - share) * np.clip(free, -most, most))

    def _twisted(
        self,
        rates: FloatArray,
        state: FloatArray,
        action: FloatArray,
        values: Sequence[Values],
        t: FloatArray,
    ) -> FloatArray:
        columns = list(self._twist_columns)
        for i, effect in self._vehicle_terms:
            v, lateral, w = rates[:, columns].T
            new = np.array(rates)
            new[:, columns] = np.stack(effect.twist(v, lateral, w, values[i]), axis=1)
            gate = self.terms[i].gate
            rates = np.where(gate.open(state, action, t, self.channels)[:, None], new, rates) if gate else new
        return rates


def _sum(rates: FloatArray, extra: FloatArray | None) -> FloatArray:
    return rates if extra is None else rates + extra


def _part(memory: Memory, term: int) -> Memory:
    """The views of one term's memory."""
    prefix = f"{term}/"
    return {key[len(prefix) :]: values for key, values in memory.items() if key.startswith(prefix)}
