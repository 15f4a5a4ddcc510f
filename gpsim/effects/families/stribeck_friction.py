"""Stribeck friction: -(Fc + (Fs - Fc) exp(-(q'/vs)^2)) sgn(q'), holding a body at rest up to Fs.

Stribeck (1902); Armstrong-Helouvry, Dupont and Canudas de Wit (1994), equation (6). At a robot's joint, whose sliding
friction Fc is an effect of its own, `rise` is Fs - Fc.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar

import numpy as np

from gpsim.channels import FloatArray
from gpsim.effects.effect import RISE, ForceEffect, FunctionOf, Values
from gpsim.effects.place import EffectParameter, Place, Plausible


class StribeckFriction(ForceEffect):
    """Stribeck friction: -(Fc + (Fs - Fc) exp(-(q'/vs)^2)) sgn(q')."""

    family: ClassVar[str] = "stribeck_friction"
    sentence: ClassVar[str] = (
        "Stribeck friction on {on} ({static_force} at rest, {force} sliding, "
        "falling over {stribeck_velocity}) was left out"
    )
    function_of: ClassVar[FunctionOf] = "speed"
    noun: ClassVar[str] = "Stribeck friction"
    variants: ClassVar[tuple[str, ...]] = ("", RISE)
    takes: ClassVar[Mapping[str, float]] = {"force": 0.0}  # the rise is beside what slides
    plausible: ClassVar[Mapping[str, Plausible]] = {
        "force": Plausible(0.0, 3.0, "size", "as Coulomb friction"),
        "static_force": Plausible(
            0.0,
            3.0,
            "size",
            "at rest at most twice the sliding force (Armstrong-Helouvry et al. 1994)",
        ),
        "rise": Plausible(0.0, 3.0, "size", "at rest at most twice the sliding force (the same)"),
        "stribeck_velocity": Plausible(
            0.0, 0.5, "speed", "lubricated steel: some mm/s, a small part of the usual speed (the same)"
        ),
    }

    def parameters(self, place: Place, variant: str = "") -> tuple[EffectParameter, ...]:
        """Force (sliding), static_force or rise [the coordinate's], and stribeck_velocity [speed]."""
        span, speed, unit = place.span, place.speed, f"{place.position_unit}/s"
        if variant == RISE:  # what grows at lower speeds still nobody sees: bodies stick there
            return (
                EffectParameter(RISE, place.unit, 0.0, 20 * span, (0.1 * span,), 0.1 * span),
                EffectParameter(
                    "stribeck_velocity",
                    unit,
                    0.05 * speed,
                    speed,
                    (0.1 * speed, 0.25 * speed, 0.5 * speed),
                    0.2 * speed,
                ),
            )
        return (
            EffectParameter("force", place.unit, 0.0, 20 * span, (0.15 * span,), 0.2 * span),
            EffectParameter("static_force", place.unit, 0.0, 20 * span, (0.4 * span,), 0.2 * span),
            EffectParameter(
                "stribeck_velocity", unit, 0.01 * speed, 2 * speed, (0.1 * speed, 0.4 * speed), 0.2 * speed
            ),
        )

    def grip(
        self, position: FloatArray, speed: FloatArray, values: Values, load: FloatArray | None
    ) -> FloatArray | None:
        """The sliding force, which grows to the static one, where that is larger, as the speed falls."""
        fall = np.exp(-((speed / values["stribeck_velocity"]) ** 2))
        if RISE in values:
            return np.asarray(values[RISE] * fall)
        return np.asarray(values["force"] + np.maximum(values["static_force"] - values["force"], 0.0) * fall)
