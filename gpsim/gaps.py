"""Where a log has lost rows: what was commanded in the meantime is not known."""

from __future__ import annotations

import numpy as np

from gpsim.channels import BoolArray, FloatArray, IntArray

LONGEST_STEP = 1.8  # in control steps: a longer one may hide commands


def gaps(t: FloatArray, dt: float) -> BoolArray:
    """(K,): steps of a clock t (K + 1,) s that are too long for one control step of dt s."""
    return np.asarray(np.diff(t) > LONGEST_STEP * dt)


def steps_to_next(t: FloatArray, episode: IntArray, dt: float) -> IntArray:
    """(N,): how many control steps of dt s lie between a row and the next one of its episode, at least 1.

    t (N,) s, episode (N,) ascending. A clock that jitters counts as one step; only a gap counts as more. The last row
    of an episode, which has none after it, counts 1.
    """
    count = np.ones(len(t), dtype=np.int64)
    lost = np.flatnonzero(gaps(t, dt) & (np.diff(episode) == 0))
    count[lost] = np.rint((t[lost + 1] - t[lost]) / dt).astype(np.int64)
    return count
