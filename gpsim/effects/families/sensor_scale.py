"""A sensor scale: k y.

Definition: a product.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar

from gpsim.channels import FloatArray
from gpsim.effects.effect import FunctionOf, SensorEffect, Values, changed
from gpsim.effects.place import EffectParameter, Place, Plausible
from gpsim.simulators import Memory


class SensorScale(SensorEffect):
    """A sensor scale: k y."""

    family: ClassVar[str] = "sensor_scale"
    sentence: ClassVar[str] = "the sensor of {on} reads {scale} times the truth"
    function_of: ClassVar[FunctionOf] = "reading"
    order: ClassVar[int] = 40
    plausible: ClassVar[Mapping[str, Plausible]] = {
        "scale": Plausible(0.5, 2.0, "1", "wheel radii and tracks 1 to 10 % (Borenstein and Feng 1996)"),
    }

    def parameters(self, place: Place, variant: str = "") -> tuple[EffectParameter, ...]:
        """Scale [1]."""
        return (EffectParameter("scale", "1", 0.05, 20.0, (1.1,), 0.2, none=1.0),)

    def measure(
        self, measured: FloatArray, columns: tuple[int, ...], values: Values, memory: Memory, step: FloatArray
    ) -> FloatArray:
        """A factor on one channel."""
        (column,) = columns
        return changed(measured, column, measured[:, column] * values["scale"])
