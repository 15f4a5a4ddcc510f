"""Gates: effects that act only in a region, or only since a moment.

The effect is switched on in one of many bins of a channel (or of time) at a time; from these directions the linear
gain of every run of neighbouring bins follows at once. The best runs are fitted, and their edges refined one by one.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from gpsim.channels import FloatArray
from gpsim.diagnosis.hypothesis import Candidate, Hypothesis
from gpsim.diagnosis.problem import Problem
from gpsim.diagnosis.screening import Directions
from gpsim.diagnosis.shooting import Fit, fit
from gpsim.diagnosis.workers import Order, fit_all
from gpsim.effects import EffectParameter, Gate
from gpsim.effects.term import FROM, TO

BINS = 24
GATED, PROMISING = 4, 6  # gated terms that are fitted, of so many plain ones
WORTH = 5.0  # nats that a gate must promise over the effect everywhere
EDGE_ROUNDS = 5


@dataclass(frozen=True)
class Proposal:
    """A gate worth fitting: its linear gain [nats], the term's values, and the edges between which it is open."""

    gain: float
    candidate: Candidate
    values: tuple[float, ...]
    channel: str | None
    low: float
    high: float
    pace: float
    movable: tuple[bool, bool]


def gated_children(
    problem: Problem, directions: Directions, plain: Sequence[Fit], offers: Sequence[Candidate]
) -> list[Fit]:
    """Terms that did well everywhere once more, each in the region or since the moment that promises most."""
    promising = sorted(plain, key=lambda f: f.objective)[:PROMISING]
    best = {f.hypothesis.terms[-1].identity: f for f in reversed(promising)}
    claims = directions.parent.hypothesis.claims
    proposals: list[Proposal] = []
    for candidate in (c for c in offers if c.gateable and c.identity not in claims):
        family = "coulomb_friction" if candidate.only_gated else candidate.family
        everywhere = best.get((family, candidate.place.on))
        if everywhere is None or len(everywhere.hypothesis.declared[-1]) != len(candidate.declared):
            continue
        values = tuple(everywhere.hypothesis.theta[-len(candidate.declared) :])
        found = (
            _best_gate(problem, directions, candidate, values, channel)
            for channel in region_channels(problem)
            if _makes_sense(candidate, channel)
        )
        proposals += [proposal for proposal in found if proposal is not None]
    proposals.sort(key=lambda p: -p.gain)
    children = [_child(directions.parent.hypothesis, proposal) for proposal in proposals[:GATED]]
    fits = fit_all(problem, [Order(child, directions.parent.starts, 8) for child in children])
    return [_refined(problem, f, p) for f, p in zip(fits, proposals, strict=False)]


def polished(problem: Problem, at: Fit) -> Fit:
    """A fit with the inner edges of its gates moved by shrinking steps while that helps."""
    for index, term in enumerate(at.hypothesis.terms):
        if not term.gate:
            continue
        channel = next(iter(term.gate.region), None)
        edges = _edges(problem, channel)
        low, high = term.gate.region[channel] if channel else (term.gate.since, term.gate.until)
        low, high = (float(edges[0] if low is None else low), float(edges[-1] if high is None else high))
        movable = (low > edges[0], high < edges[-1])
        pace = float(edges[-1] - edges[0]) / (4 * BINS)
        at = _moved(problem, at, index, channel, (low, high), movable, pace)
    return at


def _makes_sense(candidate: Candidate, channel: str | None) -> bool:
    """Coulomb friction in a region of its own coordinate is a patch, which has its own family, and is nothing else."""
    if candidate.only_gated:
        return channel == candidate.place.on
    return not (candidate.family == "coulomb_friction" and channel == candidate.place.on)


def _child(parent: Hypothesis, p: Proposal) -> Hypothesis:
    gate = _gate(p.channel, p.low, p.high, p.movable[1])
    return parent.plus(replace(p.candidate.term(p.values), gate=gate), p.candidate.declared)


def _refined(problem: Problem, at: Fit, p: Proposal) -> Fit:
    return _moved(problem, at, len(at.hypothesis.terms) - 1, p.channel, (p.low, p.high), p.movable, p.pace)


