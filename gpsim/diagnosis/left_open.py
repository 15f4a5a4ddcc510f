"""What a diagnosis leaves open, in numbers: explanations, how their parameters vary, noise, and what was visited.

A plan for the next recording is made from it, a monitor compares later recordings with it, and policies are trained in
simulators that are drawn from it.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from gpsim.channels import FloatArray
from gpsim.corrected import Drawable, EffectsPlant, PosteriorPlant, Size, Spread
from gpsim.diagnosis.assessment import covariance
from gpsim.diagnosis.fitting import Fit, Hypothesis, Problem, mean_squares
from gpsim.diagnosis.judging import Judgement
from gpsim.diagnosis.report import Diagnosis, NamedEffect
from gpsim.diagnosis.setup import Question
from gpsim.effects import EffectParameter, Term, base_name, own_name, owner_of
from gpsim.errors import UsageError
from gpsim.recordings import Recording, evenly

VISITED = 128  # samples that stand for where a recording has been
LEAST_VARIANCE = 1e-300  # of a parameter; guards a division
NOTHING_KNOWN = 100.0  # times its size: a parameter whose standard deviation is larger is not known at all


@dataclass(frozen=True)
class Explanation:
    """One explanation of a recording.

    covariance: (P, P) of the hypothesis's theta; probability: among all that were fitted; intervals: (P, 2) as the
    account states them, with all that widens them, NaN where the data do not determine an end.
    """

    hypothesis: Hypothesis
    probability: float
    covariance: FloatArray
    intervals: FloatArray

    @property
    def label(self) -> str:
        """What it claims, in a few words."""
        return self.hypothesis.label

    @property
    def undetermined(self) -> str | None:
        """A parameter of which the recording says nothing; None where there is none."""
        with np.errstate(invalid="ignore"):
            deviation = np.sqrt(np.diag(self.covariance))
        if not np.isfinite(self.covariance).all():
            deviation = np.full(len(deviation), np.inf)
        named = [f"{term.family} on {term.on}: {p.name}" for _, term, p in parameters_of(self.hypothesis)]
        sizes = zip(named, deviation, self.hypothesis.theta, self.hypothesis.parameters, strict=True)
        wrong = (n for n, d, v, p in sizes if not 0.0 < d < NOTHING_KNOWN * max(abs(v), p.scale))
        return next(wrong, None)

    def drawn(self, rng: np.random.Generator, count: int) -> FloatArray:
        """(count, P) parameters from the normal distribution around the estimate, kept within their bounds."""
        theta = self.hypothesis.theta
        if not theta.size:
            return np.empty((count, 0))
        low, high = (np.array([getattr(p, e) for p in self.hypothesis.parameters]) for e in ("low", "high"))
        scale = np.sqrt(np.diag(self.covariance))
        values, vectors = np.linalg.eigh(self.covariance / np.outer(scale, scale))
        root = vectors * np.sqrt(np.maximum(values, 0.0))
        normal = rng.standard_normal((count, len(theta)))
        return np.asarray(np.clip(theta + (normal @ root.T) * scale, low, high))

    def drawable(self, leader: EffectsPlant, level: float) -> Drawable:
        """As simulators that are drawn. leader: the corrected simulator; level: of the intervals. Raises UsageError."""
        sizes = []
        each = zip(parameters_of(self.hypothesis), self.intervals.tolist(), strict=True)
        for (i, term, p), (low, high) in each:
            if not np.isfinite([low, high]).all():
                raise UsageError(
                    f"the posterior is singular, the recording does not determine {p.name} of {term.family} on "
                    f"{term.on}; record what does (the account's Next says what), or leave robustness=posterior out"
                )
            sizes.append(Size(i, p.name, term.values[p.name], low, high, p.low, p.high))
        scale = np.sqrt(np.maximum(np.diag(self.covariance), LEAST_VARIANCE))
        correlations = np.clip(self.covariance / np.outer(scale, scale), -1.0, 1.0)
        if not np.isfinite(correlations).all():
            raise UsageError("the posterior is singular: its correlations are not finite")
        np.fill_diagonal(correlations, 1.0)
        terms = self.hypothesis.terms
        scheme = self.hypothesis.scheme if terms else leader.scheme
        plant = replace(leader, terms=terms, scheme=scheme)
        return Drawable(plant, self.probability, Spread(tuple(sizes), correlations, level))


def parameters_of(hypothesis: Hypothesis) -> list[tuple[int, Term, EffectParameter]]:
    """Every fitted parameter in the order of theta, with its term and which that is."""
    return [
        (i, term, p)
        for i, (term, group) in enumerate(zip(hypothesis.terms, hypothesis.declared, strict=True))
        for p in group
    ]


@dataclass(frozen=True)
class Visited:
    """Where the recording has been, in the simulator's channels (what it does not show is NaN).

    seconds: its length; state_low, state_high, action_low, action_high: extremes; action_rate: the largest change of a
    command per second; start: a typical first state; rows: (M, S + A) samples spread over it.
    """

    seconds: float
    state_low: FloatArray
    state_high: FloatArray
    action_low: FloatArray
    action_high: FloatArray
    action_rate: FloatArray
    start: FloatArray
    rows: FloatArray


@dataclass(frozen=True)
class LeftOpen:
    """Explanations, the leader first.

    level: the probability that the intervals hold; noise: of each measured channel, as much larger as correlation makes
    it count; left: root mean square that the leader leaves in it.
    """

    explanations: tuple[Explanation, ...]
    level: float
    noise: Mapping[str, float]
    left: Mapping[str, float]
    visited: Visited

    def drawn_in(self, leader: EffectsPlant, where: str) -> PosteriorPlant:
        """Simulators to draw. leader: the corrected one; raises UsageError, led by `where`, if nothing can be drawn."""
        if not sum(one.probability for one in self.explanations) > 0.0:
            raise UsageError(f"{where}: no explanation has a probability; diagnose the recording again")
        try:
            return PosteriorPlant(tuple(one.drawable(leader, self.level) for one in self.explanations))
        except UsageError as error:
            raise UsageError(f"{where}: {error}") from error


def left_open_of(question: Question, judgement: Judgement, diagnosis: Diagnosis) -> LeftOpen:
    """The leader and its rivals as a diagnosis leaves them; of several recordings, as they are in the last."""
    problem = question.everything
    fits = (judgement.leader, *judgement.rivals)
    told = (diagnosis.effects, *(rival.effects for rival in diagnosis.alternatives))
    names = [source.name for source in question.recording.sources]
    explanations = tuple(
        _explanation(problem, fit, probability, effects, names)
        for fit, probability, effects in zip(fits, judgement.probabilities, told, strict=True)
    )
    tau = judgement.leader.noise.times * question.thinned
    noise = judgement.noise * np.sqrt(tau)
    left = np.sqrt(mean_squares(problem, judgement.leader.residuals))
    seen = [
        (i, name)
        for i, name in enumerate(problem.simulator.state.names)
        if problem.observed[i] and name not in question.hidden
    ]
    each, kept = ({name: float(values[i]) for i, name in seen} for values in (noise, left))
    level = question.run.settings.intervals.level
    return LeftOpen(explanations, level, each, kept, visited_of(question))


def _explanation(
    problem: Problem, fit: Fit, probability: float, effects: Sequence[NamedEffect], names: Sequence[str]
) -> Explanation:
    """effects: the account's; names: of several recordings."""
    whole, every, last = fit.hypothesis, covariance(problem, fit), len(names) - 1
    rows = {(term.identity, p.name): row for row, (_, term, p) in enumerate(parameters_of(whole))}
    told = {(effect.family, effect.on): effect for effect in effects}
    own = _begun(whole.in_recording(last) if names else whole)
    declared, kept, intervals = [], [], []
    for term, group in zip(own.terms, own.declared, strict=True):
        named = [(own_name(p.name, last), p.name) for p in group]
        found = [next((n for n in both if (term.identity, n) in rows), None) for both in named]
        declared.append(tuple(p for p, name in zip(group, found, strict=True) if name is not None))
        for name in filter(None, found):  # what is left is another recording's alone
            kept.append(rows[term.identity, name])
            effect = told[term.identity]
            estimate = (
                (effect.own or {}).get(names[last], {}).get(base_name(name))
                if owner_of(name) is not None
                else None
            )
            estimate = estimate or effect.parameters[base_name(name)]
            intervals.append([math.nan if e is None else e for e in (estimate.low, estimate.high)])
    ends = np.array(intervals, dtype=np.float64).reshape(len(kept), 2)
    return Explanation(replace(own, declared=tuple(declared)), probability, every[np.ix_(kept, kept)], ends)


