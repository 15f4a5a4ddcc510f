"""What a channel's readings show by themselves: where they stand at an end, and which small ones are missing."""

from __future__ import annotations

import numpy as np

from gpsim.channels import FloatArray

FEWEST = 10  # readings of one value: fewer are chance
AS_MANY = 5  # times as many as have the next value: at a turning point of a coarse signal they are 2.4 times as many
HOLLOW = 5  # times the usual step between small readings that the least of them is away from 0
SMALL = 20  # readings that tell this usual step


def stands(readings: FloatArray) -> tuple[bool, bool]:
    """Whether many readings (N,) have the lowest, and the highest, value of all."""
    counts = np.unique(readings, return_counts=True)[1]
    if len(counts) < 3:
        return False, False
    many = counts[[0, -1]] >= np.maximum(FEWEST, AS_MANY * counts[[1, -2]])
    return bool(many[0]), bool(many[1])


def unread(readings: FloatArray) -> float:
    """The least size of readings (N,) that are not 0, where many are 0 and none lies between; else 0."""
    sizes = np.unique(np.abs(readings))
    if len(sizes) < 3 or sizes[0] > 0.0 or (readings == 0.0).sum() < FEWEST:
        return 0.0
    usual = float(np.median(np.diff(sizes[1 : SMALL + 2])))
    return float(sizes[1]) if sizes[1] > HOLLOW * usual else 0.0
