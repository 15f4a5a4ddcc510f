"""A sensor scale: k y.

Definition: a product.
"""

from __future__ import annotations

from typing import ClassVar

from gpsim.channels import FloatArray
from gpsim.effects.effect import EffectParameter, FunctionOf, Place, SensorEffect, Values, changed
from gpsim.simulators import Memory


class SensorScale(SensorEffect):
    """A sensor scale: k y."""

    family: ClassVar[str] = "sensor_scale"
    function_of: ClassVar[FunctionOf] = "reading"
    order: ClassVar[int] = 40

    def parameters(self, place: Place, variant: str = "") -> tuple[EffectParameter, ...]:
        """Scale [1]."""
        return (EffectParameter("scale", "1", 0.05, 20.0, (1.1,), 0.2, none=1.0),)

    def measure(
        self, measured: FloatArray, columns: tuple[int, ...], values: Values, memory: Memory, step: FloatArray
    ) -> FloatArray:
        """A factor on one channel."""
        (column,) = columns
        return changed(measured, column, measured[:, column] * values["scale"])
