"""A spring: -k (q - q0). Hooke's law (1678)."""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar

from gpsim.channels import FloatArray
from gpsim.effects.effect import ForceEffect, FunctionOf, Values
from gpsim.effects.place import EffectParameter, Place, Plausible


class Spring(ForceEffect):
    """A spring: -k (q - q0). Hooke's law (1678)."""

    family: ClassVar[str] = "spring"
    sentence: ClassVar[str] = "a spring on {on} of {stiffness} resting at {rest_position} was left out"
    function_of: ClassVar[FunctionOf] = "position"
    plausible: ClassVar[Mapping[str, Plausible]] = {
        "stiffness": Plausible(
            0.0,
            10.0,
            "size / reach",
            "by reason: a spring ten times as stiff as what drives it lets nothing move",
        ),
    }

    def parameters(self, place: Place, variant: str = "") -> tuple[EffectParameter, ...]:
        """Stiffness [force per displacement] and rest_position; fitted where it rests within reach."""
        typical = place.span / place.reach
        length = place.position_unit
        return (
            EffectParameter(
                "stiffness", f"{place.unit}/{length}", 0.0, 100 * typical, (0.3 * typical,), 0.3 * typical
            ),
            place.rest_position,
        )

    def force(self, position: FloatArray, speed: FloatArray, values: Values) -> FloatArray | None:
        """-stiffness * (position - rest_position)."""
        return -values["stiffness"] * (position - values["rest_position"])