def _moved(
    problem: Problem,
    best: Fit,
    index: int,
    channel: str | None,
    edges: tuple[float, float],
    movable: tuple[bool, bool],
    pace: float,
) -> Fit:
    """The fit with the edges of one term's gate moved by steps that shrink from `pace`, while that helps."""
    at = list(edges)
    for _ in range(EDGE_ROUNDS):
        for side in (0, 1):
            for direction in (-1.0, 1.0) if movable[side] else ():
                moved = list(at)
                moved[side] += direction * pace
                if moved[1] - moved[0] < pace / 2:
                    continue
                hypothesis = best.hypothesis.gated(index, _gate(channel, moved[0], moved[1], movable[1]))
                tried = fit(problem, hypothesis, best.starts, iterations=3, tolerance=0.5)
                if tried.objective < best.objective:
                    best, at = tried, moved
                    break
        pace /= 2
    return best


def _gate(channel: str | None, low: float, high: float, ends: bool) -> Gate:
    """A region of `channel`, or where that is None the time from low on, to high where it `ends`."""
    if channel is None:
        return Gate(since=float(low), until=float(high) if ends else None)
    return Gate(region={channel: (float(low), float(high))})


def _best_gate(
    problem: Problem,
    directions: Directions,
    candidate: Candidate,
    values: tuple[float, ...],
    channel: str | None,
) -> Proposal | None:
    edges = _edges(problem, channel)
    if len(edges) < 4:
        return None
    hypothesis, count = directions.parent.hypothesis, len(edges) - 1
    term = replace(candidate.term(values), gate=_gate(channel, edges[0], edges[-1], True))
    term = replace(term, values={**term.values, FROM: edges[0], TO: edges[-1]})
    binned = hypothesis.plus(term, (*candidate.declared, _edge(FROM), _edge(TO)))
    thetas = np.array([[*hypothesis.theta, *values, low, high] for low, high in pairwise(edges)])
    changes = directions.of(binned, thetas).reshape(count, -1)
    pull, size = changes @ directions.rest.ravel(), changes @ changes.T
    first, last, gain, whole = _best_run(pull, size, suffix=channel is None)
    if gain < whole + WORTH:
        return None
    if len(values) == 1:  # a law that grows with its only parameter, which acting everywhere diluted
        share = float(pull[first : last + 1].sum() / size[first : last + 1, first : last + 1].sum())
        p = candidate.declared[0]
        values = (float(np.clip(p.none + share * (values[0] - p.none), p.low, p.high)),)
    pace = float(np.median(np.diff(edges))) / 2
    movable = (first > 0, last < count - 1)
    return Proposal(gain, candidate, values, channel, edges[first], edges[last + 1], pace, movable)


def _edge(name: str) -> EffectParameter:
    return EffectParameter(name, "", -np.inf, np.inf, (0.0,), 1.0)


def _best_run(pull: FloatArray, size: FloatArray, suffix: bool) -> tuple[int, int, float, float]:
    """First and last bin of the run that explains most, its gain and that of all bins together [nats]."""
    count = len(pull)
    gains = np.zeros((count, count))
    for first in range(count):
        for last in range(first, count):
            square = float(size[first : last + 1, first : last + 1].sum())
            if square > 0 and not (suffix and last < count - 1):
                gains[first, last] = max(float(pull[first : last + 1].sum()), 0.0) ** 2 / (2 * square)
    whole, gains[0, -1] = float(gains[0, -1]), 0.0
    first, last = (int(i) for i in np.unravel_index(int(np.argmax(gains)), gains.shape))
    return first, last, float(gains[first, last]), whole


def _edges(problem: Problem, channel: str | None) -> FloatArray:
    """Bin edges: outer ones open, inner ones quantiles."""
    windows = problem.windows
    if channel is None:
        values = windows.t[windows.valid]
    else:
        names = problem.simulator.state.names
        if channel in names:
            values = windows.measured[..., names.index(channel)][windows.valid]
        else:
            values = windows.actions[..., problem.simulator.action.index(channel)].ravel()
    inner = np.unique(np.quantile(values, np.linspace(0, 1, BINS + 1)))
    if len(inner) < 2:
        return inner
    margin = 0.05 * (inner[-1] - inner[0])
    inner[0] -= margin
    inner[-1] += margin
    return inner


def region_channels(problem: Problem) -> list[str | None]:
    """Where a gate may look: positions, then time."""
    velocities = {c.velocity for c in problem.simulator.coordinates}
    names = [c.name for c in problem.simulator.state if c.name not in velocities]
    return [*names, None]
