"""Gates: effects that act only in a region, or only since a moment.

The effect is fitted in eight bins of a channel (or of time) at once; the run of neighbouring bins that explains most
becomes the region, and its edges are refined one by one.
"""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np

from gpsim.channels import FloatArray
from gpsim.diagnosis.hypothesis import Candidate
from gpsim.diagnosis.problem import Problem
from gpsim.diagnosis.shooting import Fit, fit
from gpsim.effects import Gate

BINS = 8
EDGE_ROUNDS = 3


def gated(
    problem: Problem,
    parent: Fit,
    plain: Fit,
    candidate: Candidate,
    start: tuple[float, ...],
    channel: str | None,
) -> Fit | None:
    """The parent plus the candidate in the best region of `channel` (None: since a moment); None if all bins count.

    plain: the parent plus the candidate everywhere, with which the bins begin.
    """
    edges = _edges(problem, channel)
    if len(edges) < 4:
        return None
    gates = [_gate(channel, low, high, edges[-1]) for low, high in pairwise(edges)]
    binned = parent.hypothesis
    for gate in gates:
        binned = binned.plus(replace(candidate.term(start), gate=gate), candidate.declared)
    size = len(candidate.declared)
    if size != 1:
        return None
    found = fit(problem, binned, plain.starts, iterations=2, tolerance=1.0)
    count = len(gates)
    strength = found.hypothesis.theta[-count:] - candidate.declared[0].none
    run = _best_run(strength, found.information[-count:, -count:], suffix=channel is None)
    if run is None:
        return None
    low, high = edges[run[0]], edges[run[1] + 1]
    value = float(np.average(strength[run[0] : run[1] + 1])) + candidate.declared[0].none
    child = parent.hypothesis.plus(
        replace(candidate.term((value,)), gate=_gate(channel, low, high, edges[-1])), candidate.declared
    )
    return refined(
        problem, fit(problem, child, parent.starts, iterations=8, tolerance=0.5), channel, edges, run
    )


def refined(
    problem: Problem,
    at: Fit,
    channel: str | None,
    edges: FloatArray,
    run: tuple[int, int],
    iterations: int = 3,
) -> Fit:
    """Move each inner edge by shrinking steps while that helps."""
    low, high = float(edges[run[0]]), float(edges[run[1] + 1])
    step = float(np.median(np.diff(edges))) / 2
    movable = ([0] if run[0] > 0 else []) + ([1] if run[1] < len(edges) - 2 else [])
    best = at
    for _ in range(EDGE_ROUNDS):
        for side in movable:
            for direction in (-1.0, 1.0):
                edge = [low, high]
                edge[side] += direction * step
                if edge[1] - edge[0] < step / 2:
                    continue
                term = replace(
                    best.hypothesis.terms[-1], gate=_gate(channel, edge[0], edge[1], float(edges[-1]))
                )
                child = replace(best.hypothesis, terms=(*best.hypothesis.terms[:-1], term))
                tried = fit(problem, child, best.starts, iterations=iterations, tolerance=0.5)
                if tried.objective < best.objective:
                    best, (low, high) = tried, edge
                    break
        step /= 2
    return best


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


def _gate(channel: str | None, low: float, high: float, end: float) -> Gate:
    """`end`: the last edge; an onset has no end."""
    if channel is None:
        return Gate(since=float(low), until=None if high >= end else float(high))
    return Gate(region={channel: (float(low), float(high))})


def _best_run(strength: FloatArray, information: FloatArray, suffix: bool) -> tuple[int, int] | None:
    """First and last bin of the run of equal strength that explains most; None when that is all bins or nothing."""
    pull = information @ strength
    count = len(strength)
    best, whole = 0.0, 0.0
    found: tuple[int, int] | None = None
    for low in range(count):
        for high in range(low, count):
            if suffix and high != count - 1:
                continue
            size = float(information[low : high + 1, low : high + 1].sum())
            worth = float(pull[low : high + 1].sum()) ** 2 / (2 * size) if size > 0 else 0.0
            if (low, high) == (0, count - 1):
                whole = worth
            elif worth > best:
                best, found = worth, (low, high)
    return found if best > whole + 5.0 else None


def region_channels(problem: Problem) -> list[str | None]:
    """Where a gate may look: positions, then time."""
    velocities = {c.velocity for c in problem.simulator.coordinates}
    names = [c.name for c in problem.simulator.state if c.name not in velocities]
    return [*names, None]
