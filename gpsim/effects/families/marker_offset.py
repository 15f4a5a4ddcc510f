"""A marker that sits ahead of and left of the point it stands for: p + R(yaw) (forward, left).

Murray, Li and Sastry (1994), A Mathematical Introduction to Robotic Manipulation, chapter 2 (rigid body
motion).
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar

import numpy as np

from gpsim.channels import FloatArray
from gpsim.effects.effect import FunctionOf, PoseEffect, Values, changed
from gpsim.effects.place import EffectParameter, Place, Plausible
from gpsim.simulators import Memory


class MarkerOffset(PoseEffect):
    """A marker that sits ahead of and left of the point it stands for: p + R(yaw) (forward, left)."""

    family: ClassVar[str] = "marker_offset"
    sentence: ClassVar[str] = (
        "the marker sits {forward} ahead and {left} left of the vehicle's reference point"
    )
    function_of: ClassVar[FunctionOf] = "nothing"
    order: ClassVar[int] = 20
    plausible: ClassVar[Mapping[str, Plausible]] = dict.fromkeys(
        ("forward", "left"), Plausible(0.0, 2.0, "1", "by reason: a marker sits on its vehicle")
    )

    def parameters(self, place: Place, variant: str = "") -> tuple[EffectParameter, ...]:
        """Forward and left [m]."""
        return (
            EffectParameter("forward", "m", -5.0, 5.0, (0.05,), 0.05),
            EffectParameter("left", "m", -5.0, 5.0, (0.02,), 0.05),
        )

    def measure(
        self, measured: FloatArray, columns: tuple[int, ...], values: Values, memory: Memory, step: FloatArray
    ) -> FloatArray:
        """The position of the marker."""
        x, y, yaw = columns
        sin, cos = np.sin(measured[:, yaw]), np.cos(measured[:, yaw])
        forward, left = values["forward"], values["left"]
        moved = changed(measured, x, measured[:, x] + cos * forward - sin * left)
        return changed(moved, y, measured[:, y] + sin * forward + cos * left)
