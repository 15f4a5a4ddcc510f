"""What happens to commands on their way to the simulator: the actuator terms of a chain, and what they remember."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from gpsim.channels import Channels, FloatArray
from gpsim.effects.effect import ActuatorEffect, Values
from gpsim.effects.place import longest_delay
from gpsim.effects.term import Gate, Term, base_name
from gpsim.simulators import Memory, part_of

Stage = tuple[Gate, ActuatorEffect, Values, Memory]
"""Where and when it acts, the law, its values (B,) each, and its memory."""


@dataclass(frozen=True)
class Grid:
    """K substeps of a batch: recorded actions (B, K, A), states (B, K, S) at both ends, begin and length (B, K) s.

    looking_ahead: gates ask for shares of a substep; else for the moment at which it begins.
    """

    actions: FloatArray
    begin: FloatArray
    end: FloatArray
    t: FloatArray
    step: FloatArray
    channels: Channels
    looking_ahead: bool

    def share(self, gate: Gate, values: Values) -> FloatArray:
        """(B, K) how much of each substep a gate is open."""
        if self.looking_ahead:
            return gate.share((self.begin, self.end), self.actions, self.t, self.step, self.channels, values)
        moment = np.zeros_like(self.step)
        return gate.share((self.begin, self.begin), self.actions, self.t, moment, self.channels, values)

    def split(self, shares: FloatArray, gated: bool) -> Grid:
        """The grid with every substep cut into P pieces of these shares (B, K, P) of it.

        gated: gates will look at it; actions and states are left out else.
        """
        lengths = self.step[:, :, None] * shares
        begins = self.t[:, :, None] + np.cumsum(lengths, axis=2) - lengths
        t, step = (a.reshape(len(a), -1) for a in (begins, lengths))
        if not gated:
            return replace(self, t=t, step=step)
        count = shares.shape[2]
        actions, begin, end = (np.repeat(a, count, axis=1) for a in (self.actions, self.begin, self.end))
        return replace(self, actions=actions, begin=begin, end=end, t=t, step=step)


def on_its_way(way: Sequence[Stage], column: int, grid: Grid) -> FloatArray:
    """(B, K) what one action's commands have become at the simulator, means over the substeps; memories move on."""
    u, whole, pieces = grid.actions[:, :, column], grid, 1
    for place, (gate, effect, given, memory) in enumerate(way):
        values = {name: value[:, None] for name, value in given.items()}
        share = grid.share(gate, values) if gate else None
        several = (
            effect.pieces(u, values, memory, grid.step, grid.t)
            if place < len(way) - 1 and pieces == 1
            else None
        )
        if several is None:
            acted = effect.actuate(u, values, memory, grid.step, grid.t)
        else:
            commands, shares = several
            pieces, grid = shares.shape[2], grid.split(shares, any(later for later, *_ in way[place + 1 :]))
            acted, u = commands.reshape(len(u), -1), np.repeat(u, pieces, axis=1)
            share = None if share is None else np.repeat(share, pieces, axis=1)
        u = acted if share is None else blended(share, acted, u)
    if pieces == 1:
        return u
    area = (u * grid.step).reshape(*whole.step.shape, pieces).sum(axis=2)
    return np.asarray(area / whole.step)


def blended(share: FloatArray, acted: FloatArray, untouched: FloatArray) -> FloatArray:
    """What an effect makes of a quantity during its share of a substep, with what it was for the rest."""
    return np.asarray(np.where(share == 1.0, acted, share * acted + (1.0 - share) * untouched))


@dataclass(frozen=True)
class Actuation:
    """The actuator terms among `terms`, which change the channels `action`, at control steps of `dt` s."""

    terms: tuple[Term, ...]
    action: Channels
    dt: float

    def __bool__(self) -> bool:
        """Whether anything happens to the commands."""
        return bool(self._effects)

    def acts(self, term: int) -> bool:
        """Whether a term changes commands."""
        return isinstance(self.terms[term].effect, ActuatorEffect)

    @cached_property
    def looks(self) -> bool:
        """Whether what happens to a command depends on where the system is."""
        return any(self.terms[i].gate.region for i, _, _ in self._effects)

    @cached_property
    def zero_order_hold_exact(self) -> bool:
        """Whether whole control steps take commands to where a fine grid does: each effect is exact for a held one."""
        ways = [[e for _, e, column in self._effects if column == c] for _, _, c in self._effects]
        gated = any(self.terms[i].gate for i, _, _ in self._effects)
        return not gated and all(effect.holds for way in ways for effect in way[:-1])

    def remembers(self, values: Sequence[Values]) -> float:
        """How long [s] a command matters after it was given, through all that happens to it."""
        acting = {i: effect for i, effect, _ in self._effects}
        return sum(effect.remembers(values[i]) for i, effect in acting.items())

    def rest(self, count: int, step: float) -> Memory:
        """The memory at rest, for a grid of `step` [s]."""
        memory: Memory = {}
        # What was found on a thinned clock may be late by more of this clock's steps.
        late = (v for t in self.terms for name, v in t.values.items() if base_name(name) == "delay")
        longest = max(longest_delay(self.dt), *late, 0.0)
        for i, effect, column in self._effects:
            part, own = effect.begin(count, longest, step), self._own(i, column)
            memory |= {f"{own}{key}": values for key, values in part.items()}
        return memory

    def finer(self, memory: Memory, times: int) -> Memory:
        """The memory for a grid that is so many times finer from here on."""
        return {
            f"{own}{key}": values
            for i, effect, column in self._effects
            for own in (self._own(i, column),)
            for key, values in effect.finer(part_of(memory, own), times).items()
        }

    def delivered(self, grid: Grid, values: Sequence[Values], memory: Memory) -> FloatArray:
        """(B, K, A): what reaches the simulator; memory moves on."""
        out = np.array(grid.actions)
        for column in dict.fromkeys(column for _, _, column in self._effects):
            way = [
                (self.terms[i].gate, e, values[i], part_of(memory, self._own(i, c)))
                for i, e, c in self._effects
                if c == column
            ]
            out[:, :, column] = on_its_way(way, column, grid)
        return out

    @cached_property
    def _effects(self) -> list[tuple[int, ActuatorEffect, int]]:
        """Index of the term, its effect and the column of its command, in the order in which they act."""
        found = [
            (i, term.effect, self.action.index(on))
            for i, term in enumerate(self.terms)
            if isinstance(term.effect, ActuatorEffect)
            for on in term.places
        ]
        return sorted(found, key=lambda item: item[1].order)

    def _own(self, term: int, column: int) -> str:
        """How what a term remembers of an action is called."""
        return f"{term}:{column}/" if self.terms[term].also else f"{term}/"
