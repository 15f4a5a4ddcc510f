"""Coulomb friction: -Fc sgn(q'), holding a body at rest up to Fc; Fc = mu N where the normal force N is known.

Coulomb (1785); Armstrong-Helouvry, Dupont and Canudas de Wit (1994), Automatica 30(7), section 2.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar

import numpy as np

from gpsim.channels import FloatArray
from gpsim.effects.effect import ForceEffect, FunctionOf, Values
from gpsim.effects.place import EffectParameter, Place, Plausible


class CoulombFriction(ForceEffect):
    """Coulomb friction: -Fc sgn(q'), holding a body at rest up to Fc; Fc = mu N where the normal force N is known."""

    family: ClassVar[str] = "coulomb_friction"
    function_of: ClassVar[FunctionOf] = "speed"
    noun: ClassVar[str] = "Coulomb friction"
    variants: ClassVar[tuple[str, ...]] = ("", "coefficient")
    plausible: ClassVar[Mapping[str, Plausible]] = {
        "force": Plausible(
            0.0,
            3.0,
            "size",
            "what moves is driven by more than its friction (EMPS axis: 20 N; Janot, Gautier and Brunot 2019)",
        ),
        "coefficient": Plausible(
            0.0,
            1.5,
            "1",
            "dry metals 0.4 to 0.8, rubber about 1 (Popov 2010, Contact Mechanics and Friction)",
        ),
    }

    def parameters(self, place: Place, variant: str = "") -> tuple[EffectParameter, ...]:
        """Force [the coordinate's], or the dimensionless coefficient of the normal force."""
        if variant == "coefficient":
            return (EffectParameter("coefficient", "1", 0.0, 5.0, (0.1, 0.5), 0.1),)
        return (
            EffectParameter(
                "force", place.unit, -place.friction, 20 * place.span, (0.2 * place.span,), 0.2 * place.span
            ),
        )

    def offers(self, place: Place, variant: str) -> bool:
        """The coefficient where the simulator knows the normal force."""
        return variant == "" or place.loaded

    def grip(
        self, position: FloatArray, speed: FloatArray, values: Values, load: FloatArray | None
    ) -> FloatArray | None:
        """The sliding force, which is also the most it can hold."""
        if "coefficient" in values:
            return None if load is None else values["coefficient"] * np.maximum(load, 0.0)
        return values["force"] + 0.0 * speed

    def weighs(self, values: Values) -> bool:
        """A coefficient does."""
        return "coefficient" in values
