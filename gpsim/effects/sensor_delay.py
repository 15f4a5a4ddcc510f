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

    def begin(self, state: FloatArray, slope: FloatArray, longest: float, step: FloatArray) -> Memory:
        """The last `longest` seconds, as a straight line into the past."""
        depth = max(int(np.ceil(longest / float(np.min(step)))) + 2, 2)
        back = np.arange(depth - 1, -1, -1)[None, :, None] * step[:, None, None]
        return {"past": state[:, None, :] - back * slope[:, None, :], "head": np.zeros(len(state))}

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
        near, far = (
            past[rows, (newest - whole) % depth, column],
            past[rows, (newest - whole - 1) % depth, column],
        )
        late = near + (back - whole) * (far - near)
        return changed(measured, column, measured[:, column] - past[rows, newest, column] + late)

    def sentence(self, on: str, values: Mapping[str, str]) -> str:
        """One sentence."""
        return f"the sensor of {on} is {values['delay']} late"
