"""What is kept for judging: one boundary in every episode, for residuals, windows, single steps and rollouts alike.

A recording says it itself (`held_out`); else the last fifth of its episodes is held out, or of its samples where there
are too few episodes for that. Of several recordings that are judged together each holds out a part of its own. Learning
never sees a held-out sample.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from gpsim.channels import BoolArray, IntArray
from gpsim.errors import UsageError
from gpsim.recordings import HeldOut, Recording, Transitions, apart

SHARE = (
    0.2  # of the episodes (or samples, of fewer episodes) where a recording says nothing: part of its format
)
ROUNDING = 1e-6  # of an episode or a sample: 0.2 * 15 is a little more than 3, and 0.3 * 10 a little less


def first_held_out(recording: Recording) -> IntArray:
    """(E,) index of the first held-out sample of every episode, its number of samples where none is."""
    if recording.sources and recording.held_out is None:
        return _of_each(recording)
    rule, sizes = recording.held_out, np.array([len(e.t) for e in recording.episodes])
    if rule is not None and rule.time_from is not None:
        return np.array([np.searchsorted(e.t, rule.time_from) for e in recording.episodes], dtype=np.int64)
    order = np.arange(len(sizes))
    if rule is not None and rule.episodes_from is not None:
        return np.where(order >= rule.episodes_from, 0, sizes).astype(np.int64)
    share = SHARE if rule is None or rule.share is None else rule.share
    count = int(share * len(sizes) + ROUNDING)
    if count > 0:
        return np.where(order >= len(sizes) - count, 0, sizes).astype(np.int64)
    before = np.concatenate([[0], np.cumsum(sizes)[:-1]])
    boundary = int((1.0 - share) * sizes.sum() + ROUNDING)
    return np.asarray(np.clip(boundary - before, 0, sizes), dtype=np.int64)


def _of_each(recording: Recording) -> IntArray:
    """(E,) the same where every one of the joined recordings decides for itself."""
    of, out = np.array([e.source for e in recording.episodes]), np.zeros(len(recording.episodes), np.int64)
    for place, part in enumerate(apart(recording)):
        out[of == place] = first_held_out(part)
    return out


def check_each_holds_out(recording: Recording) -> None:
    """Of several recordings each must hold something out if it says so itself; raises UsageError."""
    for source, part in zip(recording.sources, apart(recording), strict=False):
        said = part.held_out is not None and part.held_out.share != 0.0
        if said and all(k >= len(e.t) for k, e in zip(first_held_out(part), part.episodes, strict=True)):
            raise UsageError(
                f"{source.name}: nothing is held out: its held_out begins after its end; correct it in "
                "recording.yaml, or remove it to hold out the last fifth"
            )


def holding_out(recording: Recording, share: float) -> Recording:
    """The recording with the last `share` of it held out; itself where it says something of its own, or the same."""
    if recording.held_out is not None or share == SHARE:
        return recording
    return replace(recording, held_out=HeldOut(share=share))


def held_out_rows(recording: Recording, transitions: Transitions) -> BoolArray:
    """(N,) True on transitions that end at a held-out sample; raises UsageError where `held_out` keeps none.

    transitions: some of the recording's.
    """
    # Transitions are known by the moment at which they begin: the first that is kept ends at the first held-out sample.
    first = [
        e.t[max(int(k) - 1, 0)] if k < len(e.t) else np.inf
        for e, k in zip(recording.episodes, first_held_out(recording), strict=True)
    ]
    test = np.asarray(transitions.t >= np.array(first)[transitions.episode])
    said = recording.held_out is not None and recording.held_out.share is None
    if said and len(test) and not test.any():
        raise UsageError(
            "nothing is held out: held_out begins after the recording's end; correct it in recording.yaml, or remove "
            "it (residuals.test_fraction)"
        )
    return test


def held_out_names(recording: Recording) -> list[str]:
    """Names of the episodes of which a transition is held out, numbers in their order before other names."""
    held = zip(recording.episodes, first_held_out(recording), strict=True)
    return sorted((e.name for e, first in held if first < len(e)), key=_natural)


def _natural(name: str) -> tuple[int, str]:
    return (int(name), "") if name.isdigit() else (10**9, name)
