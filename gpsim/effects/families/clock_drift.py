"""A clock that drifts: the simulator gets u(t - d t), with t since the clock began.

Definition: a computer that gives commands by a clock of its own, slow by d against the one that stamps what is read. An
even rate is the first order of an oscillator's drift. It acts on commands, which are known before they act, and makes
them later and later.
A fast clock would make them act before they are given, which no simulator can step through that is driven live; and
what a sensor reads is not asked when it was read, so that side has no clock.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar

import numpy as np

from gpsim.channels import FloatArray
from gpsim.effects.effect import Values
from gpsim.effects.families.actuator_delay import ActuatorDelay
from gpsim.effects.place import EffectParameter, Place, Plausible
from gpsim.simulators import Memory

MILLION = 1e6  # ppm
LARGEST = 2000.0  # ppm: twenty times what a poor crystal has; clocks without one are no computers'
TOLERATED = 500.0  # ppm, by which a clock may be steered: what drifts more is broken (Linux, adjtimex(2))
REMEMBERED = (
    0.4  # s, at least, whatever the clock of what is driven: the most that a delay is searched for up to
)


class ClockDrift(ActuatorDelay):
    """A clock that drifts: the simulator gets u(t - d t), with t since the clock began."""

    family: ClassVar[str] = "clock_drift"
    noun: ClassVar[str] = "clock drift"
    sentence: ClassVar[str] = "the clock of {on} is slow by {drift}, so that commands come later and later"
    gated: ClassVar[bool] = False
    drifts: ClassVar[bool] = True
    holds: ClassVar[bool] = False
    order: ClassVar[int] = 11
    takes: ClassVar[Mapping[str, float]] = {"delay": 0.0, "drift": 0.0}
    plausible: ClassVar[Mapping[str, Plausible]] = {
        "drift": Plausible(
            0.0,
            TOLERATED,
            "1",
            "crystals 1 to 100 ppm each; clocks are steered by 500 at most (Linux, adjtimex(2))",
        ),
    }

    def parameters(self, place: Place, variant: str = "") -> tuple[EffectParameter, ...]:
        """Drift [ppm]; commands are never later than a delay may be."""
        step = MILLION * place.dt / max(place.reach, 1e-9)  # ppm that come to a step in the end
        high = min(LARGEST, MILLION * place.longest_delay / max(place.reach, 1e-9))
        starts = tuple(dict.fromkeys(min(steps * step, 0.5 * high) for steps in (0.7, 2.3)))
        return (EffectParameter("drift", "ppm", 0.0, high, starts, min(step, high)),)

    def offers(self, place: Place, variant: str) -> bool:
        """Where the recording is so long that a clock that is taken for a good one comes to a step in the end."""
        return variant == "" and TOLERATED * place.reach >= MILLION * place.dt

    def begin(self, count: int, longest: float, step: float) -> Memory:
        """The commands of the last `longest` seconds, of some tenths at least."""
        return super().begin(count, max(longest, REMEMBERED), step)

    def remembers(self, values: Values) -> float:
        """Who does not know the time does not know how long [s]: all that is remembered may matter."""
        return np.inf

    def late(self, values: Values, step: FloatArray, t: FloatArray) -> FloatArray:
        """(B, K) s in the middle of each substep; within it that changes by d times its length."""
        return np.asarray(values["drift"] / MILLION * np.maximum(t + step / 2, 0.0))
