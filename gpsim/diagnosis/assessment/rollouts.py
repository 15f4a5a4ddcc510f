"""Rollouts on held-out data: how far every model has drifted from the measurement after the horizon."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from gpsim.channels import FloatArray, difference
from gpsim.diagnosis.assessment.bootstrap import MODELS, over_before
from gpsim.diagnosis.data import Windows, cut, held_out_mask, rms, stretches, typical
from gpsim.diagnosis.fitting import Extra, Hypothesis, Problem, predicted
from gpsim.diagnosis.report import Rollout, RolloutErrors, RolloutModelErrors
from gpsim.diagnosis.setup import Completions, Question
from gpsim.recordings import Recording, evenly
from gpsim.residuals import first_held_out

ROLLOUTS_LOOKED_AT = 4000  # windows evenly spread, from which these are taken


@dataclass(frozen=True)
class Model:
    """A hypothesis, and rates that are added to it. like: whose completion of hidden states it takes, None: its own."""

    hypothesis: Hypothesis
    extra: Extra | None = None
    like: Hypothesis | None = None


@dataclass(frozen=True)
class Drifts:
    """How far every model has drifted after the horizon [s]: (W, S) errors at the ends of W rollouts.

    Of `noise_floor` what the sensors' noise makes of the last model's rollouts, at their start and end.
    """

    horizon: float
    errors: Mapping[str, FloatArray]


def drifts(
    question: Question,
    models: Mapping[str, Model],
    noise: FloatArray,
    rng: np.random.Generator,
    completions: Completions,
) -> Drifts:
    """Of every model and of the noise; no errors at all where no held-out stretch is as long. noise: (S,)."""
    problem, dt, length = question.everything, question.recording.dt, _length(question)
    calls: list[tuple[Problem, Windows, Hypothesis, Extra | None]] = []
    for model in models.values():
        if question.hidden or not calls:  # what is hidden each model guesses for itself
            windows = whole_windows(question, completions.by(model.like or model.hypothesis))
        if not len(windows):
            return Drifts(length * dt, {})
        calls.append((problem, windows, model.hypothesis, model.extra))
    ends = [_ends(*call) for call in calls]
    errors = {
        kind: difference(call[1].measured[:, -1], end, problem.simulator.state)
        for kind, call, end in zip(models, calls, ends, strict=True)
    }
    (_, windows, hypothesis, extra), last = calls[-1], ends[-1]
    start, end = (rng.normal(size=last.shape) * noise for _ in range(2))
    noisy = replace(windows, measured=windows.measured + start[:, None])
    disturbed = _ends(problem, noisy, hypothesis, extra)
    errors["noise_floor"] = difference(disturbed, last, problem.simulator.state) + end
    return Drifts(length * dt, errors)


def rollouts(question: Question, found: Drifts, box: str | None, rng: np.random.Generator) -> Rollout:
    """Root mean square errors of every measured channel after the horizon.

    box: the model that is the `black_box`. `typical` holds the same from the median, which rare glitches of a sensor do
    not move.
    """
    out: dict[str, RolloutErrors] = {}
    for i, channel in enumerate(question.everything.simulator.state):
        if channel.name not in question.hidden and found.errors:
            own = {kind: found.errors[kind][:, i] for kind in (*MODELS, "noise_floor")}
            over = over_before({kind: own[kind] for kind in MODELS}, rng, correlated=False)
            out[channel.name] = RolloutErrors(
                **{kind: rms(e) for kind, e in own.items()},
                unit=channel.unit,
                typical=RolloutModelErrors(**{kind: typical(e) for kind, e in own.items()}),
                over_before=over,
                after_over_before=over.after,
                black_box=None if box is None else rms(found.errors[box][:, i]),
            )
    return Rollout(found.horizon, out)


def _ends(problem: Problem, windows: Windows, hypothesis: Hypothesis, extra: Extra | None) -> FloatArray:
    """(W, S): where a model says that the windows end."""
    return predicted(problem, windows, hypothesis, extra)[:, -1]


def rolled(problem: Problem, windows: Windows, model: Model) -> FloatArray:
    """(W, S) how far the model has drifted from what was measured at the windows' ends."""
    last = _ends(problem, windows, model.hypothesis, model.extra)
    return difference(windows.measured[:, -1], last, problem.simulator.state)


def whole_windows(question: Question, recording: Recording, learnt_from: bool = False) -> Windows:
    """Evenly spread ones of the horizon in the held-out part, or in what is `learnt_from`.

    All is both where nothing is held out. recording: the question's, completed where channels are hidden.
    """
    settings = question.everything.run.settings
    most, looked_at = settings.rollouts.most, ROLLOUTS_LOOKED_AT
    windows = cut(recording, settings.windows, _length(question), most=looked_at)
    held = held_out_mask(recording, windows)
    windows = windows.take(held if held.any() and not learnt_from else ~held)
    windows = windows.take(windows.valid[:, -1])
    windows = windows.take(windows.sound_ends) if windows.sound_ends.any() else windows
    return windows.take(evenly(len(windows), most))


def _length(question: Question) -> int:
    recording, settings = question.recording, question.everything.run.settings
    usual = max(round(settings.rollouts.horizon / recording.dt), settings.windows.length)
    return max(2, min(usual, settings.rollouts.longest, _longest(recording)))


def _longest(recording: Recording) -> int:
    """Transitions of the longest held-out stretch; of any where nothing is held out."""
    held = first_held_out(recording)
    spans = [(last - first, first >= held[index]) for index, first, last in stretches(recording)]
    return max((span for span, out in spans if out), default=max((span for span, _ in spans), default=0))
