"""Rows evenly spread over all there are."""

from __future__ import annotations

import numpy as np

from gpsim.channels import IntArray


def evenly(count: int, most: int) -> IntArray:
    """(n,) at most `most` of the rows 0 ... count - 1, evenly spread, the first and the last among them; all if few."""
    return np.linspace(0, count - 1, min(count, most)).round().astype(np.int64)
