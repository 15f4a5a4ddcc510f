"""A dead zone: commands smaller than the width do nothing, larger ones act in full."""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar

import numpy as np

from gpsim.channels import FloatArray
from gpsim.effects.effect import ActuatorEffect, EffectParameter, Place, Values
from gpsim.simulators.plant import Memory


class ActuatorDeadZone(ActuatorEffect):
    """A dead zone: commands smaller than the width do nothing, larger ones act in full."""

    family: ClassVar[str] = "actuator_dead_zone"
    order: ClassVar[int] = 20

    def parameters(self, place: Place, variant: str = "") -> tuple[EffectParameter, ...]:
        """Width [the action's]; from several starts, as no small width can be seen."""
        span = place.span
        return (
            EffectParameter(
                "width", place.unit, 0.0, span, (0.1 * span, 0.25 * span, 0.5 * span), 0.1 * span
            ),
        )

    def actuate(
        self, command: FloatArray, values: Values, memory: Memory, step: FloatArray, t: FloatArray
    ) -> FloatArray:
        """0 inside |command| < width. The edge is a ramp of 2 % of the width, so that a fit can find it."""
        width = np.maximum(values["width"], 1e-12)
        return np.asarray(command * np.clip((np.abs(command) / width - 1.0) / 0.02 + 0.5, 0.0, 1.0))

    def sentence(self, on: str, values: Mapping[str, str]) -> str:
        """One sentence."""
        return f"{on} does nothing below {values['width']}"