def _begun(hypothesis: Hypothesis) -> Hypothesis:
    """As it is now: what began inside the recording acts from the start."""
    return replace(hypothesis, terms=tuple(replace(t, gate=t.gate.opened) for t in hypothesis.terms))


def visited_of(question: Question) -> Visited:
    """Where its recording has been."""
    recording, simulator = question.recording, question.whole
    states = np.concatenate(
        [_columns(recording, e.states, simulator.state.names) for e in recording.episodes]
    )
    actions = np.concatenate([e.actions for e in recording.episodes])
    changes = [np.abs(np.diff(e.actions, axis=0)) for e in recording.episodes if len(e.actions) > 1]
    largest = np.concatenate(changes).max(axis=0) if changes else np.zeros(actions.shape[1])
    pairs = np.concatenate(
        [
            np.hstack([_columns(recording, e.states, simulator.state.names)[: len(e.actions)], e.actions])
            for e in recording.episodes
        ]
    )
    starts = [_columns(recording, e.states[:1], simulator.state.names)[0] for e in recording.episodes]
    return Visited(
        seconds=float(sum(e.t[-1] - e.t[0] for e in recording.episodes)),
        state_low=states.min(axis=0),
        state_high=states.max(axis=0),
        action_low=actions.min(axis=0),
        action_high=actions.max(axis=0),
        action_rate=largest / recording.dt,
        start=np.median(starts, axis=0),
        rows=pairs[evenly(len(pairs), VISITED)],
    )


def _columns(recording: Recording, states: FloatArray, names: Sequence[str]) -> FloatArray:
    """States in the simulator's columns; NaN where the recording has none."""
    own = recording.state.names
    return np.stack(
        [states[:, own.index(n)] if n in own else np.full(len(states), np.nan) for n in names], axis=1
    )
