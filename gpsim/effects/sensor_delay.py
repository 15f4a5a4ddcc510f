"""A sensor delay: y(t - T)."""

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

    def parameters(self, place: Place, variant: str = "") -> tuple[EffectParameter, ...]:
        """Delay [s]."""
        dt = place.dt
        return (EffectParameter("delay", "s", 0.0, 12 * dt, (0.7 * dt, 2.3 * dt), dt),)

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
        """What the channel was a delay ago, between two substeps their weighted mean."""
        (column,) = columns
        past, rows = memory["past"], np.arange(len(measured))
        depth = past.shape[1]
        newest = (memory["head"].astype(np.int64) - 1) % depth
        back = np.minimum(values["delay"] / step, depth - 2.0)
        whole = back.astype(np.int64)
        near = past[rows, (newest - whole) % depth, column]
        far = past[rows, (newest - whole - 1) % depth, column]
        late = near + (back - whole) * (far - near)
        return changed(measured, column, measured[:, column] - past[rows, newest, column] + late)

    def sentence(self, on: str, values: Mapping[str, str]) -> str:
        """One sentence."""
        return f"the sensor of {on} is {values['delay']} late"
