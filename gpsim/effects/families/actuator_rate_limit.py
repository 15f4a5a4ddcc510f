"""A rate limit: |u_a'| <= r.

Duda (1997), "Prediction of pilot-in-the-loop oscillations due to rate saturation", Journal of Guidance,
Control, and Dynamics 20(3).
"""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from gpsim.channels import FloatArray
from gpsim.effects.effect import ActuatorEffect, FunctionOf, Values
from gpsim.effects.place import EffectParameter, Place
from gpsim.simulators import Memory


class ActuatorRateLimit(ActuatorEffect):
    """A rate limit: |u_a'| <= r."""

    family: ClassVar[str] = "actuator_rate_limit"
    sentence: ClassVar[str] = "{on} changes no faster than {rate}"
    function_of: ClassVar[FunctionOf] = "nothing"
    order: ClassVar[int] = 90
    holds: ClassVar[bool] = False

    def parameters(self, place: Place, variant: str = "") -> tuple[EffectParameter, ...]:
        """Rate [the action's per second]; from several starts."""
        typical = place.span / place.dt
        starts = (0.5 * typical, 0.15 * typical, 0.04 * typical)
        unit = f"{place.unit}/s"
        return (
            EffectParameter("rate", unit, 1e-4 * typical, 4 * typical, starts, 0.1 * typical, falls=True),
        )

    def begin(self, count: int, longest: float, step: float) -> Memory:
        """The actuator at rest."""
        return {"level": np.zeros(count)}

    def remembers(self, values: Values) -> float:
        """For ever: what it does not follow keeps it where it was."""
        return np.inf

    def actuate(
        self, commands: FloatArray, values: Values, memory: Memory, step: FloatArray, t: FloatArray
    ) -> FloatArray:
        """The mean over each substep of a level that moves towards the command no faster than the rate."""
        reach = np.ascontiguousarray((values["rate"] * step).T)
        level = memory["level"]
        levels = np.array(commands.T, order="C")  # a copy: what the level becomes, substep by substep
        low, high = np.empty_like(level), np.empty_like(level)
        before = np.empty_like(levels)
        for was, now, furthest in zip(before, levels, reach, strict=True):
            was[:] = level
            np.subtract(level, furthest, out=low)
            np.add(level, furthest, out=high)
            np.maximum(now, low, out=now)
            np.minimum(now, high, out=now)
            level = now
        memory["level"][:] = level
        moved = levels - before
        return np.ascontiguousarray((levels - moved * np.abs(moved) / np.maximum(2 * reach, 1e-300)).T)
