"""A torque-speed line: abs(u) <= S (1 - q'/v0) while the drive pushes with the motion, at most S against it.

Definition: the line of a DC motor at full voltage, S at standstill and 0 at the no-load speed v0, with the current
limited to that of standstill (Hughes 2013, Electric Motors and Drives, 4th ed., chapter 3).
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar

import numpy as np

from gpsim.effects.effect import DriveEffect, Law
from gpsim.effects.place import EffectParameter, Place, Plausible


def given(u: Any, speed: Any, stall: Any, no_load_speed: Any) -> Any:
    """What the motor gives of a command at a speed."""
    ahead = np.minimum(np.maximum(1.0 - speed / no_load_speed, 0.0), 1.0)
    back = np.minimum(np.maximum(1.0 + speed / no_load_speed, 0.0), 1.0)
    return np.minimum(np.maximum(u, -stall * back), stall * ahead)


class TorqueSpeedLimit(DriveEffect):
    """A torque-speed line: abs(u) <= S (1 - q'/v0) while the drive pushes with the motion, at most S against it."""

    family: ClassVar[str] = "torque_speed_limit"
    noun: ClassVar[str] = "torque-speed line"
    sentence: ClassVar[str] = (
        "{on} gives {stall} at standstill, and less the faster it turns: none at {no_load_speed}"
    )
    takes: ClassVar[Mapping[str, float]] = {"stall": np.nan, "no_load_speed": np.nan}
    law: ClassVar[Law] = staticmethod(given)
    plausible: ClassVar[Mapping[str, Plausible]] = {
        "stall": Plausible(0.1, np.inf, "size", "as a saturation"),
        "no_load_speed": Plausible(
            0.5, np.inf, "speed", "by reason: nobody drives a motor at twice its no-load speed"
        ),
    }

    def parameters(self, place: Place, variant: str = "") -> tuple[EffectParameter, ...]:
        """Stall [the action's] and no_load_speed [the driven coordinate's]; a line out of reach has no gradient."""
        span, speed = place.span, place.speed
        return (
            EffectParameter(
                "stall", place.unit, 0.0, 20 * span, (1.5 * span, 0.8 * span), 0.2 * span, falls=True
            ),
            EffectParameter(
                "no_load_speed",
                f"{place.position_unit}/s",
                0.2 * speed,
                50 * speed,
                (1.1 * speed, 2.0 * speed),
                0.3 * speed,
                falls=True,
            ),
        )
