"""Rollouts to judge on: a horizon long, begun every few samples, in blocks that are drawn together.

Rollouts that begin a horizon apart are two to twenty in a real log, too few for any interval; those that overlap are
not independent, and blocks of a horizon's length are what a bootstrap draws (Kuensch 1989).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from gpsim.channels import IntArray
from gpsim.diagnosis.data import Windows, at, stretches
from gpsim.diagnosis.report import JudgedOn
from gpsim.diagnosis.settings import AttributionSettings
from gpsim.diagnosis.setup import Question
from gpsim.recordings import Recording, evenly
from gpsim.residuals import first_held_out


@dataclass(frozen=True)
class RolloutWindows:
    """Where rollouts begin, W of them.

    places: episode and first sample; length: transitions; block: (W,) from 0, ascending; fold: (W,) which part of the
    recording must not be learnt from where a rollout judges, all 0 where what is held out is judged on.
    """

    places: tuple[tuple[int, int], ...]
    length: int
    block: IntArray
    fold: IntArray
    judged_on: JudgedOn

    def __len__(self) -> int:
        return len(self.places)

    @property
    def blocks(self) -> int:
        """How many blocks there are."""
        return int(self.block.max(initial=-1)) + 1

    def windows(self, recording: Recording) -> Windows:
        """Those of a recording, the question's as a hypothesis completes it."""
        return at(recording, self.places, self.length)


def rollout_windows(question: Question) -> RolloutWindows:
    """Held-out ones; of the whole recording, in folds, where they make too few blocks."""
    settings, recording = question.everything.run.settings.attribution, question.recording
    held = first_held_out(recording)
    every = stretches(recording)
    out = [s for s in every if s[1] >= held[s[0]]]
    found = _cut(question, out or every, settings)
    if out and found.blocks >= settings.fewest_blocks:
        return found
    return _in_folds(_cut(question, every, settings), settings)


def _cut(
    question: Question, parts: Sequence[tuple[int, int, int]], settings: AttributionSettings
) -> RolloutWindows:
    """Evenly spread rollouts in stretches (episode, first, last sample)."""
    length = _length(question, parts)
    starts: list[tuple[int, int]] = []
    block: list[int] = []
    for episode, first, last in parts:
        own = range(first, last - length + 1, settings.stride)
        before = block[-1] + 1 if block else 0
        starts += [(episode, k) for k in own]
        block += [before + (k - first) // length for k in own]
    rows = evenly(len(starts), settings.most)
    _, blocks = np.unique(np.array([block[i] for i in rows], dtype=np.int64), return_inverse=True)
    places = tuple(starts[i] for i in rows)
    return RolloutWindows(
        places, length, blocks.reshape(-1), np.zeros(len(places), np.int64), "held-out rollouts"
    )


def _length(question: Question, parts: Sequence[tuple[int, int, int]]) -> int:
    """Transitions of a rollout: the horizon, or what most of the stretches' time allows."""
    settings, rollouts = question.everything.run.settings, question.everything.run.settings.rollouts
    usual = max(round(rollouts.horizon / question.recording.dt), settings.windows.length)
    spans = sorted(last - first for _, first, last in parts)
    if not spans:
        return 2
    upper = spans[np.searchsorted(np.cumsum(spans), settings.attribution.short_part * sum(spans))]
    return max(2, min(usual, rollouts.longest, int(upper)))


def _in_folds(found: RolloutWindows, settings: AttributionSettings) -> RolloutWindows:
    """The same in as many parts of neighbouring blocks as are to be left out in turn."""
    count = min(settings.folds, max(found.blocks, 1))
    fold = found.block * count // max(found.blocks, 1)
    return RolloutWindows(found.places, found.length, found.block, fold, "cross-fitted rollouts")
