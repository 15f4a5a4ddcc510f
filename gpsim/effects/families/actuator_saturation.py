"""Saturation: the simulator gets u clipped to [-limit, limit].

Khalil (2002), Nonlinear Systems, 3rd ed., section 1.2.7.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar

import numpy as np

from gpsim.channels import FloatArray
from gpsim.effects.effect import ActuatorEffect, FunctionOf, Values
from gpsim.effects.place import EffectParameter, Place, Plausible
from gpsim.simulators import Memory


class ActuatorSaturation(ActuatorEffect):
    """Saturation: the simulator gets u clipped to [-limit, limit]."""

    family: ClassVar[str] = "actuator_saturation"
    sentence: ClassVar[str] = "{on} saturates at {limit}"
    function_of: ClassVar[FunctionOf] = "command"
    order: ClassVar[int] = 30
    plausible: ClassVar[Mapping[str, Plausible]] = {
        "limit": Plausible(0.1, np.inf, "size", "by reason: nobody commands ten times of what a drive can"),
    }

    def parameters(self, place: Place, variant: str = "") -> tuple[EffectParameter, ...]:
        """Limit [the action's]; from several starts, as a limit out of reach has no gradient."""
        span = place.span
        return (
            EffectParameter(
                "limit",
                place.unit,
                0.0,
                3 * span,
                (0.8 * span, 0.5 * span, 0.25 * span),
                0.1 * span,
                falls=True,
            ),
        )

    def actuate(
        self, commands: FloatArray, values: Values, memory: Memory, step: FloatArray, t: FloatArray
    ) -> FloatArray:
        """The commands, no larger than the limit."""
        return np.clip(commands, -values["limit"], values["limit"])
