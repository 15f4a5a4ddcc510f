"""Rollouts to judge on: a horizon long, begun every few samples, in blocks that are drawn together.

They begin in measured states where these are good enough for that, and in no reading at its range's end. Else before
each lie a few samples from which every account says for itself where the rollout begins: a measured velocity may be
mostly noise, a differentiated one is late, and some states nobody measures.

Rollouts that begin a horizon apart are two to twenty in a real log, too few for any interval; those that overlap are
not independent, and blocks of a horizon's length are what a bootstrap draws (Kuensch 1989).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from gpsim.channels import IntArray
from gpsim.diagnosis.data import Windows, at, stretches
from gpsim.diagnosis.judging.shares import FEWEST_BLOCKS
from gpsim.diagnosis.report import JudgedOn
from gpsim.diagnosis.setup import Question, telling
from gpsim.effects import closed
from gpsim.recordings import Recording, evenly
from gpsim.residuals import first_held_out

JUDGED_ROLLOUTS_OF_A_ROBOT = 40  # rollouts that an account is judged on, evenly spread, at most
ROLLOUT_STRIDE = 3  # between the starts of two rollouts [samples]
FOLDS = 5  # parts of the whole recording, each judged by what the others say
SHORT_PART = 0.25
"""Of the time, that may lie in stretches too short for a rollout, before rollouts are cut shorter."""


@dataclass(frozen=True)
class RolloutWindows:
    """Where rollouts begin, W of them.

    places: episode and first sample; lead: transitions before the rollout begins; length: all transitions; block: (W,)
    from 0, ascending; fold: (W,) which part of the recording must not be learnt from where a rollout judges, all 0
    where what is held out is judged on.
    """

    places: tuple[tuple[int, int], ...]
    lead: int
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


def rollout_windows(question: Question, lead: int = 0) -> RolloutWindows:
    """Held-out ones; of the whole recording, in folds, where they make too few blocks.

    lead: transitions before each, from which an account says where it begins; 0: in the measured state.
    """
    recording = question.recording
    held = first_held_out(recording)
    every = stretches(recording)
    out = [s for s in every if s[1] >= held[s[0]]]
    found = _cut(question, out or every, lead)
    if out and found.blocks >= FEWEST_BLOCKS:
        return found
    return _in_folds(_cut(question, every, lead))


def rollouts_in(question: Question, source: int, lead: int = 0) -> RolloutWindows:
    """Those of all of one of several recordings, for an account that was learnt from the others."""
    recording = question.recording
    parts = [s for s in stretches(recording) if recording.episodes[s[0]].source == source]
    return _cut(question, parts, lead)


def _cut(question: Question, parts: Sequence[tuple[int, int, int]], lead: int) -> RolloutWindows:
    """Evenly spread rollouts in stretches (episode, first, last sample)."""
    settings = question.everything.run.settings.rollouts
    length, lead = _length(question, parts, lead)
    starts: list[tuple[int, int]] = []
    block: list[int] = []
    tells = telling(question.recording)
    for episode, first, last in parts:
        own = np.arange(first, last - length + 1, ROLLOUT_STRIDE)
        told = np.array([tells[episode][k : k + lead + 1].all() for k in own], dtype=np.bool_)
        own = own[told] if told.any() else own
        before = block[-1] + 1 if block else 0
        starts += [(episode, int(k)) for k in own]
        block += [before + int(k - first) // (length - lead) for k in own]
    dear = closed(question.everything.simulator) is not None
    rows = evenly(len(starts), JUDGED_ROLLOUTS_OF_A_ROBOT if dear else settings.most)
    _, blocks = np.unique(np.array([block[i] for i in rows], dtype=np.int64), return_inverse=True)
    places = tuple(starts[i] for i in rows)
    return RolloutWindows(
        places, lead, length, blocks.reshape(-1), np.zeros(len(places), np.int64), "held-out rollouts"
    )


def _length(question: Question, parts: Sequence[tuple[int, int, int]], lead: int) -> tuple[int, int]:
    """Transitions of a rollout with its lead, and of the lead: the horizon, or what most of the stretches allow."""
    every = question.everything.run.settings
    usual = max(round(every.rollouts.horizon / question.recording.dt), every.windows.length)
    wanted, short = lead + min(usual, every.rollouts.longest), SHORT_PART
    spans = sorted(last - first for _, first, last in parts)
    upper = spans[np.searchsorted(np.cumsum(spans), short * sum(spans))] if spans else 0
    length = max(2, min(wanted, int(upper)))
    return length, min(lead, length // 2)


def _in_folds(found: RolloutWindows) -> RolloutWindows:
    """The same in as many parts of neighbouring blocks as are to be left out in turn."""
    count = min(FOLDS, max(found.blocks, 1))
    fold = found.block * count // max(found.blocks, 1)
    return replace(found, fold=fold, judged_on="cross-fitted rollouts")
