"""A minimum turning radius: |w| <= |v| / R, as a steering angle that ends makes it.

Dubins (1957), "On curves of minimal length with a constraint on average curvature", American Journal of
Mathematics 79(3); LaValle (2006), Planning Algorithms, section 13.1.2.1 (a simple car).
"""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from gpsim.channels import FloatArray
from gpsim.effects.effect import FunctionOf, Values, VehicleEffect
from gpsim.effects.place import EffectParameter, Place


class MinimumTurningRadius(VehicleEffect):
    """A minimum turning radius: |w| <= |v| / R, as a steering angle that ends makes it."""

    family: ClassVar[str] = "minimum_turning_radius"
    sentence: ClassVar[str] = "the vehicle turns no tighter than a radius of {radius}"
    function_of: ClassVar[FunctionOf] = "twist"
    order: ClassVar[int] = 10

    def parameters(self, place: Place, variant: str = "") -> tuple[EffectParameter, ...]:
        """Radius [m]; from several starts."""
        return (EffectParameter("radius", "m", 1e-3, 20.0, (0.1, 0.2, 0.3, 0.45, 0.7, 1.2, 2.5, 5.0), 0.2),)

    def twist(
        self, v: FloatArray, lateral: FloatArray, w: FloatArray, values: Values
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """w, no larger than the circle of the radius allows."""
        most = np.abs(v) / values["radius"]
        return v, lateral, np.clip(w, -most, most)
