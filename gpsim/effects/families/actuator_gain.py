"""A gain of the actuator: the simulator gets g u.

Definition: a product.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar

import numpy as np

from gpsim.channels import FloatArray
from gpsim.effects.effect import ActuatorEffect, FunctionOf, Needs, Values
from gpsim.effects.place import EffectParameter, Place, Plausible
from gpsim.simulators import Memory


class ActuatorGain(ActuatorEffect):
    """A gain of the actuator: the simulator gets g u."""

    family: ClassVar[str] = "actuator_gain"
    sentence: ClassVar[str] = "{on} acts with {gain} times its commanded size"
    function_of: ClassVar[FunctionOf] = "command"
    needs: ClassVar[Needs] = "command"
    order: ClassVar[int] = 40
    plausible: ClassVar[Mapping[str, Plausible]] = {
        "gain": Plausible(
            0.25,
            4.0,
            "1",
            "torque constants are within 10 % (data sheets), gears and units are mistaken by a factor of two or three",
        ),
    }

    def parameters(self, place: Place, variant: str = "") -> tuple[EffectParameter, ...]:
        """Gain [1]."""
        return (EffectParameter("gain", "1", -5.0, 5.0, (0.9,), 0.2, none=1.0),)

    def actuate(
        self, commands: FloatArray, values: Values, memory: Memory, step: FloatArray, t: FloatArray
    ) -> FloatArray:
        """Gain * commands."""
        return np.asarray(values["gain"] * commands)
