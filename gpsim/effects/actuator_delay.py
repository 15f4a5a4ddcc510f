"""A delay: the simulator gets u(t - T), averaged over a substep.

Astrom and Wittenmark (1997), Computer-Controlled Systems, 3rd ed., chapter 2 (sampling a system with a time
delay): a delay of a part of a step makes two neighbouring commands act in one step.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar

import numpy as np

from gpsim.channels import FloatArray
from gpsim.effects.effect import ActuatorEffect, EffectParameter, Place, Values
from gpsim.simulators.plant import Memory

FAR = 13.0  # steps: delays beyond are not reached from the shorter starts


class ActuatorDelay(ActuatorEffect):
    """A delay: the simulator gets u(t - T), averaged over a substep."""

    family: ClassVar[str] = "actuator_delay"
    order: ClassVar[int] = 10

    def parameters(self, place: Place, variant: str = "") -> tuple[EffectParameter, ...]:
        """Delay [s]."""
        dt = place.dt
        starts: tuple[float, ...] = (0.7 * dt, 2.3 * dt, 5.3 * dt)
        if place.longest_delay > FAR * dt:
            starts += (FAR * dt,)
        return (EffectParameter("delay", "s", 0.0, place.longest_delay, starts, dt),)

    def begin(self, count: int, longest: float, step: float) -> Memory:
        """The commands of the last `longest` seconds, the newest last: none yet."""
        return {"past": np.zeros((count, max(int(np.ceil(longest / step)) + 2, 2)))}

    def remembers(self, values: Values) -> float:
        """The longest delay [s]."""
        return float(np.max(values["delay"], initial=0.0))

    def actuate(
        self, commands: FloatArray, values: Values, memory: Memory, step: FloatArray, t: FloatArray
    ) -> FloatArray:
        """What was commanded a delay ago, between two substeps their weighted mean."""
        earlier, recent, share = self._neighbours(commands, values, memory, step)
        return np.asarray(recent + share * (earlier - recent))

    def pieces(
        self, commands: FloatArray, values: Values, memory: Memory, step: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """The earlier of two neighbouring commands, then the later one."""
        earlier, recent, share = self._neighbours(commands, values, memory, step)
        return np.stack([earlier, recent], axis=2), np.stack([share, 1.0 - share], axis=2)

    def _neighbours(
        self, commands: FloatArray, values: Values, memory: Memory, step: FloatArray
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """(B, K) each: the two commands of a substep a delay ago, and the earlier one's share of it."""
        past = memory["past"]
        depth, (rows, count) = past.shape[1], commands.shape
        line = np.concatenate([past, commands], axis=1)
        back = np.minimum(values["delay"] / step, depth - 1.0)
        whole = back.astype(np.int64)
        place = np.arange(depth, depth + count) + (depth + count) * np.arange(rows)[:, None] - whole
        past[:] = line[:, count:]
        return line.take(place - 1), line.take(place), back - whole

    def sentence(self, on: str, values: Mapping[str, str]) -> str:
        """One sentence."""
        return f"{on} acts {values['delay']} late"
