"""A frame turned against the vehicle's: yaw + psi.

Murray, Li and Sastry (1994), A Mathematical Introduction to Robotic Manipulation, chapter 2 (rigid body
motion).
"""

from __future__ import annotations

from typing import ClassVar

from gpsim.channels import FloatArray
from gpsim.effects.effect import FunctionOf, PoseEffect, Values, changed
from gpsim.effects.place import EffectParameter, Place
from gpsim.simulators import Memory


class FrameRotation(PoseEffect):
    """A frame turned against the vehicle's: yaw + psi."""

    family: ClassVar[str] = "frame_rotation"
    sentence: ClassVar[str] = "the measured yaw is turned by {angle}"
    function_of: ClassVar[FunctionOf] = "nothing"
    order: ClassVar[int] = 30

    def parameters(self, place: Place, variant: str = "") -> tuple[EffectParameter, ...]:
        """Angle [rad]."""
        return (EffectParameter("angle", "rad", -3.2, 3.2, (0.05,), 0.05),)

    def measure(
        self, measured: FloatArray, columns: tuple[int, ...], values: Values, memory: Memory, step: FloatArray
    ) -> FloatArray:
        """The yaw that is read."""
        yaw = columns[2]
        return changed(measured, yaw, measured[:, yaw] + values["angle"])
