"""Cogging: A sin(2 pi q / P + phase), the ripple of magnets and teeth that a body passes.

Jahns and Soong (1996), "Pulsating torque minimization techniques for permanent magnet AC motor drives - a review", IEEE
Transactions on Industrial Electronics 43(2).
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar

import numpy as np

from gpsim.effects.effect import ForceEffect, FunctionOf, Law
from gpsim.effects.place import EffectParameter, Place, Plausible

TURN = 2.0 * np.pi


def ripple(q: Any, speed: Any, amplitude: Any, period: Any, phase: Any) -> Any:
    """The ripple."""
    return amplitude * np.sin(6.283185307179586 * q / period + phase)


class CoggingForce(ForceEffect):
    """Cogging: A sin(2 pi q / P + phase)."""

    family: ClassVar[str] = "cogging_force"
    function_of: ClassVar[FunctionOf] = "position"
    noun: ClassVar[str] = "cogging"
    sentence: ClassVar[str] = (
        "a ripple of {amplitude} on {on}, once every {period} of the way (cogging), was left out"
    )
    takes: ClassVar[Mapping[str, float]] = {"amplitude": np.nan, "period": np.nan, "phase": np.nan}
    law: ClassVar[Law] = staticmethod(ripple)
    plausible: ClassVar[Mapping[str, Plausible]] = {
        "amplitude": Plausible(
            0.0, 3.0, "size", "by reason: a ripple beyond the drive holds the body in one tooth"
        ),
    }

    def offers(self, place: Place, variant: str) -> bool:
        """Where a scan found a ripple, or nobody has scanned."""
        return variant == "" and (bool(place.ripples) or place.visited is None)

    def parameters(self, place: Place, variant: str = "") -> tuple[EffectParameter, ...]:
        """Amplitude [the coordinate's force], period [position] and phase [rad], from the ripples that a scan found."""
        length = place.position_unit
        found = place.ripples or ((place.reach, 0.0),)
        periods, phases = zip(*found, strict=True)
        return (
            EffectParameter(
                "amplitude", place.unit, 0.0, 20 * place.span, (0.3 * place.span,), 0.2 * place.span
            ),
            # Far beyond the longest it would not be seen to repeat.
            EffectParameter(
                "period", length, 0.2 * min(periods), 1.1 * max(periods), periods, 0.02 * min(periods)
            ),
            EffectParameter("phase", "rad", -2 * TURN, 2 * TURN, phases, 0.3, place=True, paired=True),
        )
