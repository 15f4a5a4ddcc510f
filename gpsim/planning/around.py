"""Plans around a policy: each command is what the policy says of the sensors, plus a dither, within all limits."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from gpsim.channels import FloatArray
from gpsim.corrected import EffectsPlant, value_key
from gpsim.diagnosis.fitting import Hypothesis

Steer = Callable[[FloatArray], FloatArray]
"""steer(what the sensors say (B, S)) -> commands (B, A)."""
FAR = (
    1e6  # what a state that has run away is clipped to: far out of any box, and its square is still a number
)


@dataclass(frozen=True)
class Around:
    """A policy and what may be commanded: low, high, idle (A,) in the commands' units, rate (A,) a second; dt: s."""

    steer: Steer
    low: FloatArray
    high: FloatArray
    rate: FloatArray
    idle: FloatArray
    dt: float

    def command(self, seen: FloatArray, dither: FloatArray, last: FloatArray) -> FloatArray:
        """(B, A): what is commanded where the sensors say `seen` (B, S), after the commands `last` (B, A)."""
        step = self.rate * self.dt
        wanted = np.clip(self.steer(seen) + dither, self.low, self.high)
        return np.clip(wanted, last - step, last + step)

    def driven(
        self,
        plant: EffectsPlant,
        hypothesis: Hypothesis,
        thetas: FloatArray,
        starts: FloatArray,
        dithers: FloatArray,
        begin: float,
        noise: FloatArray,
    ) -> tuple[FloatArray, FloatArray]:
        """(C, E, L + 1, S) twice: what the sensors would say, and the true states, of every copy under every dither.

        thetas: (C, P) of the hypothesis, whose corrected simulator `plant` is; starts: (C, S); dithers: (E, L, A);
        begin: s on the clock; noise: (S,) of what the policy is told, the same numbers in every call.
        """
        copies, several, steps = len(thetas), len(dithers), dithers.shape[1]
        rng, count = np.random.default_rng(0), copies * several
        memory = plant.begin(count, rng)
        for i, values in enumerate(hypothesis.spread(thetas, several)):
            memory |= {value_key(i, name): each for name, each in values.items()}
        memory["clock"] += begin
        state, last = np.repeat(starts, several, axis=0), np.tile(self.idle, (count, 1))
        true, said = np.empty((2, count, steps + 1, starts.shape[1]))
        with np.errstate(all="ignore"):  # what runs away is clipped, and safe it is not
            true[:, 0], said[:, 0] = state, plant.measure(state, memory, rng)
            for k in range(steps):
                seen = said[:, k] + noise * rng.standard_normal(state.shape) if noise.any() else said[:, k]
                last = self.command(seen, np.tile(dithers[:, k], (copies, 1)), last)
                state = _tamed(plant.step(state, last, memory, rng))
                true[:, k + 1], said[:, k + 1] = state, _tamed(plant.measure(state, memory, rng))
        shape = (copies, several, steps + 1, -1)
        return said.reshape(shape), true.reshape(shape)


def _tamed(state: FloatArray) -> FloatArray:
    return np.clip(np.nan_to_num(state, nan=FAR), -FAR, FAR)
