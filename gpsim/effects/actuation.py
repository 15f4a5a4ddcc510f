"""What happens to commands on their way to the simulator: the actuator terms of a chain, and what they remember."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from gpsim.channels import Channels, FloatArray
from gpsim.effects.commands import Grid, on_its_way
from gpsim.effects.effect import ActuatorEffect, Values
from gpsim.effects.own import base_name
from gpsim.effects.place import longest_delay
from gpsim.effects.term import Term
from gpsim.simulators import Memory, part_of


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
    def leaps(self) -> bool:
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
