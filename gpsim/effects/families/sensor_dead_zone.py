"""A sensor's dead zone: readings smaller than the width are 0, larger ones are right.

Definition: a threshold, as of a tachometer that needs a least speed. Asked where a recording has readings of exactly 0
and none between 0 and a least one.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar

import numpy as np

from gpsim.effects.effect import FunctionOf, Law, SensorEffect
from gpsim.effects.place import EffectParameter, Place

FURTHEST = 2.3  # times the distance of readings, within which nine of ten times the least is from the edge
LIKELY = 0.7  # the same, within which it is half of the times


def silent(reading: Any, width: Any) -> Any:
    """The reading, 0 where it is small."""
    return np.where(np.abs(reading) < width, 0.0, reading)


class SensorDeadZone(SensorEffect):
    """A sensor's dead zone: readings smaller than the width are 0, larger ones are right."""

    family: ClassVar[str] = "sensor_dead_zone"
    sentence: ClassVar[str] = "the sensor of {on} reads 0 below {width}"
    function_of: ClassVar[FunctionOf] = "reading"
    order: ClassVar[int] = 50
    takes: ClassVar[Mapping[str, float]] = {"width": 0.0}
    law: ClassVar[Law] = staticmethod(silent)

    def parameters(self, place: Place, variant: str = "") -> tuple[EffectParameter, ...]:
        """Width [the channel's]: a little less than the smallest reading that is not 0, noise or not.

        Where readings come at random the next one is exponentially far. A fit of simulations knows less: it does not
        know where in the zone a window begins.
        """
        least, apart = place.silent or (0.1 * place.span, 0.01 * place.span)
        low, likely = (max(least - times * apart, 0.0) for times in (FURTHEST, LIKELY))
        known = low, least
        return (EffectParameter("width", place.unit, *known, (likely,), apart, step=apart, exact=known),)

    def offers(self, place: Place, variant: str) -> bool:
        """Where small readings are missing."""
        return variant == "" and bool(place.silent)
