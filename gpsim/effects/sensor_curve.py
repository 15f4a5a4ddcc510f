"""A measured characteristic of a sensor: what is read is a function of the true value.

Penalised splines (Eilers and Marx 1996, Statistical Science 11) of the first degree, fitted by `gpsim.diagnosis.form`.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from gpsim.channels import FloatArray
from gpsim.effects.effect import SensorEffect, Values, changed
from gpsim.effects.measured import SCALE, Measured
from gpsim.simulators import Memory


@dataclass(frozen=True)
class SensorCurve(Measured, SensorEffect):
    """A measured characteristic of a sensor: it reads y + what the curve adds to the true value y."""

    family: ClassVar[str] = "sensor_curve"
    noun: ClassVar[str] = "measured sensor curve"
    order: ClassVar[int] = 40

    def measure(
        self, measured: FloatArray, columns: tuple[int, ...], values: Values, memory: Memory, step: FloatArray
    ) -> FloatArray:
        """The value and what the curve adds to it."""
        (column,) = columns
        y = measured[:, column]
        return changed(measured, column, y + values[SCALE] * self.shape.at(y))
