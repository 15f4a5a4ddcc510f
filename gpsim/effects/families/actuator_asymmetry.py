"""Asymmetry: g+ u for u > 0, g- u for u < 0.

Definition: two gains for the one of `actuator_gain`, as a motor controller scales its two directions.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar

import numpy as np

from gpsim.channels import FloatArray
from gpsim.effects.effect import ActuatorEffect, FunctionOf, Values
from gpsim.effects.place import EffectParameter, Place, Plausible
from gpsim.simulators import Memory


class ActuatorAsymmetry(ActuatorEffect):
    """Asymmetry: g+ u for u > 0, g- u for u < 0."""

    family: ClassVar[str] = "actuator_asymmetry"
    sentence: ClassVar[str] = (
        "{on} acts with {gain_positive} times a positive command and {gain_negative} times a negative one"
    )
    function_of: ClassVar[FunctionOf] = "command"
    order: ClassVar[int] = 50
    plausible: ClassVar[Mapping[str, Plausible]] = dict.fromkeys(
        ("gain_positive", "gain_negative"), Plausible(0.25, 4.0, "1", "as a gain")
    )

    def parameters(self, place: Place, variant: str = "") -> tuple[EffectParameter, ...]:
        """gain_positive and gain_negative [1]."""
        return (
            EffectParameter("gain_positive", "1", -5.0, 5.0, (0.9,), 0.2, none=1.0),
            EffectParameter("gain_negative", "1", -5.0, 5.0, (1.1,), 0.2, none=1.0),
        )

    def actuate(
        self, commands: FloatArray, values: Values, memory: Memory, step: FloatArray, t: FloatArray
    ) -> FloatArray:
        """Each direction with its own gain."""
        return np.where(commands > 0, values["gain_positive"], values["gain_negative"]) * commands
