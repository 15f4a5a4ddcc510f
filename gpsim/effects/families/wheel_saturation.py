"""Wheels that turn no faster than their motors can: v - w b/2 and v + w b/2 of a differential drive, clipped.

Definition: the kinematics of two driven wheels a track b apart (Siegwart, Nourbakhsh and Scaramuzza 2011, Introduction
to Autonomous Mobile Robots, 2nd ed., section 3.2), each clipped by itself: in a fast curve the outer wheel is held
back, and the vehicle turns less and drives slower.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar

import numpy as np

from gpsim.effects.effect import FunctionOf, Law, VehicleEffect
from gpsim.effects.place import EffectParameter, Place, Plausible


def held_back(v: Any, lateral: Any, w: Any, limit: Any, track: Any) -> tuple[Any, Any, Any]:
    """The twist of a vehicle whose wheels are as fast as they can be."""
    half = 0.5 * track * w
    left = np.minimum(np.maximum(v - half, -limit), limit)
    right = np.minimum(np.maximum(v + half, -limit), limit)
    return 0.5 * (left + right), lateral, (right - left) / track


class WheelSaturation(VehicleEffect):
    """Wheels that turn no faster than their motors can: v - w b/2 and v + w b/2 within [-limit, limit]."""

    family: ClassVar[str] = "wheel_saturation"
    noun: ClassVar[str] = "wheel saturation"
    sentence: ClassVar[str] = "neither wheel, {track} apart, rolls faster than {limit}"
    function_of: ClassVar[FunctionOf] = "nothing"
    order: ClassVar[int] = 5
    changes: ClassVar[str] = "w"
    takes: ClassVar[Mapping[str, float]] = {"limit": np.inf, "track": 1.0}
    law: ClassVar[Law] = staticmethod(held_back)
    plausible: ClassVar[Mapping[str, Plausible]] = {
        "track": Plausible(
            0.05, 1.5, "1", "differential drives: 0.05 m (e-puck) to 1 m (warehouse robots), data sheets"
        ),
    }

    def parameters(self, place: Place, variant: str = "") -> tuple[EffectParameter, ...]:
        """Limit [m/s] of a wheel and track [m]; a limit out of reach has no gradient."""
        return (
            EffectParameter("limit", "m/s", 0.01, 10.0, (1.0, 0.5, 0.25), 0.1, falls=True),
            EffectParameter("track", "m", 0.05, 1.5, (0.3, 0.3, 0.3), 0.1, none=0.3, paired=True),
        )
