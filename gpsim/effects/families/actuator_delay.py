"""A delay: the simulator gets u(t - T), averaged over a substep.

Astrom and Wittenmark (1997), Computer-Controlled Systems, 3rd ed., chapter 2 (sampling a system with a time
delay): a delay of a part of a step makes two neighbouring commands act in one step.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar

import numpy as np

from gpsim.channels import FloatArray
from gpsim.effects.effect import ActuatorEffect, FunctionOf, Values
from gpsim.effects.elapsed import even, last_at_most
from gpsim.effects.place import EffectParameter, Place, Plausible
from gpsim.simulators import Memory

FAR = 13.0  # steps: delays beyond are not reached from the shorter starts


class ActuatorDelay(ActuatorEffect):
    """A delay: the simulator gets u(t - T), averaged over a substep."""

    family: ClassVar[str] = "actuator_delay"
    sentence: ClassVar[str] = "{on} acts {delay} late"
    function_of: ClassVar[FunctionOf] = "nothing"
    order: ClassVar[int] = 10
    takes: ClassVar[Mapping[str, float]] = {"delay": 0.0, "drift": 0.0}
    plausible: ClassVar[Mapping[str, Plausible]] = {
        "delay": Plausible(
            0.0, 6.0, "step", "networks and drivers 0.01 to 0.3 s (a Limo: 0.27 s)", least=0.5
        ),
    }

    def parameters(self, place: Place, variant: str = "") -> tuple[EffectParameter, ...]:
        """Delay [s]."""
        dt = place.dt
        starts: tuple[float, ...] = (0.7 * dt, 2.3 * dt, 5.3 * dt)
        if place.longest_delay > FAR * dt:
            starts += (FAR * dt,)
        return (EffectParameter("delay", "s", 0.0, place.longest_delay, starts, dt),)

    def begin(self, count: int, longest: float, step: float) -> Memory:
        """The commands of the last `longest` seconds: none yet; and how long each one lasted [s], the newest last.

        The commands are in a ring: `head` is where the oldest lies, and the next one will.
        """
        past = np.zeros((count, max(int(np.ceil(longest / step)) + 2, 2)))
        length = np.full_like(past, step)
        return {"past": past, "head": np.zeros(count), "length": length, "uneven": np.zeros(count)}

    def remembers(self, values: Values) -> float:
        """The longest delay [s]."""
        return float(np.max(values["delay"], initial=0.0))

    def finer(self, memory: Memory, times: int) -> Memory:
        """Every command of the past so many times, as long as before in all."""
        past, length = (np.repeat(a, times, axis=1) for a in (_in_order(memory), memory["length"] / times))
        return memory | {"past": past, "length": length}

    def actuate(
        self, commands: FloatArray, values: Values, memory: Memory, step: FloatArray, t: FloatArray
    ) -> FloatArray:
        """What was commanded a delay ago, between substeps their weighted mean."""
        late = self.late(values, step, t)
        if _uneven(memory, step):
            acted, shares = _met(commands, late, memory, step)
            return np.asarray((acted * shares).sum(axis=2))
        earlier, recent, share = self._neighbours(commands, late, memory, step)
        return np.asarray(recent + share * (earlier - recent))

    def pieces(
        self, commands: FloatArray, values: Values, memory: Memory, step: FloatArray, t: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """The earlier of two neighbouring commands, then the later one; on an uneven clock there may be more."""
        late = self.late(values, step, t)
        if _uneven(memory, step):
            return _met(commands, late, memory, step)
        earlier, recent, share = self._neighbours(commands, late, memory, step)
        return np.stack([earlier, recent], axis=2), np.stack([share, 1.0 - share], axis=2)

    def late(self, values: Values, step: FloatArray, t: FloatArray) -> FloatArray:
        """(B, 1) or (B, K) s by how much commands are late in substeps that begin at t (B, K) s."""
        return values["delay"]

    def _neighbours(
        self, commands: FloatArray, late: FloatArray, memory: Memory, step: FloatArray
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """(B, K) each: the two commands of a substep a delay ago, and the earlier one's share of it."""
        past, (rows, count) = memory["past"], commands.shape
        depth = past.shape[1]
        back = np.minimum(late / step, depth - 1.0)
        whole = back.astype(np.int64)
        if count == 1:  # step by step, all of a long past would be moved each time
            row, head = np.arange(rows)[:, None], memory["head"].astype(np.int64)[:, None]
            earlier = past[row, (head - whole - 1) % depth]
            past[row, head] = commands  # over the oldest
            memory["head"][:] = ((head + 1) % depth)[:, 0]
            return earlier, past[row, (head - whole) % depth], back - whole
        line = np.concatenate([_in_order(memory), commands], axis=1)
        place = np.arange(depth, depth + count) + (depth + count) * np.arange(rows)[:, None] - whole
        past[:] = line[:, count:]
        return line.take(place - 1), line.take(place), back - whole


def _uneven(memory: Memory, step: FloatArray) -> bool:
    """Whether substeps differ, or have differed; while they do not, what the memory says of their lengths stands."""
    if not memory["uneven"].any() and even(step, memory["length"][:, -1]):
        return False
    memory["uneven"][:] = 1.0
    return True


def _in_order(memory: Memory) -> FloatArray:
    """The past commands (B, K) of the memory, which is changed: the newest last."""
    past, head = memory["past"], memory["head"]
    if head.any():
        columns = head.astype(np.int64)[:, None] + np.arange(past.shape[1])
        past[:] = np.take_along_axis(past, columns % past.shape[1], axis=1)
        head[:] = 0.0
    return past


def _met(
    commands: FloatArray, delay: FloatArray, memory: Memory, step: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """(B, K, P) each: commands given a delay (B, 1) or (B, K) before each substep, and which shares of it they last."""
    past, length, (count, steps) = _in_order(memory), memory["length"], commands.shape
    line, lengths = np.concatenate([past, commands], axis=1), np.concatenate([length, step], axis=1)
    depth, width = past.shape[1], line.shape[1]
    past[:], length[:] = line[:, steps:], lengths[:, steps:]
    ends = np.cumsum(lengths, axis=1)
    begins = ends - lengths
    row, own = np.arange(count)[:, None], np.arange(depth, width)
    low = np.maximum(
        begins[:, depth:] - delay, 0.0
    )  # the oldest command is all that is known of what was before
    high = np.maximum(ends[:, depth:] - delay, 0.0)
    first = np.minimum(last_at_most(lambda place: begins[row, place], width, low), own)
    last = np.minimum(last_at_most(lambda place: begins[row, place], width, high), own)
    pieces = int((last - first).max(initial=0)) + 1
    # What follows may have play in it, which a command moves that lasts no time: none is met that has not begun.
    place = np.minimum(first[:, :, None] + np.arange(pieces), last[:, :, None])
    rows = row[:, :, None]
    met = np.minimum(ends[rows, place], high[:, :, None]) - np.maximum(begins[rows, place], low[:, :, None])
    met = np.maximum(met, 0.0)
    met[:, :, 1:][place[:, :, 1:] == place[:, :, :-1]] = 0.0  # the last one counts once
    whole = met.sum(axis=2, keepdims=True)
    met[:, :, :1] += whole <= 0.0  # a substep of no length meets one command
    return line[rows, place], met / np.where(whole > 0.0, whole, 1.0)
