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
from gpsim.effects import EffectParameter, Gate
from gpsim.effects.term import FROM, TO

BINS = 24
WORTH = 5.0  # nats that a gate must promise over the effect everywhere
EDGE_ROUNDS = 5


@dataclass(frozen=True)
class Proposal:
    """A gate worth fitting: its linear gain [nats], the term's value, and the edges between which it is open."""

    gain: float
    candidate: Candidate
    value: float
    channel: str | None
    low: float
    high: float
    pace: float
    movable: tuple[bool, bool]

    @property
    def gate(self) -> Gate:
        """The gate itself; an onset has no end."""
        return gate_of(self.channel, self.low, self.high if self.movable[1] else np.inf)


def gate_of(channel: str | None, low: float, high: float) -> Gate:
    """A region of `channel`, or where that is None the time from low to high."""
    if channel is None:
        return Gate(since=float(low), until=float(high) if np.isfinite(high) else None)
    return Gate(region={channel: (float(low), float(high))})


def proposed(
    problem: Problem,
    directions: Directions,
    candidate: Candidate,
    value: float,
    channels: Sequence[str | None],
) -> list[Proposal]:
    """The best gate of a one-parameter candidate in each channel, where it promises more than acting everywhere."""
    found = (_best_gate(problem, directions, candidate, value, channel) for channel in channels)
    return [proposal for proposal in found if proposal is not None]


def fitted(problem: Problem, parent: Fit, proposal: Proposal) -> Fit:
    """The parent plus the gated term, its inner edges moved by shrinking steps while that helps."""
    term = replace(proposal.candidate.term((proposal.value,)), gate=proposal.gate)
    child = parent.hypothesis.plus(term, proposal.candidate.declared)
    best = fit(problem, child, parent.starts, iterations=8, tolerance=0.5)
    edges, pace = [proposal.low, proposal.high], proposal.pace
    for _ in range(EDGE_ROUNDS):
        for side in (0, 1):
            for direction in (-1.0, 1.0) if proposal.movable[side] else ():
                moved = list(edges)
                moved[side] += direction * pace
                if moved[1] - moved[0] < pace / 2:
                    continue
                gate = replace(proposal, low=moved[0], high=moved[1]).gate
                tried = fit(problem, with_gate(best, gate), best.starts, iterations=3, tolerance=0.5)
                if tried.objective < best.objective:
                    best, edges = tried, moved
                    break
        pace /= 2
    return best


def with_gate(at: Fit, gate: Gate) -> Hypothesis:
    """The fit's hypothesis, its last term behind another gate."""
    terms = at.hypothesis.terms
    return replace(at.hypothesis, terms=(*terms[:-1], replace(terms[-1], gate=gate)))


def _best_gate(
    problem: Problem, directions: Directions, candidate: Candidate, value: float, channel: str | None
) -> Proposal | None:
    edges = _edges(problem, channel)
    if len(edges) < 4:
        return None
    hypothesis, count = directions.parent.hypothesis, len(edges) - 1
    term = replace(candidate.term((value,)), gate=gate_of(channel, edges[0], edges[-1]))
    term = replace(term, values={**term.values, FROM: edges[0], TO: edges[-1]})
    binned = hypothesis.plus(term, (*candidate.declared, _edge(FROM), _edge(TO)))
    thetas = np.array([[*hypothesis.theta, value, low, high] for low, high in pairwise(edges)])
    changes = directions.of(binned, thetas).reshape(count, -1)
    pull, size = changes @ directions.rest.ravel(), changes @ changes.T
    first, last, gain, whole = _best_run(pull, size, suffix=channel is None)
    if gain < whole + WORTH:
        return None
    share = float(pull[first : last + 1].sum() / size[first : last + 1, first : last + 1].sum())
    none = candidate.declared[0].none
    strength = float(
        np.clip(none + share * (value - none), candidate.declared[0].low, candidate.declared[0].high)
    )
    pace = float(np.median(np.diff(edges))) / 2
    movable = (first > 0, last < count - 1)
    return Proposal(gain, candidate, strength, channel, edges[first], edges[last + 1], pace, movable)


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
