"""A sensor delay: y(t - T).

Definition: a shift; between samples, Lagrange's interpolation (Laakso, Valimaki, Karjalainen and Laine 1996,
"Splitting the unit delay", IEEE Signal Processing Magazine 13(1)).
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar

import numpy as np

from gpsim.channels import FloatArray
from gpsim.effects.effect import EffectParameter, Place, SensorEffect, Values, changed
from gpsim.simulators.plant import Memory


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

    def begin(self, history: FloatArray) -> Memory:
        """The last states in a ring, and where the oldest lies."""
        return {"past": np.array(history), "head": np.zeros(len(history))}

    def watch(self, state: FloatArray, column: int, memory: Memory) -> None:
        """Remember the newest state."""
        head = memory["head"].astype(np.int64)
        memory["past"][np.arange(len(state)), head] = state
        memory["head"][:] = (head + 1) % memory["past"].shape[1]

    def measure(
        self, measured: FloatArray, columns: tuple[int, ...], values: Values, memory: Memory, step: FloatArray
    ) -> FloatArray:
        """What the channel was a delay ago; between substeps, Lagrange's cubic through the four around it."""
        (column,) = columns
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
