"""Viscous friction: -b q'. Stokes' law; Armstrong-Helouvry et al. (1994), section 2."""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar

from gpsim.channels import FloatArray
from gpsim.effects.effect import ForceEffect, FunctionOf, Values
from gpsim.effects.place import EffectParameter, Place, Plausible


class ViscousFriction(ForceEffect):
    """Viscous friction: -b q'. Stokes' law; Armstrong-Helouvry et al. (1994), section 2."""

    family: ClassVar[str] = "viscous_friction"
    sentence: ClassVar[str] = "viscous friction on {on} with damping {damping} was left out"
    function_of: ClassVar[FunctionOf] = "speed"
    plausible: ClassVar[Mapping[str, Plausible]] = {
        "damping": Plausible(
            0.0,
            3.0,
            "size / speed",
            "friction beyond the drive lets nothing move (EMPS axis: 203 N s/m; Janot, Gautier and Brunot 2019)",
        ),
    }

    def parameters(self, place: Place, variant: str = "") -> tuple[EffectParameter, ...]:
        """Damping [force per speed]."""
        typical = place.span / place.speed
        unit = f"{place.unit} s/{place.position_unit}"
        return (
            EffectParameter("damping", unit, -place.damping, 100 * typical, (0.2 * typical,), 0.2 * typical),
        )

    def force(self, position: FloatArray, speed: FloatArray, values: Values) -> FloatArray | None:
        """-damping * speed."""
        return -values["damping"] * speed
