"""What a diagnosis leaves open, in numbers and as posterior.json: explanations, how their parameters vary, noise.

A plan for the next recording is made from it, a monitor compares later recordings with it, and policies are trained in
simulators that are drawn from it.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, fields, replace
from typing import Any

import numpy as np

from gpsim.channels import FloatArray
from gpsim.corrected import Drawable, EffectsPlant, PosteriorPlant, Size, Spread
from gpsim.diagnosis import Outcome
from gpsim.diagnosis.assessment import covariance
from gpsim.diagnosis.fitting import Fit, Hypothesis, Problem, mean_squares
from gpsim.diagnosis.setup import PreparedProblem
from gpsim.effects import EffectParameter, Term, base_name, from_json, own_name, owner_of, to_json
from gpsim.errors import UsageError
from gpsim.findings import NamedEffect
from gpsim.recordings import evenly

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
        for (i, term, p), (low, high) in zip(
            parameters_of(self.hypothesis), self.intervals.tolist(), strict=True
        ):
            if not np.isfinite([low, high]).all():
                raise UsageError(
                    f"the recording does not determine {p.name} of {term.family} on {term.on}; make the recording of "
                    "the account's Next, or remove robustness=posterior"
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


def posterior_of(found: Outcome) -> LeftOpen:
    """The leader and its rivals as a diagnosis leaves them; of several recordings, as they are in the last."""
    question, judgement, diagnosis = found.question, found.judgement, found.diagnosis
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
    """As it is now: what began inside the recording acts. effects: the account's; names: of several recordings."""
    whole, every, last = fit.hypothesis, covariance(problem, fit), len(names) - 1
    rows = {(term.identity, p.name): row for row, (_, term, p) in enumerate(parameters_of(whole))}
    told = {(effect.family, effect.on): effect for effect in effects}
    here = whole.in_recording(last) if names else whole
    declared, kept, intervals = [], [], []
    for term, group in zip(here.terms, here.declared, strict=True):
        effect, own = told[term.identity], list[EffectParameter]()
        for p in group:  # what neither is this recording's nor shared by all is another's alone
            found = [n for n in (own_name(p.name, last), p.name) if (term.identity, n) in rows]
            if found:
                name, base = found[0], base_name(found[0])
                alone = (effect.own or {}).get(names[last], {}) if owner_of(name) is not None else {}
                size = alone.get(base) or effect.parameters[base]
                own.append(p)
                kept.append(rows[term.identity, name])
                intervals.append([math.nan if e is None else e for e in (size.low, size.high)])
        declared.append(tuple(own))
    terms = tuple(replace(term, gate=term.gate.opened) for term in here.terms)
    hypothesis = replace(here, terms=terms, declared=tuple(declared))
    ends = np.array(intervals, dtype=np.float64).reshape(len(kept), 2)
    return Explanation(hypothesis, probability, every[np.ix_(kept, kept)], ends)


def visited_of(question: PreparedProblem) -> Visited:
    """Where its recording has been."""
    recording, names = question.recording, question.whole.state.names
    own = {name: i for i, name in enumerate(recording.state.names)}
    states = [np.full((len(e.states), len(names)), np.nan) for e in recording.episodes]
    for values, episode in zip(states, recording.episodes, strict=True):
        for column, name in enumerate(names):
            if name in own:
                values[:, column] = episode.states[:, own[name]]
    parts = zip(states, recording.episodes, strict=True)
    pairs = np.concatenate([np.hstack([values[: len(e.actions)], e.actions]) for values, e in parts])
    every, actions = np.concatenate(states), pairs[:, len(names) :]
    changes = [np.abs(np.diff(e.actions, axis=0)) for e in recording.episodes if len(e.actions) > 1]
    largest = np.concatenate(changes).max(axis=0) if changes else np.zeros(actions.shape[1])
    return Visited(
        seconds=float(sum(e.t[-1] - e.t[0] for e in recording.episodes)),
        state_low=every.min(axis=0),
        state_high=every.max(axis=0),
        action_low=actions.min(axis=0),
        action_high=actions.max(axis=0),
        action_rate=largest / recording.dt,
        start=np.median([values[0] for values in states], axis=0),
        rows=pairs[evenly(len(pairs), VISITED)],
    )


SCHEMA = "gpsim.posterior/2"
OLDER = "gpsim.posterior/1"  # with a left_open.json beside it
LEVEL = 0.9  # of an older file's intervals


def left_open_data(open_still: LeftOpen) -> dict[str, Any]:
    """posterior.json."""
    return {
        "schema": SCHEMA,
        "level": open_still.level,
        "explanations": [_explanation_data(e) for e in open_still.explanations],
        "noise": dict(open_still.noise),
        "left": dict(open_still.left),
        "visited": {name: _listed(value) for name, value in vars(open_still.visited).items()},
    }


def left_open_from(data: Mapping[str, Any], where: str) -> LeftOpen:
    """The inverse of `left_open_data`; raises UsageError."""
    try:
        if data["schema"] != SCHEMA:
            raise UsageError(f"{where}: schema '{data['schema']}', expected {SCHEMA}")
        seen = {f.name: _array(data["visited"][f.name]) for f in fields(Visited) if f.name != "seconds"}
        visited = Visited(seconds=float(data["visited"]["seconds"]), **seen)
        noise, left = ({str(k): float(v) for k, v in data[key].items()} for key in ("noise", "left"))
        found = tuple(map(_explanation_from, data["explanations"]))
        return LeftOpen(found, float(data["level"]), noise, left, visited)
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        raise UsageError(f"{where}: not a posterior that this version can read ({error!r})") from error


def from_two_files(drawn: Mapping[str, Any], planned: Mapping[str, Any]) -> dict[str, Any]:
    """What posterior.json would say now, of an older one, with intervals, and the left_open.json beside it."""
    explanations = []
    for entry, of in zip(planned["explanations"], drawn["explanations"], strict=True):
        said = {}  # by the term and the name of each parameter: the older file has terms that do nothing, too
        for size in of["parameters"]:
            term = of["terms"][size["term"]]
            ends = ["nan" if size[end] is None else size[end] for end in ("low", "high")]
            said[term["family"], term["on"], size["name"]] = ends
        groups = zip(entry["terms"], entry["parameters"], strict=True)
        intervals = [said[term["family"], term["on"], p["name"]] for term, group in groups for p in group]
        explanations.append(entry | {"intervals": intervals})
    return {**planned, "schema": SCHEMA, "level": LEVEL, "explanations": explanations}


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
        "intervals": _listed(one.intervals),
        "covariance": _listed(one.covariance),
    }


def _explanation_from(data: Mapping[str, Any]) -> Explanation:
    terms = tuple(from_json(term) for term in data["terms"])
    declared = tuple(tuple(map(_parameter, group)) for group in data["parameters"])
    hypothesis = Hypothesis(terms, declared, data["scheme"])
    size = len(hypothesis.parameters)
    matrix = _array(data["covariance"]).reshape(size, size)
    intervals = _array(data["intervals"]).reshape(size, 2)
    return Explanation(hypothesis, float(data["probability"]), matrix, intervals)


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
