"""What base and corrected simulator say along a whole recording, sample by sample: for the eye, no judgement."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from gpsim.channels import Channels, FloatArray, difference, wrap_angle
from gpsim.corrected import EffectsPlant
from gpsim.diagnosis.assessment import Model, posed
from gpsim.diagnosis.data import cut
from gpsim.diagnosis.fitting import Hypothesis, predicted
from gpsim.diagnosis.run import Run
from gpsim.diagnosis.setup import Completions, PreparedProblem
from gpsim.recordings import Recording

AT_ONCE = 2000  # windows that are simulated together: memory, no answer
NAMES = {"before": "base", "after": "corrected", "after_gp": "corrected_gp"}


@dataclass(frozen=True)
class Along:
    """One model in one episode, over its N samples that were looked at; NaN where no rollout reaches or it ran away.

    said: (N, S) what its sensors would say; off: (N, S) measured minus said, NaN in channels that nobody measured;
    age: (N,) s since the rollout began.
    """

    said: FloatArray
    off: FloatArray
    age: FloatArray


@dataclass(frozen=True)
class Alongside:
    """Rollouts of every model, each from a measured state over the horizon [s], then anew from the next sample on.

    state: the channels (S) of the simulator as the recording shows it; held: states that never change, at their values;
    scale: (S,) how much each channel varies; every: of how many recorded samples one is looked at. models: base,
    corrected and, where there is a Gaussian process, corrected_gp -> what it says in every episode.
    """

    state: Channels
    held: Mapping[str, float]
    scale: FloatArray
    every: int
    horizon: float
    models: Mapping[str, tuple[Along, ...]]

    def mismatch(self, one: Along) -> FloatArray:
        """(N,): root mean square of the residuals that there are, each over its channel's scale; NaN without any."""
        known = np.isfinite(one.off)
        squares = np.where(known, one.off / self.scale, 0.0) ** 2
        with np.errstate(invalid="ignore"):
            return np.sqrt(squares.sum(axis=1) / known.sum(axis=1))  # type: ignore[no-any-return]


def alongside(
    recording: Recording,
    corrected: EffectsPlant,
    with_gp: EffectsPlant | None = None,
    horizon: float = 1.0,
    run: Run | None = None,
) -> Alongside:
    """Simulate along the recording that was diagnosed: effects that began inside it do not act before.

    with_gp: the same plant with a Gaussian process, which may stand in the effects' place. horizon: s; a longer one
    than the longest episode is that. Raises UsageError where simulator and recording do not go together.
    """
    judged = posed(recording, corrected, with_gp, run)
    question, plants = judged.question, {"after": corrected, "after_gp": with_gp}
    longest = max(len(episode) for episode in question.recording.episodes)
    length = max(2, round(min(horizon / question.recording.dt, longest)))
    models = {kind: _as_it_was(model, plants.get(kind)) for kind, model in judged.models.items()}
    account = models["after"].hypothesis
    completions = Completions(question.everything, question.recording, question.hidden, account)
    return Alongside(
        question.everything.simulator.state,
        {} if question.sight is None else dict(question.sight.held),
        question.everything.scale,
        question.thinned,
        length * question.recording.dt,
        {NAMES[kind]: _along(question, completions, model, length) for kind, model in models.items()},
    )


def _as_it_was(model: Model, plant: EffectsPlant | None) -> Model:
    """The model with the effects' own onsets, which a plant that is to be driven has behind it."""
    if plant is None or not model.hypothesis.terms:
        return model
    hypothesis = Hypothesis(plant.terms, tuple(() for _ in plant.terms), plant.scheme)
    return replace(model, hypothesis=hypothesis)


def _along(
    question: PreparedProblem, completions: Completions, model: Model, length: int
) -> tuple[Along, ...]:
    """A model along every episode, as it completes them, in rollouts of so many transitions, some at a time."""
    problem, state = question.everything, question.everything.simulator.state
    seen = np.array([name not in question.hidden for name in state.names])
    episodes = question.recording.episodes
    blank = (np.full((len(e.t), 2 * len(state) + 1), np.nan) for e in episodes)
    out = tuple(Along(b[:, : len(state)], b[:, len(state) : -1], b[:, -1]) for b in blank)
    whole = cut(completions.by(model.hypothesis), problem.run.settings.windows, length)
    for begin in range(0, len(whole), AT_ONCE):
        windows = whole.take(np.arange(begin, min(begin + AT_ONCE, len(whole))))
        with np.errstate(all="ignore"):  # a rollout may run away
            said = predicted(problem, windows, model.hypothesis, model.extra)
            off = np.where(seen, difference(windows.measured, said, state), np.nan)
            said[..., state.wraps] = wrap_angle(said[..., state.wraps])
        astray = ~np.isfinite(said).all(axis=2)
        off[astray] = said[astray] = np.nan
        for w, index in enumerate(windows.episode):
            valid, t = windows.valid[w], windows.t[w]
            first = int(np.searchsorted(episodes[index].t, t[0]))
            rows, one = slice(first, first + int(valid.sum())), out[index]
            one.said[rows], one.off[rows], one.age[rows] = said[w, valid], off[w, valid], t[valid] - t[0]
    return out
