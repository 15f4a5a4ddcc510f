"""How far back a moment lies: on an uneven clock a number of substeps is not a time."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from gpsim.channels import BoolArray, FloatArray, IntArray

EVEN = 1e-4  # share by which the steps of an even clock may differ: stamps are rounded


def even(steps: FloatArray, usual: FloatArray) -> bool:
    """Whether all steps [s] are as long as the usual one (any shape)."""
    low, high = float(usual.min(initial=np.inf)), float(usual.max(initial=0.0))
    shortest, longest = float(steps.min(initial=np.inf)), float(steps.max(initial=0.0))
    return bool(shortest >= (1.0 - EVEN) * high and longest <= (1.0 + EVEN) * low)


def last_at_most(rising: Callable[[IntArray], FloatArray], count: int, most: FloatArray) -> IntArray:
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
