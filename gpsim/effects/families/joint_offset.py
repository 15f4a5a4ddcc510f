"""A joint's encoder whose zero is off: y + o, and whoever steers by it steers to another place.

Definition: a sum; a position servo on the joint compares its command with what the encoder says.
"""

from __future__ import annotations

from typing import ClassVar

from gpsim.channels import FloatArray
from gpsim.effects.effect import FunctionOf, SensorEffect, Values, changed
from gpsim.effects.place import EffectParameter, Place
from gpsim.simulators import Memory, Simulator


class JointOffset(SensorEffect):
    """An encoder's zero: y + o, for the log and for the joint's own servo."""

    family: ClassVar[str] = "joint_offset"
    acts_on: ClassVar[str] = "a joint"
    sentence: ClassVar[str] = "the zero of {on} is off by {offset}"
    function_of: ClassVar[FunctionOf] = "reading"
    noun: ClassVar[str] = "joint offset"

    def places(self, simulator: Simulator) -> tuple[str, ...]:
        """Joints of a model that has such."""
        return tuple(simulator.model_places.get(self.family, ()))

    def parameters(self, place: Place, variant: str = "") -> tuple[EffectParameter, ...]:
        """Offset [the joint's]."""
        span = place.span
        return (EffectParameter("offset", place.unit, -5 * span, 5 * span, (0.1 * span,), 0.1 * span),)

    def measure(
        self, measured: FloatArray, columns: tuple[int, ...], values: Values, memory: Memory, step: FloatArray
    ) -> FloatArray:
        """An offset on one channel."""
        (column,) = columns
        return changed(measured, column, measured[:, column] + values["offset"])
