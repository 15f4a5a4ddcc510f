"""Commands that come late: what a delay remembers, and which of it acts in a substep.

Astrom and Wittenmark (1997), Computer-Controlled Systems, 3rd ed., chapter 2 (sampling a system with a time delay): a
delay of a part of a step makes two neighbouring commands act in one step. On an uneven clock a number of substeps is
not a time: there may be more commands in a substep, or fewer.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import ClassVar

import numpy as np

from gpsim.channels import BoolArray, FloatArray, IntArray
from gpsim.effects.effect import ActuatorEffect, FunctionOf, Values
from gpsim.simulators import Memory

EVEN = 1e-4  # share by which the steps of an even clock may differ: stamps are rounded


class LateEffect(ActuatorEffect):
    """The simulator gets commands of a while ago, averaged over a substep; the law says by how much they are late [s].

    It is of `step` and `t`, no command.
    """

    function_of: ClassVar[FunctionOf] = "nothing"

    def begin(self, count: int, longest: float, step: float) -> Memory:
        """The commands of the last `longest` seconds: none yet; and how long each one lasted [s], the newest last.

        The commands are in a ring: `head` is where the oldest lies, and the next one will.
        """
        past = np.zeros((count, max(int(np.ceil(longest / step)) + 2, 2)))
        length = np.full_like(past, step)
        return {"past": past, "head": np.zeros(count), "length": length, "uneven": np.zeros(count)}

    def finer(self, memory: Memory, times: int) -> Memory:
        """Every command of the past so many times, as long as before in all."""
        past, length = (np.repeat(a, times, axis=1) for a in (_in_order(memory), memory["length"] / times))
        return memory | {"past": past, "length": length}

    def actuate(
        self, commands: FloatArray, values: Values, memory: Memory, step: FloatArray, t: FloatArray
    ) -> FloatArray:
        """What was commanded a delay ago, between substeps their weighted mean."""
        acted, shares = self.pieces(commands, values, memory, step, t)
        if memory["uneven"].any():
            return np.asarray((acted * shares).sum(axis=2))
        earlier, recent = acted[:, :, 0], acted[:, :, 1]
        return np.asarray(recent + shares[:, :, 0] * (earlier - recent))

    def pieces(
        self, commands: FloatArray, values: Values, memory: Memory, step: FloatArray, t: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """The earlier of two neighbouring commands, then the later one; on an uneven clock there may be more."""
        late = np.asarray(self.ask(values, step=step, t=t))
        if _uneven(memory, step):
            return _met(commands, late, memory, step)
        earlier, recent, share = _neighbours(commands, late, memory, step)
        return np.stack([earlier, recent], axis=2), np.stack([share, 1.0 - share], axis=2)


def even(steps: FloatArray, usual: FloatArray) -> bool:
    """Whether all steps [s] are as long as the usual one (any shape)."""
    low, high = float(usual.min(initial=np.inf)), float(usual.max(initial=0.0))
    shortest, longest = float(steps.min(initial=np.inf)), float(steps.max(initial=0.0))
    return bool(shortest >= (1.0 - EVEN) * high and longest <= (1.0 + EVEN) * low)


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


def _neighbours(
    commands: FloatArray, late: FloatArray, memory: Memory, step: FloatArray
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
    # The oldest command is all that is known of what was before.
    low, high = (np.maximum(edges[:, depth:] - delay, 0.0) for edges in (begins, ends))
    first = np.minimum(_last_at_most(lambda place: begins[row, place], width, low), own)
    last = np.minimum(_last_at_most(lambda place: begins[row, place], width, high), own)
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


def _last_at_most(rising: Callable[[IntArray], FloatArray], count: int, most: FloatArray) -> IntArray:
    """The last of `count` places at which what rises with the place is at most `most`, elementwise; 0 where none is.

    rising: places -> values, both in the shape of `most`.
    """
    low = np.zeros(most.shape, dtype=np.int64)
    beyond: IntArray = np.full(most.shape, count, dtype=np.int64)
    for _ in range(count.bit_length()):  # halves what is left
        middle = (low + beyond) // 2
        reached: BoolArray = rising(middle) <= most
        low, beyond = np.where(reached, middle, low), np.where(reached, beyond, middle)
    return low
