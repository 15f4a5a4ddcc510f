"""A sensor bias: y + o.

Definition: a sum.
"""

from __future__ import annotations

from typing import ClassVar

from gpsim.channels import FloatArray
from gpsim.effects.effect import FunctionOf, SensorEffect, Values, changed
from gpsim.effects.place import EffectParameter, Place
from gpsim.simulators import Memory, Simulator


class SensorBias(SensorEffect):
    """A sensor bias: y + o."""

    family: ClassVar[str] = "sensor_bias"
    sentence: ClassVar[str] = "the sensor of {on} is off by {offset}"
    function_of: ClassVar[FunctionOf] = "reading"

    def places(self, simulator: Simulator) -> tuple[str, ...]:
        """Every measured channel; where an encoder's zero would say the same, that says it."""
        said = simulator.model_places.get("joint_offset", {})
        return tuple(n for n in super().places(simulator) if n not in said or said[n].steers)

    def parameters(self, place: Place, variant: str = "") -> tuple[EffectParameter, ...]:
        """Offset [the channel's]."""
        span = place.span
        return (EffectParameter("offset", place.unit, -5 * span, 5 * span, (0.1 * span,), 0.1 * span),)

    def measure(
        self, measured: FloatArray, columns: tuple[int, ...], values: Values, memory: Memory, step: FloatArray
    ) -> FloatArray:
        """An offset on one channel."""
        (column,) = columns
        return changed(measured, column, measured[:, column] + values["offset"])
