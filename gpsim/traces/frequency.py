"""How a channel answers a command, frequency by frequency: as measured, and as base and corrected simulator say.

Averages over half overlapping segments under a Hann window (Welch 1967). The response is the cross spectrum over the
command's own; the coherence is the share of the channel's power that follows linearly from the command (Bendat and
Piersol 2010, chapter 6). A simulation begins every segment in its measured state and is not corrected within it, so
what leaks from the segments' ends is alike in all.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from gpsim.channels import BoolArray, FloatArray
from gpsim.diagnosis.data import Windows, at, stretches
from gpsim.diagnosis.fitting import Hypothesis, predicted
from gpsim.diagnosis.setup import Completions, PreparedProblem
from gpsim.recordings import Recording, evenly
from gpsim.traces.pictured import models_of

LENGTHS = 1024, 512, 256, 128, 64  # of a segment: the longest of which there are enough [samples]
FEWEST = 12  # segments: what is not coherent at all comes out at about 0.1
MOST_SAMPLES = 30_000  # in the segments that are looked at
FIRST = 2  # bin of the spectrum: those below hold the trend that is taken off every segment
COHERENT = 0.5  # from here on a frequency is shown
DECADES = 1.0  # that coherent frequencies must cover together, else the recording does not excite enough
MEASURED = ""  # stands for what was measured, where models have their names


@dataclass(frozen=True)
class Response:
    """From a command to a channel, by their columns; f: (F,) Hz.

    magnitudes: (F,) units of the channel a unit of the command; coherences: (F,); both of MEASURED and of every model
    that did not run away. segments: how many were averaged; seconds: how long each is.
    """

    command: int
    channel: int
    f: FloatArray
    magnitudes: Mapping[str, FloatArray]
    coherences: Mapping[str, FloatArray]
    segments: int
    seconds: float

    @property
    def shown(self) -> BoolArray:
        """(F,) where what was measured is coherent."""
        return np.asarray(self.coherences[MEASURED] >= COHERENT)


def frequency(question: PreparedProblem, leader: Hypothesis) -> Response | None:
    """Of the pair that is coherent over the widest band, over the whole recording; None where none is over a decade."""
    recording, problem, models = question.recording, question.everything, models_of(question, leader)
    places, length = _segments(recording)
    if not places:
        return None
    account = list(models.values())[-1]
    completions = Completions(problem, recording, question.hidden, account)
    windows = {kind: at(completions.by(model), places, length) for kind, model in models.items()}
    some = next(iter(windows.values()))
    f = np.asarray(np.fft.rfftfreq(length, recording.dt)[FIRST:-1], dtype=np.float64)
    seen = [i for i, n in enumerate(problem.simulator.state.names) if n not in question.hidden]
    best, found = (0, 0), -1.0
    for command in range(some.actions.shape[2]):
        for channel in seen:
            covered = _decades(_answer(some, some.measured, command, channel)[1])
            if covered > found:
                best, found = (command, channel), covered
    if found < DECADES:
        return None
    said = {MEASURED: _answer(some, some.measured, *best)}
    for kind, model in models.items():
        with np.errstate(all="ignore"):  # it may run away
            simulated = predicted(problem, windows[kind], model)
            answer = _answer(windows[kind], simulated, *best)
        if np.isfinite(answer).all():
            said[kind] = answer
    magnitudes, coherences = ({kind: both[i] for kind, both in said.items()} for i in (0, 1))
    return Response(*best, f, magnitudes, coherences, len(places), length * recording.dt)


def _segments(recording: Recording) -> tuple[list[tuple[int, int]], int]:
    """(episode, first sample) of half overlapping segments without a gap in them, and their length; none: too few."""
    parts = [(index, first, last) for index, first, last in stretches(recording)]
    for length in LENGTHS:
        places = [(i, k) for i, first, last in parts for k in range(first, last - length + 1, length // 2)]
        if len(places) >= FEWEST:
            return [places[i] for i in evenly(len(places), max(FEWEST, MOST_SAMPLES // length))], length
    return [], 0


def _answer(windows: Windows, states: FloatArray, command: int, channel: int) -> FloatArray:
    """(2, F) magnitude of the response and coherence of states (W, L + 1, S) with a command; 0 where it is still."""
    from scipy.signal import csd  # here: half a second that most commands need not wait for

    length = windows.length
    x, y = windows.actions[..., command], states[:, :-1, channel]

    def spectrum(one: FloatArray, other: FloatArray) -> FloatArray:
        return np.asarray(csd(one, other, nperseg=length, detrend="linear")[1].mean(axis=0)[FIRST:-1])

    own, cross, others = spectrum(x, x).real, spectrum(x, y), spectrum(y, y).real
    still = (own <= 0.0) | (others <= 0.0)
    own, others = np.where(still, 1.0, own), np.where(still, 1.0, others)
    return np.where(still, 0.0, [np.abs(cross) / own, np.abs(cross) ** 2 / (own * others)])


def _decades(coherence: FloatArray) -> float:
    """How many decades the coherent frequencies cover together, each as wide as its bin."""
    bins = FIRST + np.flatnonzero(coherence >= COHERENT)
    return float(np.log10((bins + 0.5) / (bins - 0.5)).sum())
