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
from gpsim.diagnosis.fitting import (
    Candidate,
    Directions,
    Fit,
    Hypothesis,
    Order,
    Problem,
    fit,
    fit_all,
    screened,
    starts_of,
    stronger,
)
from gpsim.diagnosis.selection.bins import TURN, bin_edges, goes_round, nearest_turn, turns
from gpsim.diagnosis.selection.gate_edges import declared_edges, gate_between, placed
from gpsim.diagnosis.settings import schedules
from gpsim.effects import EPISODE, LooksAt, effect_of, has_patch

LEAST_BINS = 3  # bins that a channel must fill, for gates to be looked for there
LEAST_GAIN_OF_A_GATE = 5.0  # linear gain that a gate must promise over the term acting everywhere [nats]
PROMISING_GATES = 6  # terms, the best that act everywhere, which are looked at behind gates
GATES_FITTED = 4  # terms behind a gate that are fitted
GATES_PLACED = 2  # terms of those of which the edges are placed
FAR_REACH = 1 / 5  # how far to both sides the first scan looks where an edge is in doubt
NEAR_REACH = 1 / 12  # the same where the edge is known to a bin or two
COARSE_SPACING = 1e-2  # least spacing of a scan where gates are only tried
FINEST_SPACING = 2e-5  # least spacing of a scan for what is answered in the end
THRESHOLD_GAIN = 1.0
"""Gain of thresholds of jumping laws, fitted anew, after which edges are placed once more [nats]."""
TRIAL_BUDGET = 2.5e7
"""The same where gates are only tried [simulated rows] (by hand: 1e7 rows take about a second of one core, and gates
are many)."""

MOMENTS: tuple[LooksAt, ...] = (None, EPISODE)
"""What an onset is one of: it lasts to the end."""


@dataclass(frozen=True)
class Proposal:
    """A gate worth fitting: its linear gain [nats], the term's values, and the edges between which it is open."""

    gain: float
    candidate: Candidate
    values: tuple[float, ...]
    channel: LooksAt
    low: float
    high: float
    ends: bool


def gated_children(
    problem: Problem,
    directions: Directions,
    plain: Sequence[Fit],
    offers: Sequence[Candidate],
    channels: Sequence[LooksAt] | None = None,
    *,
    few: Directions | None = None,
) -> list[Fit]:
    """Terms that did well everywhere once more, each in the region or since the moment that promises most.

    The gated term is the last one; where its edges lie is known to a bin. The best come first.

    channels: where gates may look, None among them for time; `region_channels` unless given. few: directions around the
    same parent on a few windows, to look at all other terms, too; some show behind a gate only. Where these are all
    windows, thresholds are looked at from all their starting values and limits from the lowest, too: acting everywhere
    dilutes one that began late.
    """
    looked_at = region_channels(problem) if channels is None else channels
    promising = sorted(plain, key=lambda f: f.objective)[:PROMISING_GATES]
    best = {f.hypothesis.terms[-1].identity: f for f in reversed(promising)}
    claims = directions.parent.hypothesis.claims
    looks: list[tuple[Directions, Candidate, tuple[float, ...], LooksAt, int]] = []
    for candidate in (c for c in offers if c.gateable and c.identity not in claims):
        family = effect_of(candidate.family).patch_of or candidate.family
        everywhere = best.get((family, candidate.place.on))
        seen = directions
        if everywhere is not None and len(everywhere.hypothesis.declared[-1]) == len(candidate.declared):
            begun = [tuple(map(float, everywhere.hypothesis.theta[-len(candidate.declared) :]))]
        elif candidate.only_gated:  # a narrow one leaves no trace that acting everywhere could explain
            begun = starts_of(candidate)[:1]
        elif few is not None:
            seen, begun = few, [screened(few, [candidate])[0][2]]
        else:
            continue
        if few is directions and any(p.step for p in candidate.declared):
            begun = list(dict.fromkeys([*begun, *starts_of(candidate)]))  # a threshold cannot be stretched
        elif few is directions and any(p.falls for p in candidate.declared):
            begun = [
                *begun,
                tuple(min(p.starts) for p in candidate.declared),
            ]  # a limit out of reach shows nothing
        channels_of = [channel for channel in looked_at if makes_sense(candidate, channel)]
        looks += [(seen, candidate, v, c, len(problem.windows)) for c in channels_of for v in begun]
    proposals = _best_starts([p for p in problem.run.side_by_side(_best_gate, looks) if p is not None])
    # A patch that stops a body gains far more when fitted than its direction promises.
    chosen, others = proposals[:GATES_FITTED], proposals[GATES_FITTED:]
    chosen += [p for p in others if p.candidate.only_gated][:1]
    children = [_child(problem, directions.parent.hypothesis, p) for p in chosen]
    starts = directions.parent.starts
    fits = fit_all(problem, [Order(child, starts, schedules.TRIAL, schedules.ROUGH) for child in children])
    return sorted(fits, key=lambda f: f.objective)


