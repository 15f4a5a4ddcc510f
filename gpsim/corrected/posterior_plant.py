"""Simulators drawn from what a diagnosis leaves open: an explanation, its sizes, one function of what has no name.

Ambiguity and intervals are what a recording could not decide. A policy that is trained in draws of them meets worlds
that the data allow; domain randomisation draws from a box that nobody has measured.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from gpsim.channels import Channels, FloatArray, IntArray
from gpsim.corrected.effects_plant import EffectsPlant, value_key
from gpsim.simulators import Memory, part_of

WHICH = "which"


@dataclass(frozen=True)
class Size:
    """A parameter of one term: its value, the ends of its interval, and the bounds that no draw leaves."""

    term: int
    name: str
    value: float
    low: float
    high: float
    least: float
    most: float


@dataclass(frozen=True)
class Spread:
    """How the sizes of an explanation vary together: their intervals of probability `level`, and correlations (P, P).

    A draw is Gaussian with these correlations; each size is stretched to its own interval, above its value and below.
    """

    sizes: tuple[Size, ...]
    correlations: FloatArray
    level: float

    @cached_property
    def _root(self) -> FloatArray:
        """(P, P): root root' are the correlations; rounding may have made them slightly indefinite."""
        values, vectors = np.linalg.eigh(self.correlations)
        return np.asarray(vectors * np.sqrt(np.maximum(values, 0.0)))

    def draw(self, count: int, rng: np.random.Generator) -> FloatArray:
        """(count, P) sizes."""
        from scipy.special import ndtri  # here: who corrects by one explanation need not wait for it

        normal = rng.standard_normal((count, len(self.sizes))) @ self._root.T
        value, low, high, least, most = (
            np.array([getattr(size, part) for size in self.sizes])
            for part in ("value", "low", "high", "least", "most")
        )
        half = np.where(normal > 0.0, high - value, value - low) / ndtri(0.5 + self.level / 2.0)
        return np.asarray(np.clip(value + normal * half, least, most))


@dataclass(frozen=True)
class Drawable:
    """A corrected simulator that the data allow, how probable it is, and how its sizes vary."""

    plant: EffectsPlant
    probability: float
    spread: Spread


@dataclass(frozen=True)
class PosteriorPlant:
    """Every episode is driven in a simulator of its own: an explanation by its probability, its sizes by their spread.

    What an explanation's Gaussian process draws is its own affair (see `FunctionCorrection`: one function an episode).
    """

    explanations: tuple[Drawable, ...]

    @property
    def state(self) -> Channels:
        """The simulator's state channels."""
        return self.explanations[0].plant.state

    @property
    def action(self) -> Channels:
        """The simulator's action channels."""
        return self.explanations[0].plant.action

    @property
    def dt(self) -> float:
        """The control step [s]."""
        return self.explanations[0].plant.dt

    def begin(self, count: int, rng: np.random.Generator) -> Memory:
        """Draws (count,) of the explanation and of the sizes of each, and what every explanation remembers."""
        odds = np.array([explanation.probability for explanation in self.explanations])
        memory: Memory = {WHICH: rng.choice(len(odds), size=count, p=odds / odds.sum()).astype(float)}
        for i, explanation in enumerate(self.explanations):
            own, sizes = explanation.plant.begin(count, rng), explanation.spread.sizes
            drawn = explanation.spread.draw(count, rng)
            own |= {value_key(size.term, size.name): drawn[:, j].copy() for j, size in enumerate(sizes)}
            memory |= {f"{i}/{key}": values for key, values in own.items()}
        return memory

    def step(
        self, state: FloatArray, action: FloatArray, memory: Memory, rng: np.random.Generator
    ) -> FloatArray:
        """(B, S): the true state after one control step, each episode in its own simulator."""
        out = np.empty_like(state)
        for plant, rows, own in self._parts(memory):
            out[rows] = plant.step(state[rows], action[rows], own, rng)
        return out

    def measure(self, state: FloatArray, memory: Memory, rng: np.random.Generator) -> FloatArray:
        """(B, S): what each episode's own sensors say."""
        out = np.empty_like(state)
        for plant, rows, own in self._parts(memory):
            out[rows] = plant.measure(state[rows], own, rng)
        return out

    def _parts(self, memory: Memory) -> Iterator[tuple[EffectsPlant, IntArray, Memory]]:
        """Each explanation that some episodes live in, these rows, and copies of their memory, which are put back."""
        for i, explanation in enumerate(self.explanations):
            rows = np.flatnonzero(memory[WHICH] == i)
            if not rows.size:
                continue
            whole = part_of(memory, f"{i}/")
            own = {key: values[rows] for key, values in whole.items()}
            yield explanation.plant, rows, own
            for key, values in own.items():
                whole[key][rows] = values
