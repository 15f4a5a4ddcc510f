"""How large errors are: their root mean square, and the same from the median, which rare wild ones do not move."""

from __future__ import annotations

import numpy as np

from gpsim.channels import FloatArray

TYPICAL = 1.4826  # the median of |e| times this is the standard deviation of a normal error


def rms(errors: FloatArray) -> float:
    """Root mean square of errors (N,)."""
    return float(np.sqrt(np.mean(errors**2)))


def typical(errors: FloatArray) -> float:
    """The same of normal errors (N,), from the median."""
    return float(TYPICAL * np.median(np.abs(errors)))
