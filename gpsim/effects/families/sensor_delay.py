"""A sensor delay: y(t - T).

Definition: a shift; between samples, Lagrange's interpolation (Laakso, Valimaki, Karjalainen and Laine 1996,
"Splitting the unit delay", IEEE Signal Processing Magazine 13(1)).
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import ClassVar

import numpy as np

from gpsim.channels import FloatArray, IntArray
from gpsim.effects.effect import FunctionOf, SensorEffect, Values, changed
from gpsim.effects.place import EffectParameter, Place, Plausible
from gpsim.simulators import Memory

CLOSE = (
    0.05  # of the longest of three steps: a cubic through states nearer to each other would blow up rounding
)


class SensorDelay(SensorEffect):
    """A sensor delay: y(t - T)."""

    family: ClassVar[str] = "sensor_delay"
    sentence: ClassVar[str] = "the sensor of {on} is {delay} late"
    function_of: ClassVar[FunctionOf] = "nothing"
    order: ClassVar[int] = 10
    plausible: ClassVar[Mapping[str, Plausible]] = {
        "delay": Plausible(0.0, 5.0, "step", "cameras and filters 0.01 to 0.2 s", least=0.5),
    }

    def parameters(self, place: Place, variant: str = "") -> tuple[EffectParameter, ...]:
        """Delay [s]."""
        dt = place.dt
        return (EffectParameter("delay", "s", 0.0, place.longest_delay, (0.7 * dt, 2.3 * dt), dt),)

    def reach(self, values: Values) -> float:
        """The longest delay [s]."""
        return float(np.max(values["delay"], initial=0.0))

    def begin(
        self,
        history: FloatArray,
        column: int,
        values: Values,
        step: FloatArray,
        steps: FloatArray | None = None,
    ) -> tuple[Memory, FloatArray]:
        """The last states in a ring, and where the oldest lies; on an uneven clock also when [s] each one was."""
        memory = {"past": np.array(history), "head": np.zeros(len(history))}
        if steps is not None:
            when = np.cumsum(steps, axis=1)
            memory["when"] = when - when[:, -1:]
        return memory, history

    def watch(
        self, state: FloatArray, column: int, values: Values, memory: Memory, step: FloatArray
    ) -> FloatArray:
        """Remember the newest state."""
        head = memory["head"].astype(np.int64)
        rows: IntArray | slice = np.arange(len(state))
        if len(head) and (head == head[0]).all():
            # They began together: a column is quicker than picked places.
            rows, head = slice(None), head[0]
        memory["past"][rows, head] = state
        if "when" in memory:
            memory["when"][rows, head] = memory["when"][rows, head - 1] + step
        memory["head"][:] = (head + 1) % memory["past"].shape[1]
        return state

    def measure(
        self, measured: FloatArray, columns: tuple[int, ...], values: Values, memory: Memory, step: FloatArray
    ) -> FloatArray:
        """What the channel was a delay ago; between substeps, Lagrange's cubic through the four around it."""
        (column,) = columns
        if "when" in memory:
            return changed(measured, column, measured[:, column] + _change(values["delay"], column, memory))
        past, rows = memory["past"], np.arange(len(measured))
        depth = past.shape[1]
        newest = (memory["head"].astype(np.int64) - 1) % depth
        back = np.minimum(values["delay"] / step, depth - 2.0)
        # The four lie one substep apart; nothing is known after the newest, and nothing before the oldest.
        first = np.clip(back.astype(np.int64) - 1, 0, max(depth - 4, 0))
        nodes = range(min(4, depth))
        late = np.zeros(len(measured))
        for i in nodes:
            weight = np.ones(len(measured))
            for j in nodes:
                if j != i:
                    weight *= (back - first - j) / (i - j)
            late += weight * past[rows, (newest - first - i) % depth, column]
        return changed(measured, column, measured[:, column] - past[rows, newest, column] + late)


def _change(delay: FloatArray, column: int, memory: Memory) -> FloatArray:
    """(B,) what the channel was a delay (B,) [s] ago less what it is, on an uneven clock.

    Lagrange's cubic through the four states around that moment, a straight line where some of them nearly coincide.
    """
    past, when = memory["past"][:, :, column].T, memory["when"].T  # (K, B), in the order of the ring
    (depth, count), rows = past.shape, np.arange(len(delay))
    oldest = memory["head"].astype(np.int64)
    newest = np.where(oldest > 0, oldest, depth) - 1
    ages = np.subtract(when[newest, rows], when, order="C")
    late = np.minimum(delay, ages[oldest, rows])
    # The moment lies between this state and the next older one. A count is quicker than a search: rings are short.
    before = np.clip((ages <= late).sum(axis=0) - 1, 0, depth - 2)
    first = np.clip(before - 1, 0, max(depth - 4, 0))
    slots = newest - first - np.arange(min(4, depth))[:, None]
    slots += depth * (slots < 0)
    age, was = ages.take(slots * count + rows), past[slots, rows]
    now = past[newest, rows]
    apart = np.diff(age, axis=0)
    smooth = apart.min(axis=0) > CLOSE * apart.max(axis=0)
    to, curved = late - age, np.zeros(count)
    with np.errstate(all="ignore"):
        for i in range(len(age)):
            others = [to[j] / (age[i] - age[j]) for j in range(len(age)) if j != i]
            curved += math.prod(others[1:], start=others[0]) * was[i]
    if smooth.all():
        return np.asarray(curved - now)
    place = (before - first) * count + rows
    near, far, there = age.take(place), age.take(place + count), was.take(place)
    share = np.clip((late - near) / np.where(far > near, far - near, 1.0), 0.0, 1.0)
    straight = there + share * (was.take(place + count) - there)
    return np.asarray(np.where(smooth, curved, straight) - now)
