"""A gain of the actuator: the simulator gets g u.

Definition: a product.
"""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from gpsim.channels import FloatArray
from gpsim.effects.effect import ActuatorEffect, EffectParameter, FunctionOf, Needs, Place, Values
from gpsim.simulators import Memory


class ActuatorGain(ActuatorEffect):
    """A gain of the actuator: the simulator gets g u."""

    family: ClassVar[str] = "actuator_gain"
    usual: ClassVar[int] = 6
    function_of: ClassVar[FunctionOf] = "command"
    needs: ClassVar[Needs] = "command"
    order: ClassVar[int] = 40

    def parameters(self, place: Place, variant: str = "") -> tuple[EffectParameter, ...]:
        """Gain [1]."""
        return (EffectParameter("gain", "1", -5.0, 5.0, (0.9,), 0.2, none=1.0),)

    def actuate(
        self, commands: FloatArray, values: Values, memory: Memory, step: FloatArray, t: FloatArray
    ) -> FloatArray:
        """Gain * commands."""
        return np.asarray(values["gain"] * commands)