def with_edges(problem: Problem, children: Sequence[Fit], count: int | None = None) -> list[Fit]:
    """The gated children, of which the best `count` have their edges placed, and the best one's closely."""
    count = GATES_PLACED if count is None else count
    how = (NEAR_REACH, COARSE_SPACING, TRIAL_BUDGET)
    fits = sorted(children, key=lambda f: f.objective)
    calls = [(problem, f, len(f.hypothesis.terms) - 1, *how) for f in fits[:count]]
    coarse = sorted(problem.run.side_by_side(placed, calls), key=lambda f: f.objective)
    # What an edge that is a little off leaves over would soon pass for another effect.
    closely = (NEAR_REACH, FINEST_SPACING)
    best = [placed(problem, f, len(f.hypothesis.terms) - 1, *closely) for f in coarse[:1]]
    return best + coarse[1:] + fits[count:]


def _best_starts(proposals: Sequence[Proposal]) -> list[Proposal]:
    """Of each term and channel the proposal that promises most, the best first."""
    best: dict[tuple[object, ...], Proposal] = {}
    for p in sorted(proposals, key=lambda p: -p.gain):
        best.setdefault((p.candidate.identity, p.candidate.variant, p.channel), p)
    return list(best.values())


def with_refined_edges(problem: Problem, at: Fit, finest: float) -> Fit:
    """A fit with the edges of its gates where the likelihood is highest, to a share of their channels' ranges."""
    gated = [i for i, term in enumerate(at.hypothesis.terms) if term.gate]
    for index in gated:
        at = placed(problem, at, index, FAR_REACH, finest)
    if gated and any(p.step for p in at.hypothesis.parameters):  # thresholds were held where they stood
        steps = schedules.THRESHOLDS
        again = fit(problem, at.hypothesis, at.starts, iterations=steps)
        moved = again.objective < at.objective - THRESHOLD_GAIN
        at = min(at, again, key=lambda f: f.objective)
        if moved:
            for index in gated:
                at = placed(problem, at, index, NEAR_REACH, finest)
    return at


def makes_sense(candidate: Candidate, channel: LooksAt) -> bool:
    """A law in a region of its own coordinate may be a family of its own, a patch, and is nothing else then."""
    if candidate.only_gated:
        return channel == candidate.place.on
    return not (has_patch(candidate.family) and channel == candidate.place.on)


def _child(problem: Problem, parent: Hypothesis, p: Proposal) -> Hypothesis:
    """The parent with the proposed term; a region of an angle in the turn in which the parent's regions of it lie."""
    others = [r for t in parent.terms for name, r in t.gate.region.items() if name == p.channel]
    moved = 0.0
    if others and turns(problem, p.channel):
        moved = nearest_turn(sum(others[0]) / 2, (p.low + p.high) / 2)
    gate = gate_between(p.channel, p.low + moved, p.high + moved, p.ends)
    return parent.plus(replace(p.candidate.term(p.values), gate=gate), p.candidate.declared)


def _best_gate(
    directions: Directions,
    candidate: Candidate,
    values: tuple[float, ...],
    channel: LooksAt,
    count_windows: int,
) -> Proposal | None:
    """The run of bins that promises most over acting everywhere; its gain is that on so many windows."""
    edges = bin_edges(directions.problem, channel)
    if len(edges) <= LEAST_BINS:
        return None
    count = len(edges) - 1
    changes = _by_bin(directions, candidate, values, channel, edges)
    pull, size = changes @ directions.rest.ravel(), changes @ changes.T
    circle = goes_round(directions.problem, channel, edges)
    first, last, gain, whole = _best_run(pull, size, suffix=channel in MOMENTS, circle=circle)
    more = count_windows / len(directions.problem.windows)
    if more * (gain - whole) < LEAST_GAIN_OF_A_GATE:
        return None
    if len(values) == 1:  # acting everywhere diluted it
        bins = np.arange(first, last + 1) % count
        times = float(pull[bins].sum() / size[np.ix_(bins, bins)].sum())
        values = (stronger(candidate.declared[0], values[0], times),)
    high = edges[last + 1] if last < count else edges[last + 1 - count] + TURN
    ends = last < count - 1
    return Proposal(more * gain, candidate, values, channel, float(edges[first]), float(high), ends)


