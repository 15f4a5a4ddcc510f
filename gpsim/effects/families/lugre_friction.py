"""LuGre friction: -(k z + d z'), z' = v - k abs(v) z / g(v), g(v) = Fc + (Fs - Fc) exp(-(v/vs)^2).

Canudas de Wit, Olsson, Astrom and Lischinsky (1995), "A new model for control of systems with friction", IEEE
Transactions on Automatic Control 40(3). Bristles of stiffness k bend by z before anything slides; d = sqrt(k m), as in
their example. Without Fs and vs it is Dahl's friction (1968) with that damping. Asked where a scan over positions finds
a force that grows over a way after each reversal.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar

from gpsim.effects.effect import BristleEffect
from gpsim.effects.place import EffectParameter, Place, Plausible

WIDER = 10.0  # times as stiff, or as soft, as the scan says


class LugreFriction(BristleEffect):
    """LuGre friction: -(k z + d z'), z' = v - k abs(v) z / g(v), g(v) = Fc + (Fs - Fc) exp(-(v/vs)^2)."""

    family: ClassVar[str] = "lugre_friction"
    noun: ClassVar[str] = "LuGre friction"
    sentence: ClassVar[str] = (
        "friction on {on} of {force} that yields before it slides ({stiffness}) was left out"
    )
    variants: ClassVar[tuple[str, ...]] = ("", "stribeck")
    takes: ClassVar[Mapping[str, float]] = {
        "force": float("nan"),
        "static_force": 0.0,
        "stribeck_velocity": 1.0,
        "stiffness": float("nan"),
    }
    plausible: ClassVar[Mapping[str, Plausible]] = {
        "force": Plausible(0.0, 3.0, "size", "as Coulomb friction"),
        "static_force": Plausible(0.0, 3.0, "size", "as Stribeck friction"),
        "stribeck_velocity": Plausible(0.0, 0.5, "speed", "as Stribeck friction"),
    }

    def parameters(self, place: Place, variant: str = "") -> tuple[EffectParameter, ...]:
        """Force (sliding) and stiffness of the bristles; static_force and stribeck_velocity of the whole law."""
        span, speed = place.span, place.speed
        unit, found = f"{place.unit}/{place.position_unit}", place.yields or (0.2 * span, 0.1 * place.reach)
        force, stiff = found[0], found[0] / found[1]
        sliding = EffectParameter("force", place.unit, 0.0, 20 * span, (force,), 0.2 * span)
        bristles = EffectParameter(
            "stiffness", unit, stiff / WIDER, stiff * WIDER, (stiff,), 0.3 * stiff, place=True
        )
        if not variant:
            return sliding, bristles
        still = EffectParameter("static_force", place.unit, 0.0, 20 * span, (1.5 * force,), 0.2 * span)
        slow = EffectParameter(
            "stribeck_velocity",
            f"{place.position_unit}/s",
            0.01 * speed,
            2 * speed,
            (0.2 * speed,),
            0.2 * speed,
        )
        return sliding, still, slow, bristles

    def offers(self, place: Place, variant: str) -> bool:
        """Where a force yields."""
        return bool(place.yields)
