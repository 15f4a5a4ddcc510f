"""A delay: the simulator gets u(t - T), averaged over a substep."""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar

import numpy as np

from gpsim.channels import FloatArray
from gpsim.effects.effect import ActuatorEffect, EffectParameter, Place, Values
from gpsim.simulators.plant import Memory


class ActuatorDelay(ActuatorEffect):
    """A delay: the simulator gets u(t - T), averaged over a substep."""

    family: ClassVar[str] = "actuator_delay"
    order: ClassVar[int] = 10

    def parameters(self, place: Place, variant: str = "") -> tuple[EffectParameter, ...]:
        """Delay [s]."""
        dt = place.dt
        return (EffectParameter("delay", "s", 0.0, 12 * dt, (0.7 * dt, 2.3 * dt, 5.3 * dt), dt),)

    def begin(self, count: int, longest: float, step: float) -> Memory:
        """The commands of the last `longest` seconds: none yet."""
        depth = max(int(np.ceil(longest / step)) + 2, 2)
        return {"past": np.zeros((count, depth)), "head": np.zeros(count)}

    def actuate(
        self, command: FloatArray, values: Values, memory: Memory, step: FloatArray, t: FloatArray
    ) -> FloatArray:
        """What was commanded a delay ago, between two substeps their weighted mean."""
        past, rows = memory["past"], np.arange(len(command))
        depth = past.shape[1]
        head = memory["head"].astype(np.int64)
        past[rows, head] = command
        memory["head"][:] = (head + 1) % depth
        back = np.minimum(values["delay"] / step, depth - 2.0)
        whole = back.astype(np.int64)
        near, far = past[rows, (head - whole) % depth], past[rows, (head - whole - 1) % depth]
        return np.asarray(near + (back - whole) * (far - near))

    def sentence(self, on: str, values: Mapping[str, str]) -> str:
        """One sentence."""
        return f"{on} acts {values['delay']} late"
