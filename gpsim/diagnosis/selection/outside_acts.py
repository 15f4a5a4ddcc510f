"""Moments at which something from outside acted: a hand that pushes, a bump, a wheel that leaves the ground.

One such moment may cost a fit more than all others together, and buys laws that say nothing of the machine. A stretch
is left out where the best of the search misses it by far more than all others, and where the same places and commands
were met elsewhere without anything of the sort: what a law of the machine does, it does again. A stop that is hit once
counts as such a bump, unless that happens at an end of the way.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.spatial import cKDTree

from gpsim.channels import BoolArray, FloatArray, IntArray
from gpsim.diagnosis.data import Windows
from gpsim.diagnosis.fitting import Hypothesis, Problem
from gpsim.diagnosis.report import LogFact
from gpsim.diagnosis.selection.heavy_tails import NORMAL_MEDIAN
from gpsim.diagnosis.selection.held_out import held_out_fit
from gpsim.diagnosis.setup import Question
from gpsim.recordings import Episode, Recording

TIMES = 50.0  # the median window's cost, that such a window's is at least (by reason: seven times the usual error)
MOST = 0.03  # of all windows, that may be left out: where more are missed it is no accident
RULES = 0.5  # of what all windows cost, that those left out cost together: others rule no fit
FEWEST = 20  # windows: of fewer nobody can say what is usual
ELSEWHERE = (
    0.99  # quantile of how far samples lie from those of other windows: nearer ones were met elsewhere
)
AT_AN_END = 0.1  # of a coordinate's way, that counts as its end
SHORTEST = 4  # transitions of windows: in shorter ones nothing bends
TINY = 1e-300  # guards a division by channels that stand still

Span = tuple[int, float, float]
"""An episode, and from when to when [s]."""


def without_outside_acts(
    question: Question, best: Hypothesis, recording: Recording
) -> tuple[Recording, LogFact] | None:
    """The recording without these moments, and what is said of them; None where there are none.

    best: the explanation that misses them. A stretch in which no sample counts is a gap (see `gpsim.diagnosis.data`).
    """
    problems = [p for p in (question.everything, question.held_out) if len(p.windows)]
    if sum(len(p.windows) for p in problems) < FEWEST or problems[0].windows.length < SHORTEST:
        return None
    found = [_missed(p, best) for p in problems]
    costs = [cost for cost, _ in found]
    every = np.concatenate(costs)
    far = [cost > TIMES * float(np.median(every)) for cost in costs]
    if not _few_that_rule(costs, far):
        return None
    inner = _inside_the_way(problems, [when for _, when in found])
    out = [f & m & i for f, m, i in zip(far, _met_elsewhere(problems, far), inner, strict=True)]
    if not _few_that_rule(costs, out):
        return None
    spans = [span for p, part in zip(problems, out, strict=True) for span in _spans(p.windows.take(part))]
    inside = [_inside(i, e.t, spans) for i, e in enumerate(recording.episodes)]
    episodes = tuple(_without(e, rows) for e, rows in zip(recording.episodes, inside, strict=True))
    samples, first = sum(int(rows.sum()) for rows in inside), min(begin for _, begin, _ in spans)
    return replace(recording, episodes=episodes), LogFact("pushed", count=samples, value=first, unit="s")


def _few_that_rule(costs: Sequence[FloatArray], which: Sequence[BoolArray]) -> bool:
    """Whether some windows, and few of them, cost most of what all cost."""
    count, windows = sum(int(part.sum()) for part in which), sum(len(cost) for cost in costs)
    gone = sum(float(cost[part].sum()) for cost, part in zip(costs, which, strict=True))
    return 0 < count <= max(MOST * windows, 1.0) and gone >= RULES * sum(float(cost.sum()) for cost in costs)


def _missed(problem: Problem, best: Hypothesis) -> tuple[FloatArray, IntArray]:
    """(W,) the mean square that each window leaves, in parts of what is usual, and where it bends most."""
    windows = problem.windows
    at = held_out_fit(problem, best)
    counted = problem.counted & np.ones_like(at.residuals, dtype=np.bool_)
    total, samples = np.zeros(len(windows)), np.zeros(len(windows))
    bend = np.zeros((len(windows), windows.length - 1))
    for i in np.flatnonzero(problem.observed).tolist():
        own, off = counted[..., i], np.where(counted[..., i], at.residuals[..., i], 0.0)
        usual = max(float(np.median(np.abs(off[own]))) / NORMAL_MEDIAN, float(problem.floor[i]), TINY)
        total += ((off / usual) ** 2).sum(axis=1)
        samples += own.sum(axis=1)
        bend += np.abs(np.diff(off / usual, n=2, axis=1))
    return total / np.maximum(samples, 1.0), bend.argmax(axis=1) + 1


def _inside_the_way(problems: Sequence[Problem], when: Sequence[IntArray]) -> list[BoolArray]:
    """(W,) of each problem, whether that sample lies off both ends of the way of every coordinate, where stops are."""
    state = problems[0].simulator.state
    names = [c.name for c in problems[0].simulator.coordinates]
    columns = [
        i
        for i, (n, wraps) in enumerate(zip(state.names, state.wraps, strict=True))
        if n in names and not wraps
    ]
    places = [p.windows.measured[..., columns] for p in problems]
    if not columns:
        return [np.ones(len(x), dtype=np.bool_) for x in places]
    rows = np.concatenate([x.reshape(-1, len(columns)) for x in places])
    low, high = rows.min(axis=0), rows.max(axis=0)
    margin = AT_AN_END * (high - low)
    moments = [x[np.arange(len(x)), k] for x, k in zip(places, when, strict=True)]
    return [((m > low + margin) & (m < high - margin)).all(axis=1) for m in moments]


def _met_elsewhere(problems: Sequence[Problem], far: Sequence[BoolArray]) -> list[BoolArray]:
    """(W,) of each problem, whether a window far off lies as near to others in places and commands as is usual."""
    points = [_points(p) for p in problems]
    usual = [p[~f] for p, f in zip(points, far, strict=True)]
    rows = np.concatenate([p.reshape(-1, p.shape[2]) for p in usual])
    spread = rows.std(axis=0)
    scale = np.where(spread > 0.0, spread, 1.0)
    whole = [p / scale for p in usual]
    first, second = (np.concatenate([p[k::2].reshape(-1, p.shape[2]) for p in whole]) for k in (0, 1))
    within = float(np.quantile(cKDTree(first).query(second)[0], ELSEWHERE))
    tree = cKDTree(rows / scale)
    out = [np.zeros(len(p), dtype=np.bool_) for p in points]
    for met, own, f in zip(out, points, far, strict=True):
        met[f] = [np.median(tree.query(window / scale)[0]) <= within for window in own[f]]
    return out


def _points(problem: Problem) -> FloatArray:
    """(W, L, S + A) places and commands of all windows, and the speeds at which they begin.

    A push changes speeds as nothing else does: they say little of whether a law could have done it. Of a channel that
    wraps there are sine and cosine.
    """
    windows, state = problem.windows, problem.simulator.state
    speeds = {c.velocity for c in problem.simulator.coordinates}
    parts: list[FloatArray] = []
    for i, (name, wraps) in enumerate(zip(state.names, state.wraps, strict=True)):
        x = windows.measured[:, :-1, i]
        x = np.broadcast_to(x[:, :1], x.shape) if name in speeds else x
        parts += [np.sin(x), np.cos(x)] if wraps else [x]
    return np.concatenate([np.stack(parts, axis=-1), windows.actions], axis=-1)


def _spans(windows: Windows) -> list[Span]:
    ends = [float(t[valid][-1]) for t, valid in zip(windows.t, windows.valid, strict=True)]
    return [(int(e), float(t[0]), end) for e, t, end in zip(windows.episode, windows.t, ends, strict=True)]


def _inside(episode: int, t: FloatArray, spans: Sequence[Span]) -> BoolArray:
    """Which moments [s] of an episode lie in one of the spans."""
    own = [(begin, end) for e, begin, end in spans if e == episode]
    inside = [(t >= begin) & (t <= end) for begin, end in own]
    return np.any(inside, axis=0) if inside else np.zeros(t.shape, dtype=np.bool_)


def _without(episode: Episode, inside: BoolArray) -> Episode:
    if not inside.any():
        return episode
    weights = np.ones(episode.states.shape) if episode.weights is None else np.array(episode.weights)
    weights[inside] = 0.0
    return replace(episode, weights=weights)
