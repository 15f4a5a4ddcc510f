"""Lateral slip: v_lateral = -s v w, sliding outwards in a curve in proportion to its lateral acceleration.

Definition: one number for every speed. A linear tyre (Rajamani 2012, Vehicle Dynamics and Control, 2nd ed.,
section 2.3) makes the slip angle, not the sideways speed, proportional to the lateral acceleration v w.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar

from gpsim.channels import FloatArray
from gpsim.effects.effect import FunctionOf, Values, VehicleEffect
from gpsim.effects.place import EffectParameter, Place, Plausible


class LateralSlip(VehicleEffect):
    """Lateral slip: v_lateral = -s v w, sliding outwards in a curve in proportion to its lateral acceleration."""

    family: ClassVar[str] = "lateral_slip"
    sentence: ClassVar[str] = "the vehicle slips sideways by {slip} times its lateral acceleration"
    function_of: ClassVar[FunctionOf] = "twist"
    order: ClassVar[int] = 40
    changes: ClassVar[str] = "v_lateral"
    plausible: ClassVar[Mapping[str, Plausible]] = {
        "slip": Plausible(
            0.0, 1.0, "1", "m l_f / (L C) v at low slip: cars 0.01 to 0.1 s (Gillespie 1992, chapter 6)"
        ),
    }

    def parameters(self, place: Place, variant: str = "") -> tuple[EffectParameter, ...]:
        """Slip [s]."""
        return (EffectParameter("slip", "s", -2.0, 5.0, (0.05,), 0.05),)

    def twist(
        self, v: FloatArray, lateral: FloatArray, w: FloatArray, values: Values
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """A sideways speed proportional to v w."""
        return v, lateral - values["slip"] * v * w, w
