"""A steering bias: w + kappa v, as a wheel that points aside makes it.

Definition: a constant added to the curvature w / v.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar

from gpsim.channels import FloatArray
from gpsim.effects.effect import FunctionOf, Values, VehicleEffect
from gpsim.effects.place import EffectParameter, Place, Plausible


class SteeringBias(VehicleEffect):
    """A steering bias: w + kappa v, as a wheel that points aside makes it."""

    family: ClassVar[str] = "steering_bias"
    sentence: ClassVar[str] = "the steering is off by a curvature of {curvature}"
    function_of: ClassVar[FunctionOf] = "twist"
    order: ClassVar[int] = 30
    plausible: ClassVar[Mapping[str, Plausible]] = {
        "curvature": Plausible(
            0.0, 2.0, "1", "by reason: small robots turn with 2/m at the most (a Limo: 0.46 m)"
        ),
    }

    def parameters(self, place: Place, variant: str = "") -> tuple[EffectParameter, ...]:
        """Curvature [1/m]."""
        return (EffectParameter("curvature", "1/m", -20.0, 20.0, (0.1,), 0.1),)

    def twist(
        self, v: FloatArray, lateral: FloatArray, w: FloatArray, values: Values
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Going straight becomes a circle."""
        return v, lateral, w + values["curvature"] * v
