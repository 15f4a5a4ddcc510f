"""A rate limit: |u_a'| <= r.

Duda (1997), "Prediction of pilot-in-the-loop oscillations due to rate saturation", Journal of Guidance,
Control, and Dynamics 20(3).
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar

import numpy as np

from gpsim.channels import FloatArray
from gpsim.effects.effect import ActuatorEffect, EffectParameter, Place, Values
from gpsim.simulators.plant import Memory


class ActuatorRateLimit(ActuatorEffect):
    """A rate limit: |u_a'| <= r."""

    family: ClassVar[str] = "actuator_rate_limit"
    order: ClassVar[int] = 90

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
        level, out = memory["level"], np.empty_like(commands)
        furthest = values["rate"] * step
        for k, command in enumerate(commands.T):
            gap, reach = command - level, furthest[:, k]
            size = np.abs(gap)
            share = np.minimum(1.0, size / np.maximum(reach, 1e-300))  # of the substep that is spent moving
            mean = command - np.sign(gap) * (size * share - reach * share**2 / 2)
            out[:, k] = np.where(size >= reach, level + np.sign(gap) * reach / 2, mean)
            level += np.clip(gap, -reach, reach)
        return out

    def sentence(self, on: str, values: Mapping[str, str]) -> str:
        """One sentence."""
        return f"{on} changes no faster than {values['rate']}"
