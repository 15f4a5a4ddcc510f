"""A sensor at its range's end: the reading never leaves [low, high].

Definition: clipping, as an analog-to-digital converter or a full vessel does it. Asked where readings stand at the
lowest or highest value of the recording.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar

import numpy as np

from gpsim.effects.effect import FunctionOf, Law, SensorEffect
from gpsim.effects.place import EffectParameter, Place


def clipped(reading: Any, low: Any, high: Any) -> Any:
    """The reading within its range."""
    return np.minimum(np.maximum(reading, low), high)


class SensorSaturation(SensorEffect):
    """A sensor at its range's end: the reading never leaves [low, high]."""

    family: ClassVar[str] = "sensor_saturation"
    noun: ClassVar[str] = "sensor range"
    function_of: ClassVar[FunctionOf] = "reading"
    order: ClassVar[int] = 60
    variants: ClassVar[tuple[str, ...]] = ("", "lower", "upper")
    takes: ClassVar[Mapping[str, float]] = {"low": -np.inf, "high": np.inf}
    law: ClassVar[Law] = staticmethod(clipped)

    def parameters(self, place: Place, variant: str = "") -> tuple[EffectParameter, ...]:
        """The ends low and high [the channel's], or one of them."""
        kept = {"": ("low", "high"), "lower": ("low",), "upper": ("high",)}[variant]
        return tuple(place.reading_end(name, highest=name == "high") for name in kept)

    def offers(self, place: Place, variant: str) -> bool:
        """The ends at which readings stand."""
        lower, upper = place.stands
        return {"": lower and upper, "lower": lower and not upper, "upper": upper and not lower}[variant]
