"""The chain with effects in it: command -> rates -> integration -> measurement, one substep of a batch at a time."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Literal

import numpy as np

from gpsim.channels import Channels, FloatArray
from gpsim.effects import elastic
from gpsim.effects.actuation import Actuation, Grid, blended
from gpsim.effects.closed_step import BlackBoxStepper, closed
from gpsim.effects.effect import DriveEffect, ElasticDrive, ParameterEffect, RateEffect, Values, VehicleEffect
from gpsim.effects.forces import Forces, Instant, bend_key
from gpsim.effects.sensors import Sensors
from gpsim.effects.term import Term
from gpsim.simulators import Integrator, Memory, RateFunction, Simulator

Scheme = Literal["fine"] | Integrator
"""fine: third order on a fine grid, friction sticks; else the base simulator's own step, friction is -m sgn(v)."""

PRE_ROLL = 80  # control steps before an episode or a window that an actuator may remember


@dataclass(frozen=True)
class Chain:
    """A simulator with terms. Parameter values are given at each call, (B,) a name, one mapping a term."""

    simulator: Simulator
    parameters: Mapping[str, float]
    terms: tuple[Term, ...]
    scheme: Scheme
    dt: float

    @cached_property
    def closed(self) -> BlackBoxStepper | None:
        """The simulator as one that owns its integration; None where `advance` integrates its rates."""
        return closed(self.simulator)

    def rolled(
        self,
        closed_step: BlackBoxStepper,
        state: FloatArray,
        commands: FloatArray,
        values: Sequence[Values],
        step: FloatArray,
        t: FloatArray,
        extra: FloatArray | None = None,
        bends: Memory | None = None,
    ) -> FloatArray:
        """(B, K, S): the states after each of K substeps of `step` (B,) s, commands (B, K, A): `BlackBoxStepper`."""
        return closed_step.rolled(self.terms, self.parameters, values, state, commands, step, t, extra, bends)

    @cached_property
    def refinement(self) -> int:
        """How many times finer than usual the grid must be: entering a region is a jump inside a substep."""
        if self.closed is not None:
            return 1
        return 2 if any(t.gate.region for t in self.terms) else 1

    @cached_property
    def channels(self) -> Channels:
        """State and action: what a gate may look at."""
        return self.simulator.state + self.simulator.action

    @cached_property
    def sensors(self) -> Sensors:
        """What is measured of the states."""
        return Sensors(self.simulator, self.terms)

    @property
    def rubbing(self) -> frozenset[str]:
        """The coordinates on which dry friction acts."""
        return self._forces.rubbing

    @cached_property
    def actuation(self) -> Actuation:
        """What happens to commands."""
        return Actuation(self.terms, self.simulator.action, self.dt)

    def commands(
        self,
        actions: FloatArray,
        states: FloatArray,
        values: Sequence[Values],
        memory: Memory,
        step: FloatArray,
        t: FloatArray,
    ) -> FloatArray:
        """(B, K, A): what reaches the simulator during K substeps; memory moves on.

        actions: (B, K, A); states: (B, K + 1, S) at their ends, at which gates look; step: (B, K) s each; t: (B, K) s,
        when they begin.
        """
        if not self.actuation:
            return actions
        # The base simulator's own step takes what acts at its start.
        fine = self.scheme == "fine"
        grid = Grid(actions, states[:, :-1], states[:, 1:], t, step, self.channels, fine)
        return self.actuation.delivered(grid, values, memory)

    def command(
        self,
        action: FloatArray,
        state: FloatArray,
        values: Sequence[Values],
        memory: Memory,
        step: FloatArray,
        t: FloatArray,
    ) -> FloatArray:
        """(B, A): what reaches the simulator during one substep (B,) that begins in state (B, S); memory moves on."""
        if not self.actuation:
            return action
        states = np.stack([state, self._ahead(state, action, step)], axis=1)
        return self.commands(action[:, None], states, values, memory, step[:, None], t[:, None])[:, 0]

    def advance(
        self,
        state: FloatArray,
        action: FloatArray,
        values: Sequence[Values],
        step: FloatArray,
        t: FloatArray,
        extra: FloatArray | None = None,
        bends: Memory | None = None,
    ) -> FloatArray:
        """(B, S) after a substep; `action` is what `commands` returned for it, `extra` (B, R) is added to the rates.

        bends: how far bristles are bent and drives twisted, which moves on; none are where nobody says it.
        """
        if self.closed is not None:
            return self.rolled(self.closed, state, action[:, None], values, step, t, extra, bends)[:, -1]
        if not self.yields:
            return self._advanced(state, action, values, step, t, extra, {})
        kept = self.unbent(len(state)) if bends is None else bends
        known = {i: kept[bend_key(i)] for i in self.yields}
        after = self._advanced(state, action, values, step, t, extra, known)
        self._forces.bent(state, after, step, values, kept)
        self._turned(state, after, action, values, step, t, kept)
        return after

    @cached_property
    def yields(self) -> tuple[int, ...]:
        """The terms that remember where a body was pushed to: bristles, and elastic drives."""
        return (*(i for i, _ in self.bristles), *(i for i, *_ in self.elastic))

    @cached_property
    def elastic(self) -> list[tuple[int, int, int, int]]:
        """Of elastic drives: the term, the columns of their command, and of the speed and rate of what they drive."""
        if not any(isinstance(t.effect, ElasticDrive) for t in self.terms):
            return []
        simulator, coupled = self.simulator, self.simulator.coupled()
        of = {c.name: c for c in simulator.coordinates}
        return [
            (
                i,
                simulator.action.index(t.on),
                simulator.state.index(of[coupled[t.on][0]].velocity),
                simulator.rate.index(of[coupled[t.on][0]].rate),
            )
            for i, t in enumerate(self.terms)
            if isinstance(t.effect, ElasticDrive)
        ]

    def loose(
        self, at: Instant, values: Sequence[Values], column: int, rate: int
    ) -> tuple[FloatArray, FloatArray]:
        """(B,) each: how a drive's coordinate is accelerated without its command, and what a unit of that adds.

        Dry friction is left out.
        """
        smooth, found = self._forces.smooth(at, values), []
        for size in (0.0, 1.0):
            action = np.array(at.action)
            action[:, column] = size
            found.append(self.simulator.rates(at.state, action, at.parameters, smooth)[:, rate])
        return found[0], found[1] - found[0]

    def instant(
        self, state: FloatArray, action: FloatArray, values: Sequence[Values], step: FloatArray, t: FloatArray
    ) -> Instant:
        """What laws may look at in a state (B, S), with what drives give of a command there."""
        shares = self._shares(state, action, values, step, t)
        given = self._delivered(state, action, values) if self._drives else action
        return Instant(state, given, self._corrected(values, shares), shares, None, (state, step), {})

    def _turned(
        self,
        state: FloatArray,
        after: FloatArray,
        action: FloatArray,
        values: Sequence[Values],
        step: FloatArray,
        t: FloatArray,
        bends: Memory,
    ) -> None:
        """Twist elastic drives on from one state (B, S) to the one a substep (B,) s later."""
        for i, column, speed, rate in self.elastic:
            given = self._delivered(after, action, values) if self._drives else action
            at = replace(self.instant(state, action, values, step, t), state=after, action=given)
            _, reacts = self.loose(at, values, column, rate)
            twist, moved = bends[bend_key(i)], (after - state)[:, speed] / np.where(step == 0.0, 1e-9, step)
            twist[:] = elastic.turned(twist, at.action[:, column], moved, reacts, step, values[i])

    @property
    def bristles(self) -> list[tuple[int, int]]:
        """Index of the term and the coordinate of friction with bristles."""
        return self._forces.bristles

    def unbent(self, count: int) -> Memory:
        """Bristles that are not bent, and elastic drives that are not twisted, of a batch."""
        bristles = {bend_key(i): np.zeros(count) for i, _ in self.bristles}
        elastic = {bend_key(i): np.zeros((count, 2)) for i, *_ in self.elastic}
        return bristles | elastic | (self.closed.rest(count) if self.closed is not None else {})

    def _advanced(
        self,
        state: FloatArray,
        action: FloatArray,
        values: Sequence[Values],
        step: FloatArray,
        t: FloatArray,
        extra: FloatArray | None,
        bends: Mapping[int, FloatArray],
    ) -> FloatArray:
        shares = self._shares(state, action, values, step, t)
        parameters = self._corrected(values, shares)
        begun = (state, step) if self.scheme == "fine" else None

        def found(at: FloatArray) -> FloatArray:
            instant = Instant(at, action, parameters, shares, begun, (state, step), bends)
            return _sum(self._rates(instant, values), extra)

        rates = self._held(found, state)
        if self.scheme != "fine":
            return self.simulator.integrate(state, rates, step, self.scheme)
        h = step[:, None]

        def slope(at: FloatArray) -> FloatArray:
            return self.simulator.derivative(at, rates(at))

        # Heun (1900), third order.
        first = slope(state)
        third = slope(state + 2 * h / 3 * slope(state + h / 3 * first))
        return state + h / 4 * (first + 3 * third)

    def _held(self, rates: RateFunction, state: FloatArray) -> RateFunction:
        """The rates in any state, found once where they are the same in all."""
        if self._forces or self._rate_terms or not self.simulator.kinematic:
            return rates
        held = rates(state)
        return lambda at: held

    @cached_property
    def _forces(self) -> Forces:
        return Forces(self.simulator, self.terms)

    @cached_property
    def _parameter_terms(self) -> list[tuple[int, ParameterEffect]]:
        return [(i, t.effect) for i, t in enumerate(self.terms) if isinstance(t.effect, ParameterEffect)]

    @cached_property
    def _vehicle_terms(self) -> list[tuple[int, VehicleEffect]]:
        found = [(i, t.effect) for i, t in enumerate(self.terms) if isinstance(t.effect, VehicleEffect)]
        return sorted(found, key=lambda item: item[1].order)

    @cached_property
    def _drives(self) -> list[tuple[int, DriveEffect, int, int]]:
        """Index of the term, its effect, the columns of its command and of the speed of what it drives."""
        simulator = self.simulator
        found = [
            (i, t.effect)
            for i, t in enumerate(self.terms)
            if isinstance(t.effect, DriveEffect) and not isinstance(t.effect, ElasticDrive)
        ]
        if not found:
            return []
        driven, speeds = simulator.driven(), {c.name: c.velocity for c in simulator.coordinates}
        return [
            (
                i,
                effect,
                simulator.action.index(self.terms[i].on),
                simulator.state.index(speeds[driven[self.terms[i].on]]),
            )
            for i, effect in found
        ]

    @cached_property
    def _rate_terms(self) -> list[tuple[int, RateEffect]]:
        return [(i, t.effect) for i, t in enumerate(self.terms) if isinstance(t.effect, RateEffect)]

    @cached_property
    def _twist_columns(self) -> tuple[int, int, int]:
        rate = self.simulator.rate
        return rate.index("v"), rate.index("v_lateral"), rate.index("w")

    @cached_property
    def _gated(self) -> list[int]:
        """Terms behind a gate that do not act on commands."""
        return [i for i, term in enumerate(self.terms) if term.gate and not self.actuation.acts(i)]

    def _shares(
        self, state: FloatArray, action: FloatArray, values: Sequence[Values], step: FloatArray, t: FloatArray
    ) -> dict[int, FloatArray]:
        """(B,) of each gated term that is no actuator's: how much of the substep it acts.

        The base simulator's own step takes what acts at its start.
        """
        if not self._gated:
            return {}
        looked = step if self.scheme == "fine" else np.zeros_like(step)
        path = state, self._ahead(state, action, step)
        return {
            i: self.terms[i].gate.share(path, action, t, looked, self.channels, values[i])
            for i in self._gated
        }

    def _ahead(self, state: FloatArray, action: FloatArray, step: FloatArray) -> FloatArray:
        """(B, S): about where a substep ends, for gates that look at the state."""
        if self.scheme != "fine" or self.refinement == 1:
            return state
        rates = np.zeros((len(state), len(self.simulator.rate)))
        if not self.looks_at_positions:
            rates = self.simulator.rates(state, action, self.parameters)
        return np.asarray(state + step[:, None] * self.simulator.derivative(state, rates))

    @cached_property
    def looks_at_positions(self) -> bool:
        """Whether gates look at nothing but positions and commands, which rates do not move at once."""
        names = [c.name for c in self.simulator.coordinates]
        known = {*names, *self.simulator.action.names}
        if not all(known.issuperset(term.gate.region) for term in self.terms):
            return False
        rates = np.array([[0.0], [1.0]]) * np.ones(len(self.simulator.rate))
        slope = self.simulator.derivative(np.zeros((2, len(self.simulator.state))), rates)
        columns = [self.simulator.state.index(name) for name in names]
        return bool((slope[0, columns] == slope[1, columns]).all())  # somebody's own may count them otherwise

    def _corrected(
        self, values: Sequence[Values], shares: Mapping[int, FloatArray]
    ) -> dict[str, float | FloatArray]:
        out: dict[str, float | FloatArray] = dict(self.parameters)
        for i, effect in self._parameter_terms:
            believed = np.asarray(out[self.terms[i].on])
            value = effect.corrected(believed, values[i])
            out[self.terms[i].on] = blended(shares[i], value, believed) if i in shares else value
        return out

    def _rates(self, at: Instant, values: Sequence[Values]) -> FloatArray:
        """Rates with every force."""
        state, parameters, shares = at.state, at.parameters, at.shares
        action = self._delivered(state, at.action, values) if self._drives else at.action
        if self.elastic:
            action = self._transmitted(replace(at, action=action), values)
        if self._forces:
            rates = self._forces.rates(replace(at, action=action), values)
        else:
            rates = self.simulator.rates(state, action, parameters)
        if self._vehicle_terms:
            rates = self._twisted(rates, values, shares)
        for i, effect in self._rate_terms:
            added = effect.added(self.simulator, state, action, parameters, values[i], self.terms[i].on)
            rates = rates + (added * shares[i][:, None] if i in shares else added)
        return rates

    def _delivered(self, state: FloatArray, action: FloatArray, values: Sequence[Values]) -> FloatArray:
        """(B, A): what drives give of the commands that reached them."""
        out = np.array(action)
        for i, effect, column, speed in self._drives:
            out[:, column] = effect.delivered(out[:, column], state[:, speed], values[i])
        return out

    def _transmitted(self, at: Instant, values: Sequence[Values]) -> FloatArray:
        """(B, A): what elastic drives transmit of the commands that they were given, means over the substep."""
        out = np.array(at.action)
        for i, column, _, rate in self.elastic:
            own, reacts = self.loose(replace(at, action=out), values, column, rate)
            out[:, column] = elastic.transmitted(
                at.bends[i], out[:, column], own, reacts, at.begun[1], values[i]
            )
        return out

    def _twisted(
        self, rates: FloatArray, values: Sequence[Values], shares: Mapping[int, FloatArray]
    ) -> FloatArray:
        columns = list(self._twist_columns)
        for i, effect in self._vehicle_terms:
            v, lateral, w = rates[:, columns].T
            new = np.array(rates)
            new[:, columns] = np.stack(effect.twist(v, lateral, w, values[i]), axis=1)
            rates = blended(shares[i][:, None], new, rates) if i in shares else new
        return rates


def _sum(rates: FloatArray, extra: FloatArray | None) -> FloatArray:
    return rates if extra is None else rates + extra
