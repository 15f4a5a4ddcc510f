"""Cornering drag: v / (1 + k (v w)^2), the speed that a vehicle loses in a curve; its way stays the same.

A tyre that carries the lateral force m v w at a slip angle holds the vehicle back by that force times the angle; with
a linear tyre both grow with the lateral acceleration v w (Milliken and Milliken 1995, Race Car Vehicle Dynamics,
chapter 2, induced drag; Gillespie 1992, chapter 6). What a motor then loses of its speed is taken as proportional.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar

from gpsim.effects.effect import FunctionOf, Law, VehicleEffect
from gpsim.effects.place import EffectParameter, Place, Plausible


def slowed(v: Any, lateral: Any, w: Any, drag: Any) -> tuple[Any, Any, Any]:
    """The twist of a vehicle that its tyres hold back."""
    left = 1.0 / (1.0 + drag * (v * w) * (v * w))
    return v * left, lateral, w * left


class CorneringDrag(VehicleEffect):
    """Cornering drag: v / (1 + k (v w)^2), the speed that a vehicle loses in a curve."""

    family: ClassVar[str] = "cornering_drag"
    sentence: ClassVar[str] = (
        "the vehicle slows down in curves: by {drag} times its lateral acceleration squared"
    )
    function_of: ClassVar[FunctionOf] = "twist"
    order: ClassVar[int] = 30
    changes: ClassVar[str] = "v"
    takes: ClassVar[Mapping[str, float]] = {"drag": 0.0}
    law: ClassVar[Law] = staticmethod(slowed)
    plausible: ClassVar[Mapping[str, Plausible]] = {
        "drag": Plausible(0.0, 1.0, "1", "by reason: half of the speed is lost at 1 m/s^2 of model cars"),
    }

    def parameters(self, place: Place, variant: str = "") -> tuple[EffectParameter, ...]:
        """Drag [s^4/m^2]."""
        return (EffectParameter("drag", "s^4/m^2", 0.0, 20.0, (0.1,), 0.1),)
