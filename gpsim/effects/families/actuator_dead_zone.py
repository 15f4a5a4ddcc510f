"""A dead zone: commands smaller than the width do nothing, larger ones act in full.

Khalil (2002), Nonlinear Systems, 3rd ed., section 1.2.7, whose dead zone also takes the width off larger
commands; this one jumps, as a driver does that sets small commands to 0.
"""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from gpsim.channels import FloatArray
from gpsim.effects.effect import ActuatorEffect, FunctionOf, Values
from gpsim.effects.place import EffectParameter, Place
from gpsim.simulators import Memory


class ActuatorDeadZone(ActuatorEffect):
    """A dead zone: commands smaller than the width do nothing, larger ones act in full."""

    family: ClassVar[str] = "actuator_dead_zone"
    sentence: ClassVar[str] = "{on} does nothing below {width}"
    function_of: ClassVar[FunctionOf] = "command"
    order: ClassVar[int] = 20

    def parameters(self, place: Place, variant: str = "") -> tuple[EffectParameter, ...]:
        """Width [the action's]; from several starts, as no small width can be seen."""
        span = place.span
        starts = tuple(share * span for share in (0.04, 0.08, 0.13, 0.2, 0.3, 0.45))
        return (EffectParameter("width", place.unit, 0.0, span, starts, 0.1 * span, step=0.02 * span),)

    def actuate(
        self, commands: FloatArray, values: Values, memory: Memory, step: FloatArray, t: FloatArray
    ) -> FloatArray:
        """0 inside |commands| < width."""
        return np.where(np.abs(commands) < values["width"], 0.0, commands)
