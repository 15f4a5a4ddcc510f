"""The end of the chain: what the effects on sensors make of the states that they are shown."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from gpsim.channels import FloatArray
from gpsim.effects.effect import SensorEffect, Values, columns_of
from gpsim.effects.families.sensors import SensorDelay, SensorLag
from gpsim.effects.term import Term
from gpsim.simulators import Memory, Simulator, part_of

SHORTEST = 1e-6  # s, of a substep: two samples may bear one stamp


@dataclass(frozen=True)
class Sensors:
    """The terms that act on what is measured, in the order of their effects."""

    simulator: Simulator
    terms: tuple[Term, ...]

    @cached_property
    def remember(self) -> bool:
        """Whether one remembers, and `watch` must be called at every substep."""
        return self.remembering > 0

    @cached_property
    def remembering(self) -> int:
        """How many remember."""
        return sum(bool(effect.memory) for _, effect, _ in self._effects)

    def looks_back(self, values: Sequence[Values]) -> float:
        """How far back [s] they look: those of one channel after one another."""
        by_column: dict[int, float] = {}
        for i, effect, columns in self._effects:
            by_column[columns[0]] = by_column.get(columns[0], 0.0) + effect.reach(values[i])
        return max(by_column.values(), default=0.0)

    def reach(self, values: Sequence[Values], step: FloatArray) -> int:
        """How many substeps of `step` (B,) [s] back they look."""
        shortest = max(float(np.min(step)), SHORTEST)
        return int(np.ceil(self.looks_back(values) / shortest)) + 2

    def begin(
        self, history: FloatArray, values: Sequence[Values], step: FloatArray, steps: FloatArray | None = None
    ) -> Memory:
        """Their memory at the start of a batch, from its last true states (B, K, S), the newest last.

        step: (B,) s, of a substep; steps: (B, K) s, how long after the one before each state is; only where the clock
        is uneven.
        """
        memory: Memory = {}
        for i, effect, columns in self._effects:
            part, history = effect.begin(history, columns[0], values[i], step, steps)
            memory |= {f"{i}/{key}": kept for key, kept in part.items()}
        return memory

    def __len__(self) -> int:
        return len(self._effects)

    @cached_property
    def late(self) -> list[tuple[int, int]]:
        """Term and column of those that say what their channel was before."""
        return [(i, columns[0]) for i, effect, columns in self._effects if isinstance(effect, SensorDelay)]

    @cached_property
    def lagging(self) -> list[tuple[int, int]]:
        """Term and column of those that follow their channel with a lag."""
        return [(i, columns[0]) for i, effect, columns in self._effects if isinstance(effect, SensorLag)]

    @property
    def late_first(self) -> bool:
        """Whether lags come first, then those, and nobody else remembers."""
        known = [i for i, _ in (*self.lagging, *self.late)]
        return self.remembering == len(known) and known == [i for i, *_ in self._effects[: len(known)]]

    @property
    def rest(self) -> list[int]:
        """The terms of all others."""
        known = [i for i, _ in (*self.lagging, *self.late)]
        return [i for i, *_ in self._effects if i not in known]

    def rest_measure(self, state: FloatArray, values: Mapping[int, Values], step: FloatArray) -> FloatArray:
        """(B, S): what all others make of what those say; values: of the rest's terms."""
        out = state
        for i, effect, columns in self._effects:
            if i in values:
                out = effect.measure(out, columns, values[i], {}, step)
        return out

    def watch(self, state: FloatArray, values: Sequence[Values], memory: Memory, step: FloatArray) -> None:
        """Let those that remember see the state (B, S) at the end of a substep (B,) [s]."""
        for i, effect, columns in self._effects:
            state = effect.watch(state, columns[0], values[i], part_of(memory, f"{i}/"), step)

    def measure(
        self, state: FloatArray, values: Sequence[Values], memory: Memory, step: FloatArray
    ) -> FloatArray:
        """(B, S): what they say."""
        out = state
        for i, effect, columns in self._effects:
            out = effect.measure(out, columns, values[i], part_of(memory, f"{i}/"), step)
        return out

    @cached_property
    def _effects(self) -> list[tuple[int, SensorEffect, tuple[int, ...]]]:
        found = [
            (i, t.effect, columns_of(t.effect, t.on, self.simulator))
            for i, t in enumerate(self.terms)
            if isinstance(t.effect, SensorEffect)
        ]
        return sorted(found, key=lambda item: item[1].order)
