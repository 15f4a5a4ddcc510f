"""A parameter of the simulator that differs from what was believed: p = ratio * p_believed.

Definition: a ratio; of what may be 0, as a place may, an `offset`: p = p_believed + offset.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar

import numpy as np

from gpsim.channels import FloatArray
from gpsim.effects.effect import FunctionOf, ParameterEffect, Values
from gpsim.effects.place import EffectParameter, Place, Plausible


class ParameterOffset(ParameterEffect):
    """p = ratio * p_believed."""

    family: ClassVar[str] = "parameter_offset"
    sentence: ClassVar[str] = "{on} is {ratio} times what the simulator believes"
    function_of: ClassVar[FunctionOf] = "nothing"
    plausible: ClassVar[Mapping[str, Plausible]] = {
        "ratio": Plausible(
            0.25,
            4.0,
            "1",
            "masses are off by tens of per cent (Armstrong, Khatib and Burdick 1986), an uncounted drive doubles them",
        ),
    }

    def parameters(self, place: Place, variant: str = "") -> tuple[EffectParameter, ...]:
        """Ratio [1]; of what may be 0, as a place may, the offset [its own]."""
        if place.additive:
            span, (low, high) = place.span, place.bounds
            return (EffectParameter("offset", place.unit, low, high, (0.1 * span,), 0.1 * span),)
        low, high = max(0.05, place.bounds[0]), min(20.0, place.bounds[1])
        return (
            EffectParameter("ratio", "1", low, high, (1.1 if high >= 1.1 else max(low, 0.9),), 0.2, none=1.0),
        )

    def corrected(self, believed: FloatArray, values: Values) -> FloatArray:
        """The believed value times the ratio, or plus the offset."""
        if "offset" in values:
            return np.asarray(believed + values["offset"])
        return np.asarray(believed * values["ratio"])
