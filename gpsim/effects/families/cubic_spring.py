"""A cubic spring: -k x - k3 x^3 for x = q - q0; it hardens where k3 > 0 and softens where k3 < 0.

Duffing (1918), Erzwungene Schwingungen bei veränderlicher Eigenfrequenz.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar

import numpy as np

from gpsim.effects.effect import ForceEffect, FunctionOf, Law
from gpsim.effects.place import EffectParameter, Place, Plausible


def restoring(q: Any, speed: Any, stiffness: Any, cubic: Any, rest_position: Any) -> Any:
    """The restoring force."""
    x = q - rest_position
    return -(stiffness + cubic * x * x) * x


class CubicSpring(ForceEffect):
    """A cubic spring: -k x - k3 x^3 for x = q - q0."""

    family: ClassVar[str] = "cubic_spring"
    function_of: ClassVar[FunctionOf] = "position"
    sentence: ClassVar[str] = (
        "a spring on {on} of {stiffness} and {cubic}, which grows with the cube, resting at {rest_position} "
        "was left out"
    )
    takes: ClassVar[Mapping[str, float]] = {"stiffness": np.nan, "cubic": np.nan, "rest_position": np.nan}
    law: ClassVar[Law] = staticmethod(restoring)
    plausible: ClassVar[Mapping[str, Plausible]] = {
        "stiffness": Plausible(0.0, 10.0, "size / reach", "as a spring"),
        "cubic": Plausible(0.0, 10.0, "size / reach^3", "as a spring, at the end of its reach"),
    }

    def parameters(self, place: Place, variant: str = "") -> tuple[EffectParameter, ...]:
        """Stiffness [force per displacement], cubic [force per cubed displacement] and rest_position."""
        typical, length = place.span / place.reach, place.position_unit
        curved = typical / place.reach**2
        return (
            EffectParameter(
                "stiffness",
                f"{place.unit}/{length}",
                -100 * typical,
                100 * typical,
                (0.1 * typical,),
                0.3 * typical,
            ),
            EffectParameter(
                "cubic",
                f"{place.unit}/{length}^3",
                -100 * curved,
                100 * curved,
                (0.3 * curved,),
                0.3 * curved,
            ),
            place.rest_position,
        )
