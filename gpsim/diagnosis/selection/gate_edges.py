"""Edges of gates: where they could lie, and where they do: scans of the likelihood that narrow, and joint fits.

A scan finds its way over the steps that an edge makes where it meets a sample; a joint fit follows the valleys in which
both edges and the law's own parameters move together.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from gpsim.channels import FloatArray
from gpsim.diagnosis.fitting import Directions, Fit, Hypothesis, Order, Problem, fit, fit_order
from gpsim.diagnosis.selection.bins import range_around
from gpsim.diagnosis.settings import schedules
from gpsim.effects import EPISODE, FROM, TO, EffectParameter, Gate, LooksAt

PLACES_OF_A_SCAN = 8  # places on each side of an edge that a scan looks at
SCAN_NARROWING = 5.0  # times shorter than the last is the next scan's reach
SCAN_REPEATS = 2  # scans with the same reach that may follow one which moved an edge
INDISTINCT = 0.2  # difference that does not tell two places of an edge apart [nats]
TYPICAL_SHIFT = 0.1  # share of a channel's range that a joint fit takes for the typical size of an edge

EDGES = tuple(  # open on both sides: where they may lie is known to a joint fit only
    EffectParameter(name, "", -np.inf, np.inf, (0.0,), 1.0) for name in (FROM, TO)
)


def gate_between(channel: LooksAt, low: float, high: float, ends: bool) -> Gate:
    """A region of `channel`; where that is None the time from low on, to high where it `ends`; EPISODE: from low on."""
    if channel is EPISODE:
        return Gate(since_episode=int(np.ceil(low)))
    if channel is None:
        return Gate(since=float(low), until=float(high) if ends else None)
    return Gate(region={channel: (float(low), float(high))})


def declared_edges(
    hypothesis: Hypothesis,
    index: int,
    channel: LooksAt,
    low: float,
    high: float,
    ends: bool,
    edges: Sequence[EffectParameter] = EDGES,
) -> Hypothesis:
    """The hypothesis with the edges of one term's gate as parameters more, behind the term's own."""
    gate = gate_between(channel, low, high, ends)
    term = replace(
        hypothesis.terms[index], gate=gate, values={**hypothesis.terms[index].values, FROM: low, TO: high}
    )
    terms, declared = list(hypothesis.terms), list(hypothesis.declared)
    terms[index], declared[index] = term, (*declared[index], *edges)
    return replace(hypothesis, terms=tuple(terms), declared=tuple(declared))


def placed(
    problem: Problem, at: Fit, index: int, share: float, finest: float, budget: float | None = None
) -> Fit:
    """The fit with the movable edges of one term's gate where the likelihood is highest.

    share: of the channel's range, how far the first scan looks on both sides; finest: of the range, the last spacing;
    budget: simulated rows after which no further scan begins, the usual ones by default.
    """
    settings = problem.run.settings.gate_edges
    gate, channel = at.hypothesis.terms[index].gate, at.hypothesis.terms[index].gate.looks_at
    if channel is EPISODE:
        return _first_episode(problem, at, index)
    region = gate.region[channel] if isinstance(channel, str) else None
    outer = range_around(problem, channel, region)
    spread = outer[1] - outer[0]
    reach, stays = share * spread, 0
    sides, most = {0, 1}, problem.run.budget.spent + (settings.budget if budget is None else budget)
    around: Directions | None = None
    while sides and reach / PLACES_OF_A_SCAN > finest * spread and problem.run.budget.spent < most:
        moved, before = False, at
        for side in sorted(sides):
            if _Span.of(at, index, outer).stays(side):
                sides.discard(side)
                continue
            if around is None or around.parent is not at:
                around = Directions(problem, at)
            at, step, tells = _scanned(around, index, outer, side, reach)
            moved |= step > reach / PLACES_OF_A_SCAN
            if not tells:
                sides.discard(side)
        if at is not before:
            at = _joint(problem, at, index, outer)
        stays = 0 if not moved else stays + 1
        if (
            not moved or stays > SCAN_REPEATS
        ):  # a move changes the other edge and the parameters: look as far once more
            reach, stays = reach / SCAN_NARROWING, 0
    return at


def _first_episode(problem: Problem, at: Fit, index: int) -> Fit:
    """The fit with one term since the episode at which the likelihood is highest, from one to the next.

    These windows need not hold any of the one that it is said to have begun with.
    """
    known = np.unique(problem.windows.episode)
    indistinct = INDISTINCT
    for side in (1, -1):
        began = at.hypothesis.terms[index].gate.since_episode
        place = int(np.searchsorted(known, 0 if began is None else began)) + side
        while 0 < place < len(known):
            gated = at.hypothesis.gated(index, Gate(since_episode=int(known[place])))
            tried = fit(problem, gated, at.starts, iterations=schedules.SETTLE, tolerance=schedules.EDGE)
            if tried.objective > at.objective - indistinct:
                break
            at, place = tried, place + side
    return at


@dataclass(frozen=True)
class _Span:
    """What a term's gate lets through, an open edge at the end of the range `outer`; ends: whether it ends at all."""

    channel: LooksAt
    low: float
    high: float
    ends: bool
    outer: tuple[float, float]

    @classmethod
    def of(cls, at: Fit, index: int, outer: tuple[float, float]) -> _Span:
        """That of one term."""
        gate = at.hypothesis.terms[index].gate
        channel = gate.looks_at
        low, high = gate.region[channel] if isinstance(channel, str) else (gate.since, gate.until)
        ends = channel is not None or high is not None
        return cls(channel, outer[0] if low is None else low, outer[1] if high is None else high, ends, outer)

    def inside(self, place: float) -> bool:
        """Whether a place lies inside the range."""
        return self.outer[0] < place < self.outer[1]

    def stays(self, side: int) -> bool:
        """Whether an edge is none: what acts from the start on, or to the end, goes on doing so."""
        return self.channel is None and not self.inside((self.low, self.high)[side])

    @property
    def gate(self) -> Gate:
        """The gate."""
        return gate_between(self.channel, self.low, self.high, self.ends)

    def declared(
        self, hypothesis: Hypothesis, index: int, edges: Sequence[EffectParameter] = EDGES
    ) -> Hypothesis:
        """The hypothesis with `edges` as parameters of the term."""
        return declared_edges(hypothesis, index, self.channel, self.low, self.high, self.ends, edges)


