"""Backlash: the play operator; the output moves only when the input pushes against an end of the gap.

Krasnoselskii and Pokrovskii (1989), Systems with Hysteresis, section 2.1.
"""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from gpsim.channels import FloatArray
from gpsim.effects.effect import ActuatorEffect, FunctionOf, Values
from gpsim.effects.place import EffectParameter, Place
from gpsim.simulators import Memory


class ActuatorBacklash(ActuatorEffect):
    """Backlash: the play operator; the output moves only when the input pushes against an end of the gap."""

    family: ClassVar[str] = "actuator_backlash"
    sentence: ClassVar[str] = "{on} has a backlash of half width {half_width}"
    function_of: ClassVar[FunctionOf] = "nothing"
    order: ClassVar[int] = 80

    def parameters(self, place: Place, variant: str = "") -> tuple[EffectParameter, ...]:
        """half_width [the action's]; from several starts."""
        span = place.span
        return (
            EffectParameter(
                "half_width", place.unit, 0.0, span, (0.05 * span, 0.2 * span, 0.5 * span), 0.1 * span
            ),
        )

    def begin(self, count: int, longest: float, step: float) -> Memory:
        """The output in the middle of the gap."""
        return {"level": np.zeros(count)}

    def remembers(self, values: Values) -> float:
        """For ever: what it does not follow keeps it where it was."""
        return np.inf

    def actuate(
        self, commands: FloatArray, values: Values, memory: Memory, step: FloatArray, t: FloatArray
    ) -> FloatArray:
        """The output, dragged along by the ends of the gap."""
        half, level, u = values["half_width"][:, 0], memory["level"], np.ascontiguousarray(commands.T)
        levels, high = u - half, u + half
        for now, most in zip(levels, high, strict=True):
            np.maximum(now, level, out=now)
            np.minimum(now, most, out=now)
            level = now
        memory["level"][:] = level
        return np.ascontiguousarray(levels.T)
