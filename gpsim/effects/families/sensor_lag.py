"""A sensor's lag: T y' = x - y, the filter of the first order that firmware lays over what it reads.

Ogata (2010), Modern Control Engineering, 5th ed., section 5-2 (first-order systems). Exact where the true value x is a
straight line over each substep. Asked on a speed or a position that was read beside the other and visibly trails it.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar

import numpy as np

from gpsim.channels import FloatArray
from gpsim.effects.effect import FunctionOf, SensorEffect, Values, changed
from gpsim.effects.place import EffectParameter, Place, Plausible
from gpsim.simulators import Memory

REACH = 4.0  # time constants that it looks back: what was before is taken for a straight line
LONGEST = 16.0  # steps: so that all of its reach lies in what windows remember


class SensorLag(SensorEffect):
    """A sensor's lag: T y' = x - y."""

    family: ClassVar[str] = "sensor_lag"
    sentence: ClassVar[str] = "the sensor of {on} follows the truth with a lag of {time_constant}"
    function_of: ClassVar[FunctionOf] = "nothing"
    order: ClassVar[int] = 5
    plausible: ClassVar[Mapping[str, Plausible]] = {
        "time_constant": Plausible(
            0.0, 5.0, "step", "firmware filters speeds with cut-offs of 3 to 150 Hz: 1 to 50 ms", least=0.1
        ),
    }

    def parameters(self, place: Place, variant: str = "") -> tuple[EffectParameter, ...]:
        """time_constant [s]."""
        dt = place.dt
        return (EffectParameter("time_constant", "s", 0.0, LONGEST * dt, (0.5 * dt, 2.5 * dt), dt),)

    def offers(self, place: Place, variant: str) -> bool:
        """Where a channel trails the other one of its coordinate: what trails in both is an actuator's lag."""
        return variant == "" and place.trails

    def reach(self, values: Values) -> float:
        """As far [s] back as a start hardly matters any more."""
        return REACH * float(np.max(values["time_constant"], initial=0.0))

    def begin(
        self,
        history: FloatArray,
        column: int,
        values: Values,
        step: FloatArray,
        steps: FloatArray | None = None,
    ) -> tuple[Memory, FloatArray]:
        """How far the reading is behind the newest state, from a straight line before the oldest."""
        past, depth = history[:, :, column], history.shape[1]
        memory = {"behind": np.zeros(len(history)), "last": np.array(past[:, 0])}
        seen = np.array(history)
        for k in range(1, depth):
            h = step if steps is None else steps[:, k]
            if k == 1:
                slope = (past[:, 1] - past[:, 0]) / np.maximum(h, 1e-12)
                memory["behind"][:] = _constant(values) * slope
                seen[:, 0, column] -= memory["behind"]
            seen[:, k] = self.watch(history[:, k], column, values, memory, h)
        return memory, seen

    def watch(
        self, state: FloatArray, column: int, values: Values, memory: Memory, step: FloatArray
    ) -> FloatArray:
        """The reading approaches the straight line from the last state to this one; it is what others see."""
        ratio = np.maximum(step, 1e-12) / _constant(values)
        now = state[:, column]
        memory["behind"] *= np.exp(-ratio)
        memory["behind"] += (now - memory["last"]) * -np.expm1(-ratio) / ratio
        memory["last"][:] = now
        return changed(state, column, now - memory["behind"])

    def measure(
        self, measured: FloatArray, columns: tuple[int, ...], values: Values, memory: Memory, step: FloatArray
    ) -> FloatArray:
        """What is there, less how far the reading is behind."""
        (column,) = columns
        return changed(measured, column, measured[:, column] - memory["behind"])


def _constant(values: Values) -> FloatArray:
    return np.maximum(values["time_constant"], 1e-9)
