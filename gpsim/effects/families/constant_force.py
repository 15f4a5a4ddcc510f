"""A constant force: F0, as a tilted track or a steady wind makes it.

Definition: m g sin(angle) of a tilt, for one.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar

from gpsim.channels import FloatArray
from gpsim.effects.effect import ForceEffect, FunctionOf, Values
from gpsim.effects.place import EffectParameter, Place, Plausible


class ConstantForce(ForceEffect):
    """A constant force: F0, as a tilted track or a steady wind makes it."""

    family: ClassVar[str] = "constant_force"
    sentence: ClassVar[str] = "a constant force of {force} on {on} was left out"
    function_of: ClassVar[FunctionOf] = "position"
    plausible: ClassVar[Mapping[str, Plausible]] = {
        "force": Plausible(
            0.0, 3.0, "size", "by reason: what pulls harder than the drive carries everything off"
        ),
    }

    def parameters(self, place: Place, variant: str = "") -> tuple[EffectParameter, ...]:
        """Force [the coordinate's]."""
        span = place.span
        return (EffectParameter("force", place.unit, -20 * span, 20 * span, (0.1 * span,), 0.1 * span),)

    def force(self, position: FloatArray, speed: FloatArray, values: Values) -> FloatArray | None:
        """The same everywhere."""
        return values["force"] + 0.0 * speed
