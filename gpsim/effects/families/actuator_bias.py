"""A bias of the actuator: the simulator gets u + b.

Definition: a sum.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar

import numpy as np

from gpsim.channels import FloatArray
from gpsim.effects.effect import ActuatorEffect, FunctionOf, Needs, Values
from gpsim.effects.place import EffectParameter, Place, Plausible
from gpsim.simulators import Memory


class ActuatorBias(ActuatorEffect):
    """A bias of the actuator: the simulator gets u + b."""

    family: ClassVar[str] = "actuator_bias"
    sentence: ClassVar[str] = "{on} acts with an offset of {bias}"
    function_of: ClassVar[FunctionOf] = "command"
    needs: ClassVar[Needs] = "nothing"
    order: ClassVar[int] = 70
    plausible: ClassVar[Mapping[str, Plausible]] = {
        "bias": Plausible(0.0, 1.0, "size", "by reason: an offset is less than what is commanded"),
    }

    def parameters(self, place: Place, variant: str = "") -> tuple[EffectParameter, ...]:
        """Bias [the action's]."""
        span = place.span
        return (EffectParameter("bias", place.unit, -5 * span, 5 * span, (0.1 * span,), 0.1 * span),)

    def actuate(
        self, commands: FloatArray, values: Values, memory: Memory, step: FloatArray, t: FloatArray
    ) -> FloatArray:
        """Command + bias."""
        return np.asarray(commands + values["bias"])
