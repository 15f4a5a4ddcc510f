"""What a diagnosis leaves open, in numbers: explanations, their parameters' covariances, noise, and what was visited.

A plan for the next recording is made from it, and a monitor compares later recordings with it.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, fields, replace
from typing import Any

import numpy as np

from gpsim.channels import FloatArray
from gpsim.diagnosis.assessment import covariance
from gpsim.diagnosis.fitting import Fit, Hypothesis, Problem, correlation_time, mean_squares
from gpsim.diagnosis.judgement import Judgement
from gpsim.diagnosis.setup import Question
from gpsim.effects import EffectParameter, from_json, own_name, to_json
from gpsim.errors import UsageError
from gpsim.recordings import Recording, evenly

SCHEMA = "gpsim.left_open/1"
VISITED = 128  # samples that stand for where a recording has been
NOTHING_KNOWN = 100.0  # times its size: a parameter whose standard deviation is larger is not known at all


@dataclass(frozen=True)
class Explanation:
    """One explanation of a recording.

    covariance: (P, P) of the hypothesis's theta; probability: among all that were fitted.
    """

    hypothesis: Hypothesis
    probability: float
    covariance: FloatArray

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
        named = [
            f"{term.family} on {term.on}: {p.name}"
            for term, group in zip(self.hypothesis.terms, self.hypothesis.declared, strict=True)
            for p in group
        ]
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

    noise: of each measured channel, as much larger as correlation makes it count; left: root mean square that the
    leader leaves in it.
    """

    explanations: tuple[Explanation, ...]
    noise: Mapping[str, float]
    left: Mapping[str, float]
    visited: Visited

    def to_dict(self) -> dict[str, Any]:
        """left_open.json."""
        return {
            "schema": SCHEMA,
            "explanations": [_explanation_data(e) for e in self.explanations],
            "noise": dict(self.noise),
            "left": dict(self.left),
            "visited": {name: _listed(value) for name, value in vars(self.visited).items()},
        }

    @classmethod
    def from_dict(cls, data: Mapping[str, Any], where: str) -> LeftOpen:
        """The inverse of `to_dict`; raises UsageError."""
        try:
            if data["schema"] != SCHEMA:
                raise UsageError(f"{where}: schema '{data['schema']}', expected {SCHEMA}")
            seen = {f.name: _array(data["visited"][f.name]) for f in fields(Visited) if f.name != "seconds"}
            visited = Visited(seconds=float(data["visited"]["seconds"]), **seen)
            noise, left = ({str(k): float(v) for k, v in data[key].items()} for key in ("noise", "left"))
            return cls(tuple(map(_explanation_from, data["explanations"])), noise, left, visited)
        except (KeyError, TypeError, ValueError, AttributeError) as error:
            raise UsageError(f"{where}: not a posterior that this version reads ({error!r})") from error


def left_open_of(question: Question, judgement: Judgement) -> LeftOpen:
    """The leader and its rivals as a diagnosis leaves them; of several recordings, as they are in the last."""
    problem = question.everything
    found = (judgement.leader, *judgement.rivals)
    last = len(question.recording.sources) - 1 if question.recording.sources else None
    explanations = tuple(
        _explanation(problem, fit, probability, last)
        for fit, probability in zip(found, judgement.probabilities, strict=True)
    )
    tau = np.maximum(correlation_time(problem, judgement.leader.residuals), 1.0) * question.thinned
    noise = judgement.noise * np.sqrt(tau)
    left = np.sqrt(mean_squares(problem, judgement.leader.residuals))
    seen = [
        (i, name)
        for i, name in enumerate(problem.simulator.state.names)
        if problem.observed[i] and name not in question.hidden
    ]
    each, kept = ({name: float(values[i]) for i, name in seen} for values in (noise, left))
    return LeftOpen(explanations, each, kept, _visited(question))


def _explanation(problem: Problem, fit: Fit, probability: float, last: int | None) -> Explanation:
    whole, every = fit.hypothesis, covariance(problem, fit)
    if last is None:
        return Explanation(_begun(whole), probability, every)
    own = _begun(whole.in_recording(last))
    columns = {
        (term.identity, p.name): i
        for i, (term, p) in enumerate(
            (term, p) for term, group in zip(whole.terms, whole.declared, strict=True) for p in group
        )
    }
    kept = [
        columns.get((term.identity, own_name(p.name, last)), columns.get((term.identity, p.name), -1))
        for term, group in zip(own.terms, own.declared, strict=True)
        for p in group
    ]
    return Explanation(own, probability, every[np.ix_(kept, kept)])


def _begun(hypothesis: Hypothesis) -> Hypothesis:
    """As it is now: what began inside the recording acts from the start."""
    return replace(hypothesis, terms=tuple(replace(t, gate=t.gate.opened) for t in hypothesis.terms))


def _visited(question: Question) -> Visited:
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


def _explanation_data(one: Explanation) -> dict[str, Any]:
    return {
        "label": one.label,
        "probability": one.probability,
        "scheme": one.hypothesis.scheme,
        "terms": [to_json(term) for term in one.hypothesis.terms],
        "parameters": [
            [{k: _listed(v) for k, v in asdict(p).items()} for p in group]
            for group in one.hypothesis.declared
        ],
        "covariance": _listed(one.covariance),
    }


def _explanation_from(data: Mapping[str, Any]) -> Explanation:
    terms = tuple(from_json(term) for term in data["terms"])
    declared = tuple(tuple(map(_parameter, group)) for group in data["parameters"])
    hypothesis = Hypothesis(terms, declared, data["scheme"])
    size = len(hypothesis.parameters)
    matrix = _array(data["covariance"]).reshape(size, size)
    return Explanation(hypothesis, float(data["probability"]), matrix)


def _parameter(data: Mapping[str, Any]) -> EffectParameter:
    values = {k: _unlisted(v) for k, v in data.items()}
    for name in ("starts", "plausible"):
        values[name] = None if values[name] is None else tuple(values[name])
    return EffectParameter(**values)


def _listed(value: Any) -> Any:
    """JSON's own types; what is not finite, which JSON does not know, as a text."""
    if isinstance(value, np.ndarray | list | tuple):
        return [_listed(v) for v in (value.tolist() if isinstance(value, np.ndarray) else value)]
    return str(value) if isinstance(value, float) and not math.isfinite(value) else value


def _array(value: Any) -> FloatArray:
    return np.array(_unlisted(value), dtype=np.float64)


def _unlisted(value: Any) -> Any:
    if isinstance(value, list):
        return [_unlisted(v) for v in value]
    return float(value) if value in ("inf", "-inf", "nan") else value
