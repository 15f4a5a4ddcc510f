"""What is kept for judging: one boundary in every episode, the same for windows, single steps and rollouts."""

from __future__ import annotations

import numpy as np

from gpsim.channels import IntArray
from gpsim.recordings import Recording

ONE_IN = 5  # episodes (or samples, of fewer episodes) is held out where a recording says nothing: part of its format


def first_held_out(recording: Recording) -> IntArray:
    """(E,) index of the first held-out sample of every episode, its number of samples where none is.

    As the recording says, else the last fifth of the episodes, or of the samples where there are few episodes.
    """
    rule, sizes = recording.held_out, np.array([len(e.t) for e in recording.episodes])
    order = np.arange(len(sizes))
    if rule is not None and rule.time_from is not None:
        return np.array([np.searchsorted(e.t, rule.time_from) for e in recording.episodes], dtype=np.int64)
    if rule is not None and rule.episodes_from is not None:
        return np.where(order >= rule.episodes_from, 0, sizes).astype(np.int64)
    if len(sizes) >= ONE_IN:
        return np.where(order >= len(sizes) - len(sizes) // ONE_IN, 0, sizes).astype(np.int64)
    before = np.concatenate([[0], np.cumsum(sizes)[:-1]])
    return np.asarray(np.clip(int(sizes.sum()) * (ONE_IN - 1) // ONE_IN - before, 0, sizes), dtype=np.int64)


def held_out_names(recording: Recording) -> list[str]:
    """Names of the episodes of which a transition is held out, numbers in their order before other names."""
    held = zip(recording.episodes, first_held_out(recording), strict=True)
    return sorted((e.name for e, first in held if first < len(e)), key=_natural)


def _natural(name: str) -> tuple[int, str]:
    return (int(name), "") if name.isdigit() else (10**9, name)
