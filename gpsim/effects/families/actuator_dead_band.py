"""A dead band: u - w sgn(u) outside abs(u) < w, 0 inside: what larger commands lose, too, as play in a gear takes it.

Khalil (2002), Nonlinear Systems, 3rd ed., section 1.2.7 (dead zone).
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar

import numpy as np

from gpsim.effects.effect import ActuatorEffect, FunctionOf, Law
from gpsim.effects.place import EffectParameter, Place


def beyond_the_band(u: Any, width: Any) -> Any:
    """What is left of a command."""
    return np.sign(u) * np.maximum(np.abs(u) - width, 0.0)


class ActuatorDeadBand(ActuatorEffect):
    """A dead band: u - w sgn(u) outside abs(u) < w, 0 inside."""

    family: ClassVar[str] = "actuator_dead_band"
    function_of: ClassVar[FunctionOf] = "command"
    sentence: ClassVar[str] = "{on} acts with {width} less than its commanded size, and below that not at all"
    order: ClassVar[int] = 21
    takes: ClassVar[Mapping[str, float]] = {"width": np.nan}
    law: ClassVar[Law] = staticmethod(beyond_the_band)

    def parameters(self, place: Place, variant: str = "") -> tuple[EffectParameter, ...]:
        """Width [the action's]; a small one is felt by every larger command."""
        span = place.span
        return (EffectParameter("width", place.unit, 0.0, span, (0.05 * span, 0.25 * span), 0.1 * span),)
