"""LuGre friction: -(k z + d z'), z' = v - k abs(v) z / g(v), g(v) = Fc + (Fs - Fc) exp(-(v/vs)^2).

Canudas de Wit, Olsson, Astrom and Lischinsky (1995), "A new model for control of systems with friction", IEEE
Transactions on Automatic Control 40(3). Bristles of stiffness k bend by z before anything slides; d = sqrt(k m), as in
their example. Without Fs and vs it is Dahl's friction (1968) with that damping.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar

from gpsim.effects.effect import BristleEffect
from gpsim.effects.place import EffectParameter, Place, Plausible

WAYS = (0.003, 0.01, 0.03)  # of the way that was visited: by how much bristles bend, where a fit starts
WIDER = 10.0  # times as stiff as the stiffest start, or as soft as the softest


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

    asked: ClassVar[bool] = False  # a start in every way it may bend is dear, and it bends to other friction
    of_robots: ClassVar[bool] = True

    def parameters(self, place: Place, variant: str = "") -> tuple[EffectParameter, ...]:
        """Force (sliding) and stiffness of the bristles; static_force and stribeck_velocity of the whole law."""
        span, speed = place.span, place.speed
        low, high = place.visited or (place.middle - place.reach, place.middle + place.reach)
        force, whole = 0.2 * span, max(high - low, 1e-9)
        stiff = tuple(force / (way * whole) for way in WAYS)
        sliding = EffectParameter("force", place.unit, 0.0, 20 * span, (force,), 0.2 * span)
        bristles = EffectParameter(
            "stiffness",
            f"{place.unit}/{place.position_unit}",
            stiff[-1] / WIDER,
            stiff[0] * WIDER,
            stiff,
            0.3 * stiff[1],
            place=True,
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
        """Both variants."""
        return True
