"""Understeer: w / (1 + K v^2). Gillespie (1992), Fundamentals of Vehicle Dynamics, chapter 6."""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar

import numpy as np

from gpsim.channels import FloatArray
from gpsim.effects.effect import FunctionOf, Values, VehicleEffect
from gpsim.effects.place import EffectParameter, Place, Plausible


class Understeer(VehicleEffect):
    """Understeer: w / (1 + K v^2). Gillespie (1992), Fundamentals of Vehicle Dynamics, chapter 6."""

    family: ClassVar[str] = "understeer"
    sentence: ClassVar[str] = "the vehicle understeers with a gradient of {gradient}"
    function_of: ClassVar[FunctionOf] = "twist"
    order: ClassVar[int] = 20
    plausible: ClassVar[Mapping[str, Plausible]] = {
        "gradient": Plausible(
            0.0,
            5.0,
            "1",
            "1/V^2, V the characteristic speed: of cars 20 to 30 m/s (Gillespie 1992), of models some 0.5 m/s",
        ),
    }

    def parameters(self, place: Place, variant: str = "") -> tuple[EffectParameter, ...]:
        """Gradient [s^2/m^2]."""
        return (EffectParameter("gradient", "s^2/m^2", -0.5, 50.0, (0.1,), 0.2),)

    def twist(
        self, v: FloatArray, lateral: FloatArray, w: FloatArray, values: Values
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """The yaw rate falls with the speed squared."""
        return v, lateral, w / np.maximum(1.0 + values["gradient"] * v**2, 0.05)
