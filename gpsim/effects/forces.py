"""Generalised forces of force effects, and dry friction that sticks instead of chattering."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from gpsim.channels import FloatArray
from gpsim.effects import bristles
from gpsim.effects.effect import BristleEffect, ForceEffect, Values
from gpsim.effects.term import Term
from gpsim.simulators import Memory, Simulator


def bend_key(term: int) -> str:
    """Under what a memory holds how far a term's bristles are bent."""
    return f"{term}/bend"


@dataclass(frozen=True)
class Instant:
    """What laws may look at: state (B, S), command (B, A) and parameters.

    shares: (B,) how much of a term behind a gate acts, by its index. substep: (state at its start (B, S), step (B,)),
    with which dry friction sticks; None where the base simulator's own step is taken and friction is -m sgn(v).
    begun: the same, whatever the step; bends: (B,) how far bristles are bent at its start, by their term's index.
    """

    state: FloatArray
    action: FloatArray
    parameters: Mapping[str, float | FloatArray]
    shares: Mapping[int, FloatArray]
    substep: tuple[FloatArray, FloatArray] | None
    begun: tuple[FloatArray, FloatArray]
    bends: Mapping[int, FloatArray]


@dataclass(frozen=True)
class Forces:
    """The force terms among `terms`, on a simulator's coordinates."""

    simulator: Simulator
    terms: tuple[Term, ...]

    def __bool__(self) -> bool:
        return bool(self._effects)

    @cached_property
    def rubbing(self) -> frozenset[str]:
        """The coordinates on which dry friction is."""
        return frozenset(self.terms[i].on for i, effect, _ in self._effects if effect.dry)

    def smooth(self, at: Instant, values: Sequence[Values]) -> FloatArray | None:
        """(B, C) the smooth generalised forces; None where there are none."""
        return self._applied(at, values)[0] if self else None

    def rates(self, at: Instant, values: Sequence[Values]) -> FloatArray:
        """(B, R) rates under all force terms."""
        smooth, dry = self._applied(at, values)
        rates = self.simulator.rates(at.state, at.action, at.parameters, smooth)
        for i, coordinate in self.bristles:
            mobility = self._mobility(at, coordinate, smooth, rates)
            force = self._bristles(i, coordinate, at, rates, mobility, values)
            rates = rates + mobility * force[:, None]
            smooth[:, coordinate] += force
        for coordinate in dry:
            mobility = self._mobility(at, coordinate, smooth, rates)
            friction = self._dry_friction(coordinate, at, rates, mobility, values)
            rates = rates + mobility * friction[:, None]
            smooth[:, coordinate] += friction
        return rates

    @cached_property
    def _effects(self) -> list[tuple[int, ForceEffect, int]]:
        """Index of the term, its effect, its coordinate; of none are places of a body that floats."""
        names = [c.name for c in self.simulator.coordinates]
        return [
            (i, term.effect, names.index(term.on))
            for i, term in enumerate(self.terms)
            if isinstance(term.effect, ForceEffect) and term.on in names
        ]

    @cached_property
    def _columns(self) -> list[tuple[int, int, int]]:
        """Position, velocity and rate column of every coordinate."""
        state, rate = self.simulator.state, self.simulator.rate
        return [
            (state.index(c.name), state.index(c.velocity), rate.index(c.rate))
            for c in self.simulator.coordinates
        ]

    @cached_property
    def bristles(self) -> list[tuple[int, int]]:
        """Index of the term and the coordinate of friction with bristles."""
        return [(i, on) for i, effect, on in self._effects if isinstance(effect, BristleEffect)]

    def bent(
        self, before: FloatArray, after: FloatArray, step: FloatArray, values: Sequence[Values], bends: Memory
    ) -> None:
        """Bend the bristles on from one state (B, S) to the one a substep (B,) s later; not back in time."""
        for i, coordinate in self.bristles:
            _, velocity, _ = self._columns[coordinate]
            speed = 0.5 * (before[:, velocity] + after[:, velocity])
            bend = bends[bend_key(i)]
            end, _ = bristles.bent(bend, speed * step, speed, values[i])
            bend[:] = np.where(step < 0.0, bend, end)

    def _bristles(
        self,
        term: int,
        coordinate: int,
        at: Instant,
        rates: FloatArray,
        mobility: FloatArray,
        values: Sequence[Values],
    ) -> FloatArray:
        """(B,) their mean force over the substep."""
        _, velocity, rate = self._columns[coordinate]
        state, step = at.begun
        own, reacts = rates[:, rate], mobility[:, rate]
        return bristles.mean_force(at.bends[term], state[:, velocity], own, reacts, step, values[term])

    def _applied(self, at: Instant, values: Sequence[Values]) -> tuple[FloatArray, list[int]]:
        """The smooth generalised forces (B, C), and the coordinates on which some dry friction acts."""
        smooth = np.zeros((len(at.state), len(self._columns)))
        dry: list[int] = []
        for i, effect, coordinate in self._effects:
            if isinstance(effect, BristleEffect):
                continue
            position, velocity, _ = self._columns[coordinate]
            force = effect.force(at.state[:, position], at.state[:, velocity], values[i])
            if force is not None:
                smooth[:, coordinate] += force * at.shares[i] if i in at.shares else force
            elif coordinate not in dry:
                dry.append(coordinate)
        return smooth, dry

    def _grip(
        self, coordinate: int, at: Instant, values: Sequence[Values], load: FloatArray | None
    ) -> FloatArray:
        """(B,) the most that dry friction can hold under a normal force `load`."""
        position, velocity, _ = self._columns[coordinate]
        total = np.zeros(len(at.state))
        for i, effect, on in self._effects:
            if on == coordinate:
                presses = self._command(coordinate, at) if effect.loaded_by_command else load
                most = effect.friction_limit(at.state[:, position], at.state[:, velocity], values[i], presses)
                if most is not None:
                    total += most * at.shares[i] if i in at.shares else most
        return total

    def _command(self, coordinate: int, at: Instant) -> FloatArray:
        """(B,) the size of what drives a coordinate: a command, or what a drive with a law of its own makes of it."""
        on = self.simulator.coordinates[coordinate].name
        if on in self.simulator.served:
            return np.abs(self.simulator.given(at.state, at.action, at.parameters)[on])
        return np.abs(at.action[:, self._commands[on]])

    @cached_property
    def _commands(self) -> dict[str, int]:
        """Coordinate -> the column of the command that drives it."""
        return {on: self.simulator.action.index(action) for action, on in self.simulator.driven().items()}

    def _mobility(self, at: Instant, coordinate: int, smooth: FloatArray, rates: FloatArray) -> FloatArray:
        """(B, R) by how much a unit force changes the rates, which are affine in it."""
        known = self.simulator.mobility(at.state, at.parameters, coordinate)
        if known is not None:
            return known
        unit = np.zeros_like(smooth)
        unit[:, coordinate] = 1.0
        return self.simulator.rates(at.state, at.action, at.parameters, smooth + unit) - rates

    def _most(
        self,
        coordinate: int,
        at: Instant,
        values: Sequence[Values],
        rates: FloatArray,
        mobility: FloatArray,
        sign: FloatArray,
    ) -> FloatArray:
        """(B,) the sliding friction's size; load and friction depend on each other, both affinely: m = m0 + k m."""
        if not any(effect.weighs(values[i]) for i, effect, on in self._effects if on == coordinate):
            return self._grip(coordinate, at, values, None)
        name = self.simulator.coordinates[coordinate].name
        load = self.simulator.normal_force(at.state, rates, at.parameters).get(name)
        most = self._grip(coordinate, at, values, load)
        if load is None:
            return most
        change = self.simulator.normal_force(at.state, rates + mobility, at.parameters)[name] - load
        slope = self._grip(coordinate, at, values, load + change * sign * most) - most
        share = np.divide(slope, most, out=np.zeros_like(most), where=most > 0)
        return np.asarray(most / np.maximum(1.0 - share, 0.1))

    def _dry_friction(
        self, coordinate: int, at: Instant, rates: FloatArray, mobility: FloatArray, values: Sequence[Values]
    ) -> FloatArray:
        """(B,) the friction force, a mean over the substep. Rates are affine in it: rates + mobility * force.

        A body that would reverse within the substep stops on the way, after a share of it; for the rest it is held,
        as far as the grip allows, or starts the other way.
        """
        _, velocity, rate = self._columns[coordinate]
        own, reacts = rates[:, rate], mobility[:, rate]
        if at.substep is None:
            sign = -np.sign(at.state[:, velocity])
            return sign * self._most(coordinate, at, values, rates, mobility, sign)
        speed, step = at.substep[0][:, velocity], at.substep[1]
        sign = -np.sign(speed)
        if not speed.all():  # nearly all move
            (rests,) = np.nonzero(speed == 0)
            sign[rests] = -np.sign(own[rests] / reacts[rests])
        most = self._most(coordinate, at, values, rates, mobility, sign)
        friction = sign * most
        after = speed + step * (own + reacts * friction)
        (stops,) = (speed * after <= 0).nonzero()  # few do
        if len(stops):
            free = -own[stops] / reacts[stops]  # the force that would leave no acceleration
            held = np.minimum(np.maximum(free, -most[stops]), most[stops])
            begun, ended = speed[stops], after[stops]
            share = begun / np.where(begun == ended, 1.0, begun - ended)
            friction[stops] = share * friction[stops] + (1.0 - share) * held
        return np.asarray(friction)
