"""A payload: a point mass carried by a body, which nobody told the simulator of.

Steiner's theorem (1840) gives mass, centre of mass and moments of inertia of both together.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar

from gpsim.effects.effect import FunctionOf, ModelEffect
from gpsim.effects.place import EffectParameter, Place, Plausible


class Payload(ModelEffect):
    """A point mass at x, y, z of the frame of a body that carries it."""

    family: ClassVar[str] = "payload"
    acts_on: ClassVar[str] = "a body"
    sentence: ClassVar[str] = "a payload of {mass} on {on}, at ({x}, {y}, {z}) in its frame, was left out"
    function_of: ClassVar[FunctionOf] = "nothing"
    plausible: ClassVar[Mapping[str, Plausible]] = {
        "mass": Plausible(
            0.0,
            5.0,
            "size",
            "what arms lift by their data sheets: five times of what their last body weighs, or half of all that moves",
        ),
    }

    def parameters(self, place: Place, variant: str = "") -> tuple[EffectParameter, ...]:
        """Mass [kg], and where it sits in the body's frame: x, y, z [m]."""
        span, reach = place.span, place.reach
        centre = place.centre or (0.0, 0.0, 0.0)
        return (
            EffectParameter("mass", "kg", 0.0, 20 * span, (0.2 * span,), 0.2 * span),
            *(
                EffectParameter(
                    axis, "m", at - 2 * reach, at + 2 * reach, (at,), 0.3 * reach, none=at, place=True
                )
                for axis, at in zip("xyz", centre, strict=True)
            ),
        )
