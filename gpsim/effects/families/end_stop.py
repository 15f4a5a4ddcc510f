"""End stops: a spring and a damper beyond an edge, -K d - c d' for a depth d > 0, and they never pull.

Definition: Kelvin's and Voigt's contact (Hunt and Crossley 1975, Coefficient of restitution interpreted as damping in
vibroimpact, Journal of Applied Mechanics 42(2), section 1, whose own law has no jump at the edge).
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar

import numpy as np

from gpsim.effects.effect import ForceEffect, FunctionOf, Law
from gpsim.effects.place import EffectParameter, Place

INSIDE = 0.03  # of the way that was visited: where an edge is first looked for that no scan has found


def pushed_back(q: Any, speed: Any, low: Any, high: Any, stiffness: Any, damping: Any) -> Any:
    """The push of either stop, back."""
    above, below = np.maximum(q - high, 0.0), np.maximum(low - q, 0.0)
    down = np.sign(above) * np.maximum(stiffness * above + damping * speed, 0.0)
    up = np.sign(below) * np.maximum(stiffness * below - damping * speed, 0.0)
    return up - down


class EndStop(ForceEffect):
    """End stops: a spring and a damper beyond an edge, -K d - c d' for a depth d > 0, and they never pull."""

    family: ClassVar[str] = "end_stop"
    function_of: ClassVar[FunctionOf] = "nothing"
    variants: ClassVar[tuple[str, ...]] = ("", "lower", "upper")
    gated: ClassVar[bool] = False
    takes: ClassVar[Mapping[str, float]] = {
        "low": -np.inf,
        "high": np.inf,
        "stiffness": np.nan,
        "damping": np.nan,
    }
    law: ClassVar[Law] = staticmethod(pushed_back)

    def parameters(self, place: Place, variant: str = "") -> tuple[EffectParameter, ...]:
        """The edges low and high [position], or one of them; stiffness and damping of what stands there."""
        length = place.position_unit
        lowest, highest = place.visited or (place.middle - place.reach, place.middle + place.reach)
        way = max(highest - lowest, 1e-9)
        typical = place.span / way
        usual = lowest + INSIDE * way, highest - INSIDE * way
        low, high = (
            at if edge is None or np.isnan(edge) else edge
            for edge, at in zip(place.edges, usual, strict=True)
        )
        declared = {
            "low": EffectParameter(
                "low", length, lowest - 0.1 * way, highest, (low,), 0.02 * way, place=True
            ),
            "high": EffectParameter(
                "high", length, lowest, highest + 0.1 * way, (high,), 0.02 * way, place=True
            ),
        }
        kept = {"": ("low", "high"), "lower": ("low",), "upper": ("high",)}[variant]
        damping = place.span / place.speed
        return (
            *(declared[name] for name in kept),
            EffectParameter(
                "stiffness",
                f"{place.unit}/{length}",
                0.0,
                1e5 * typical,
                (10 * typical, 100 * typical),
                10 * typical,
            ),
            EffectParameter(
                "damping", f"{place.unit} s/{length}", 0.0, 1e3 * damping, (0.3 * damping,), 0.3 * damping
            ),
        )

    def offers(self, place: Place, variant: str) -> bool:
        """Those at whose edge something pushed back."""
        lower, upper = (edge is not None for edge in place.edges)
        return {"": lower and upper, "lower": lower and not upper, "upper": upper and not lower}[variant]
