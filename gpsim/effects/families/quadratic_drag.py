"""Quadratic drag: -c |q'| q'. Rayleigh's drag of a blunt body in a fluid (Batchelor 1967, section 5.11)."""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar

import numpy as np

from gpsim.channels import FloatArray
from gpsim.effects.effect import ForceEffect, FunctionOf, Values
from gpsim.effects.place import EffectParameter, Place, Plausible


class QuadraticDrag(ForceEffect):
    """Quadratic drag: -c |q'| q'. Rayleigh's drag of a blunt body in a fluid (Batchelor 1967, section 5.11)."""

    family: ClassVar[str] = "quadratic_drag"
    sentence: ClassVar[str] = "quadratic drag on {on} of {drag} was left out"
    function_of: ClassVar[FunctionOf] = "speed"
    plausible: ClassVar[Mapping[str, Plausible]] = {
        "drag": Plausible(
            0.0,
            3.0,
            "size / speed^2",
            "drag beyond the driving force would stop what it brakes (Batchelor 1967, section 5.11)",
        ),
    }

    def parameters(self, place: Place, variant: str = "") -> tuple[EffectParameter, ...]:
        """Drag [force per squared speed]."""
        typical = place.span / place.speed**2
        unit = f"{place.unit} s^2/{place.position_unit}^2"
        return (EffectParameter("drag", unit, 0.0, 100 * typical, (0.2 * typical,), 0.2 * typical),)

    def force(self, position: FloatArray, speed: FloatArray, values: Values) -> FloatArray | None:
        """-drag * |speed| * speed."""
        return -values["drag"] * np.abs(speed) * speed