def _scanned(
    around: Directions, index: int, outer: tuple[float, float], side: int, reach: float
) -> tuple[Fit, float, bool]:
    """The fit in the middle of the directions, one edge at the best of many places, all parameters fitted anew there.

    With how far that is, and whether the likelihood tells these places apart.
    """
    problem, at = around.problem, around.parent
    span = _Span.of(at, index, outer)
    edges = np.array([span.low, span.high])
    places = edges[side] + reach * np.linspace(-1, 1, 2 * PLACES_OF_A_SCAN + 1)
    kept = (places > outer[0]) & (places < outer[1])
    kept &= (places < edges[1]) if side == 0 else (places > edges[0])
    kept[PLACES_OF_A_SCAN] = True
    places = places[kept]
    both = np.tile(edges, (len(places), 1))
    both[:, side] = places
    split = sum(len(group) for group in at.hypothesis.declared[: index + 1])
    theta = np.tile(at.hypothesis.theta, (len(places), 1))
    thetas = np.hstack([theta[:, :split], both, theta[:, split:]])
    costs = around.objectives(span.declared(at.hypothesis, index), thetas)
    place = _middle(places, costs, INDISTINCT)
    here = float(costs[np.argmin(np.abs(places - edges[side]))])
    tells = bool(costs.max() > costs.min() + INDISTINCT)
    if costs.min() > here - INDISTINCT:
        return at, 0.0, tells
    moved = replace(span, low=place) if side == 0 else replace(span, high=place)
    hypothesis = at.hypothesis.gated(index, moved.gate)
    tried = fit_order(problem, Order(hypothesis, at.starts, schedules.GLANCE, schedules.EDGE, near=True))
    better = tried.objective < at.objective
    return (tried, abs(place - float(edges[side])), tells) if better else (at, 0.0, tells)


def _joint(problem: Problem, at: Fit, index: int, outer: tuple[float, float]) -> Fit:
    """The fit with the edges that lie inside the range and all parameters fitted together."""
    span = _Span.of(at, index, outer)
    first, last = span.outer
    movable = [e for e, place in zip(EDGES, (span.low, span.high), strict=True) if span.inside(place)]
    free = [replace(e, low=first, high=last, scale=TYPICAL_SHIFT * (last - first)) for e in movable]
    loose = span.declared(at.hypothesis, index, free)
    found = fit_order(problem, Order(loose, at.starts, schedules.SETTLE, schedules.EDGE, near=True))
    values = dict(found.hypothesis.terms[index].values)
    span = replace(span, low=values.pop(FROM), high=values.pop(TO))
    if span.low >= span.high or found.objective >= at.objective:
        return at
    terms = list(found.hypothesis.terms)
    terms[index] = replace(terms[index], values=values, gate=span.gate)
    hypothesis = replace(at.hypothesis, terms=tuple(terms))
    tried = fit(problem, hypothesis, found.starts, iterations=1, near=True)
    return tried if tried.objective < at.objective else at


def _middle(places: FloatArray, costs: FloatArray, indistinct: float) -> float:
    """The middle of the stretch of places around the best that do as well, to `indistinct` nats."""
    best = int(np.argmin(costs))
    good = costs < costs[best] + indistinct
    first = best
    while first > 0 and good[first - 1]:
        first -= 1
    last = best
    while last < len(places) - 1 and good[last + 1]:
        last += 1
    return float(places[first] + places[last]) / 2