def may_be_limited(
    around: Directions, without: Directions, candidate: Candidate, values: tuple[float, ...]
) -> list[LooksAt]:
    """Channels on which a term that acts everywhere could as well act in a region, from what it does in each bin.

    around: at the hypothesis with the term; without: at the one without it, in units of the first one's residual. Where
    taking the term out of some bins would make a residual worse that is as good as noise, no gate can be right.
    """
    return [
        channel
        for channel in region_channels(without.problem)
        if makes_sense(candidate, channel) and _spares(around, without, candidate, values, channel)
    ]


def _spares(
    around: Directions,
    without: Directions,
    candidate: Candidate,
    values: tuple[float, ...],
    channel: LooksAt,
) -> bool:
    edges = bin_edges(without.problem, channel)
    if len(edges) <= LEAST_BINS:
        return False
    changes = _by_bin(without, candidate, values, channel, edges)
    pull, size = changes @ around.rest.ravel(), changes @ changes.T
    count, circle = len(pull), goes_round(without.problem, channel, edges)
    for first in range(count):
        for last in range(first, count):
            if (channel in MOMENTS and last < count - 1) or last - first == count - 1:
                continue
            inside = np.zeros(count, dtype=np.bool_)
            inside[first : last + 1] = True
            for out in (~inside, inside) if circle else (~inside,):  # the rest of a circle is a region, too
                if -float(pull[out].sum()) > 0.5 * float(size[np.ix_(out, out)].sum()):
                    return True
    return False


def _by_bin(
    directions: Directions,
    candidate: Candidate,
    values: tuple[float, ...],
    channel: LooksAt,
    edges: FloatArray,
) -> FloatArray:
    """(bins, N): what the term takes off the residual when it acts in one bin of the channel alone."""
    hypothesis = directions.parent.hypothesis
    plain = hypothesis.plus(candidate.term(values), candidate.declared)
    if channel is EPISODE:
        return _by_episodes(directions, plain, np.array([*hypothesis.theta, *values]), edges)
    binned = declared_edges(plain, len(hypothesis.terms), channel, float(edges[0]), float(edges[-1]), True)
    thetas = np.array([[*hypothesis.theta, *values, low, high] for low, high in pairwise(edges)])
    return directions.of(binned, thetas).reshape(len(edges) - 1, -1)


def _by_episodes(
    directions: Directions, plain: Hypothesis, theta: FloatArray, edges: FloatArray
) -> FloatArray:
    """The same of a term that acts everywhere in some episodes: a window lies in one."""
    problem, parent = directions.problem, directions.parent
    (acting,) = problem.residuals(plain, theta[None], parent.starts[None])
    which = np.searchsorted(edges, problem.windows.episode) - 1
    bins = np.arange(len(edges) - 1)[:, None, None, None]
    inside = which[None, :, None, None] == bins
    return directions.changes(np.where(inside, acting, parent.residuals)).reshape(len(bins), -1)


def _best_run(
    pull: FloatArray, size: FloatArray, *, suffix: bool = False, circle: bool = False
) -> tuple[int, int, float, float]:
    """First and last bin of the run that explains most, its gain and that of all bins together [nats].

    suffix: runs go to the end. circle: they may go on from the last bin to the first, which is counted on then.
    """
    count = len(pull)
    if circle:
        pull, size = np.tile(pull, 2), np.tile(size, (2, 2))
    gains = np.zeros((count, len(pull)))
    for first in range(count):
        for last in range(first, min(first + count - (first > 0), len(pull))):
            square = float(size[first : last + 1, first : last + 1].sum())
            if square > 0 and not (suffix and last < count - 1):
                gains[first, last] = max(float(pull[first : last + 1].sum()), 0.0) ** 2 / (2 * square)
    whole, gains[0, count - 1] = float(gains[0, count - 1]), 0.0
    first, last = (int(i) for i in np.unravel_index(int(np.argmax(gains)), gains.shape))
    return first, last, float(gains[first, last]), whole


def moments(problem: Problem) -> list[LooksAt]:
    """Where an onset may be looked for: time, and which episode it is where their clocks begin anew."""
    return list(MOMENTS) if problem.windows.own_clocks else [None]


def region_channels(problem: Problem) -> list[LooksAt]:
    """Where a gate may look: positions, then moments."""
    simulator = problem.simulator
    others = {*(c.velocity for c in simulator.coordinates), *simulator.as_measured}
    names = [c.name for c in simulator.state if c.name not in others]
    return [*names, *moments(problem)]
