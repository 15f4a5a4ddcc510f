"""A measured motor curve: what reaches the simulator is a function of the command.

Penalised splines (Eilers and Marx 1996, Statistical Science 11) of the first degree, fitted by `gpsim.diagnosis.form`.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from gpsim.channels import FloatArray
from gpsim.effects.effect import ActuatorEffect, Values
from gpsim.effects.measured import SCALE, Measured
from gpsim.simulators import Memory


@dataclass(frozen=True)
class ActuatorCurve(Measured, ActuatorEffect):
    """A measured motor curve: the simulator gets u + what the curve adds to the command u."""

    family: ClassVar[str] = "actuator_curve"
    noun: ClassVar[str] = "measured motor curve"
    order: ClassVar[int] = 20

    def actuate(
        self, commands: FloatArray, values: Values, memory: Memory, step: FloatArray, t: FloatArray
    ) -> FloatArray:
        """The command and what the curve adds to it."""
        return np.asarray(commands + values[SCALE] * self.shape.at(commands))
