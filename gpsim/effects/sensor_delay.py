"""A sensor delay: y(t - T).

Definition: a shift; between samples, Lagrange's interpolation (Laakso, Valimaki, Karjalainen and Laine 1996,
"Splitting the unit delay", IEEE Signal Processing Magazine 13(1)).
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar

import numpy as np

from gpsim.channels import FloatArray, IntArray
from gpsim.effects.effect import EffectParameter, Place, SensorEffect, Values, changed
from gpsim.effects.elapsed import last_at_most
from gpsim.simulators.plant import Memory

CLOSE = (
    0.05  # of the longest of three steps: a cubic through states nearer to each other would blow up rounding
)


class SensorDelay(SensorEffect):
    """A sensor delay: y(t - T)."""

    family: ClassVar[str] = "sensor_delay"
    order: ClassVar[int] = 10

    def parameters(self, place: Place, variant: str = "") -> tuple[EffectParameter, ...]:
        """Delay [s]."""
        dt = place.dt
        return (EffectParameter("delay", "s", 0.0, place.longest_delay, (0.7 * dt, 2.3 * dt), dt),)

    def reach(self, values: Values) -> float:
        """The longest delay [s]."""
        return float(np.max(values["delay"], initial=0.0))

    def begin(self, history: FloatArray, steps: FloatArray | None = None) -> Memory:
        """The last states in a ring, and where the oldest lies; on an uneven clock also when [s] each one was."""
        memory = {"past": np.array(history), "head": np.zeros(len(history))}
        if steps is not None:
            when = np.cumsum(steps, axis=1)
            memory["when"] = when - when[:, -1:]
        return memory

    def watch(self, state: FloatArray, column: int, memory: Memory, step: FloatArray) -> None:
        """Remember the newest state."""
        head, rows = memory["head"].astype(np.int64), np.arange(len(state))
        memory["past"][rows, head] = state
        if "when" in memory:
            memory["when"][rows, head] = memory["when"][rows, head - 1] + step
        memory["head"][:] = (head + 1) % memory["past"].shape[1]

    def measure(
        self, measured: FloatArray, columns: tuple[int, ...], values: Values, memory: Memory, step: FloatArray
    ) -> FloatArray:
        """What the channel was a delay ago; between substeps, Lagrange's cubic through the four around it."""
        (column,) = columns
        if "when" in memory:
            return changed(measured, column, measured[:, column] + _change(values["delay"], column, memory))
        past, rows = memory["past"], np.arange(len(measured))
        depth = past.shape[1]
        newest = (memory["head"].astype(np.int64) - 1) % depth
        back = np.minimum(values["delay"] / step, depth - 2.0)
        # The four lie one substep apart; nothing is known after the newest, and nothing before the oldest.
        first = np.clip(back.astype(np.int64) - 1, 0, max(depth - 4, 0))
        nodes = range(min(4, depth))
        late = np.zeros(len(measured))
        for i in nodes:
            weight = np.ones(len(measured))
            for j in nodes:
                if j != i:
                    weight *= (back - first - j) / (i - j)
            late += weight * past[rows, (newest - first - i) % depth, column]
        return changed(measured, column, measured[:, column] - past[rows, newest, column] + late)

    def sentence(self, on: str, values: Mapping[str, str]) -> str:
        """One sentence."""
        return f"the sensor of {on} is {values['delay']} late"


def _change(delay: FloatArray, column: int, memory: Memory) -> FloatArray:
    """(B,) what the channel was a delay (B,) [s] ago less what it is, on an uneven clock.

    Lagrange's cubic through the four states around that moment, a straight line where some of them nearly coincide.
    """
    past, when, rows = memory["past"], memory["when"], np.arange(len(delay))
    depth = past.shape[1]
    newest = (memory["head"].astype(np.int64) - 1) % depth

    def ago(back: IntArray) -> FloatArray:
        return np.asarray(when[rows, newest] - when[rows, (newest - back) % depth])

    def was(back: IntArray) -> FloatArray:
        return np.asarray(past[rows, (newest - back) % depth, column])

    late = np.minimum(delay, ago(np.full(len(delay), depth - 1)))
    before = last_at_most(ago, depth - 1, late)  # the moment lies between this state and the next older one
    first = np.clip(before - 1, 0, max(depth - 4, 0))
    ages = np.stack([ago(first + i) for i in range(min(4, depth))])
    apart = np.diff(ages, axis=0)
    near, far = ago(before), ago(before + 1)
    share = np.clip((late - near) / np.where(far > near, far - near, 1.0), 0.0, 1.0)
    straight = was(before) + share * (was(before + 1) - was(before))
    curved = np.zeros(len(delay))
    with np.errstate(all="ignore"):
        for i, age in enumerate(ages):
            others = [j for j in range(len(ages)) if j != i]
            weight = np.prod([(late - ages[j]) / (age - ages[j]) for j in others], axis=0)
            curved += weight * was(first + i)
    smooth = apart.min(axis=0) > CLOSE * apart.max(axis=0)
    return np.asarray(np.where(smooth, curved, straight) - past[rows, newest, column])
