"""A first-order lag: T u_a' = u - u_a, exact for a command held over the substep.

Ogata (2010), Modern Control Engineering, 5th ed., section 5-2 (first-order systems).
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar

import numpy as np

from gpsim.channels import FloatArray
from gpsim.effects.effect import ActuatorEffect, FunctionOf, Values
from gpsim.effects.place import EffectParameter, Place, Plausible
from gpsim.simulators import Memory

FORGOTTEN = 17.0  # time constants


class ActuatorLag(ActuatorEffect):
    """A first-order lag: T u_a' = u - u_a, exact for a command held over the substep."""

    family: ClassVar[str] = "actuator_lag"
    sentence: ClassVar[str] = "{on} follows its command with a lag of {time_constant}"
    function_of: ClassVar[FunctionOf] = "nothing"
    order: ClassVar[int] = 95
    holds: ClassVar[bool] = False
    plausible: ClassVar[Mapping[str, Plausible]] = {
        "time_constant": Plausible(
            0.0,
            10.0,
            "step",
            "electric drives 0.01 to 0.1 s, servos and cars up to 0.5 s (Rajamani 2012, chapter 5)",
            least=1.0,
        ),
    }

    def parameters(self, place: Place, variant: str = "") -> tuple[EffectParameter, ...]:
        """time_constant [s]."""
        dt = place.dt
        return (EffectParameter("time_constant", "s", 0.02 * dt, 50 * dt, (0.7 * dt, 3 * dt, 10 * dt), dt),)

    def begin(self, count: int, longest: float, step: float) -> Memory:
        """The actuator at rest."""
        return {"level": np.zeros(count)}

    def remembers(self, values: Values) -> float:
        """So many time constants [s] that less than a ten millionth is left."""
        return FORGOTTEN * float(np.max(values["time_constant"], initial=0.0))

    def actuate(
        self, commands: FloatArray, values: Values, memory: Memory, step: FloatArray, t: FloatArray
    ) -> FloatArray:
        """The mean over each substep of the exponential approach to the command."""
        ratio = np.maximum(step, 1e-12) / np.maximum(values["time_constant"], 1e-9)
        decay, share = np.ascontiguousarray(np.exp(-ratio).T), -np.expm1(-ratio) / ratio
        level, u = memory["level"], np.ascontiguousarray(commands.T)
        behind = np.empty_like(u)
        for gap, command, kept in zip(behind, u, decay, strict=True):
            np.subtract(level, command, out=gap)
            np.multiply(gap, kept, out=level)
            level += command
        return np.asarray(commands + np.ascontiguousarray(behind.T) * share)
