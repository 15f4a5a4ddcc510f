"""A tilted base: gravity does not pull along the axis that the simulator believes.

Definition: gravity in a base that was turned by roll about its x, then by pitch about its y.
"""

from __future__ import annotations

from typing import ClassVar

from gpsim.effects.effect import FunctionOf, ModelEffect
from gpsim.effects.place import EffectParameter, Place

STEEPEST = 1.5  # rad


class GravityTilt(ModelEffect):
    """Gravity in a base that was turned by roll about its x, then by pitch about its y."""

    family: ClassVar[str] = "gravity_tilt"
    acts_on: ClassVar[str] = "`gravity`"
    sentence: ClassVar[str] = "the base is tilted by a roll of {roll} and a pitch of {pitch}"
    function_of: ClassVar[FunctionOf] = "nothing"
    noun: ClassVar[str] = "a tilt of gravity"

    def parameters(self, place: Place, variant: str = "") -> tuple[EffectParameter, ...]:
        """Roll and pitch [rad]."""
        return (
            EffectParameter("roll", "rad", -STEEPEST, STEEPEST, (0.05,), 0.05),
            EffectParameter("pitch", "rad", -STEEPEST, STEEPEST, (0.05, -0.05), 0.05),
        )
