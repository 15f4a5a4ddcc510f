"""Pushes: moments at which something from outside acted, a hand, a bump, a wheel that leaves the ground.

One such moment may cost a fit more than all others together, and buys laws that say nothing of the machine. A window is
left out where the usual machine misses it by far more than all others, where few are, and where the same places and
commands were met elsewhere without anything of the sort: what a law of the machine does, it does again.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from gpsim.channels import BoolArray, FloatArray
from gpsim.diagnosis.data import Windows
from gpsim.diagnosis.fitting import Problem
from gpsim.diagnosis.ladder.search import Search
from gpsim.diagnosis.settings import PushSettings
from gpsim.diagnosis.setup import PreparedProblem
from gpsim.findings import LogFact
from gpsim.recordings import Episode

FEWEST = 20  # windows: of fewer nobody can say what is usual


def without_pushes(question: PreparedProblem, search: Search) -> PreparedProblem | None:
    """The question without these moments, and what is said of them; None where there are none."""
    problem = search.shooting.problem
    windows = problem.windows
    if len(windows) < FEWEST or search.dear:
        return None
    plain = search.shooting.base_weights / search.shooting.noise.white
    squares = ((search.account.fit.residuals * plain) ** 2).sum(axis=2)
    costs = squares.sum(axis=1) / np.maximum(windows.valid.sum(axis=1), 1)
    numbers = problem.run.settings.pushes
    far = costs > numbers.times * np.median(costs)
    base = ((search.base.residuals * plain) ** 2).sum(axis=2).sum(axis=1)
    unexplained = 1.0 - search.verdict.nearly_all  # else laws are right about it, and it is large
    far &= squares.sum(axis=1) > unexplained * base
    if not _few_that_rule(costs, far, numbers):
        return None
    far &= _met_elsewhere(problem, far)
    if not _few_that_rule(costs, far, numbers):
        return None
    spans = [
        (int(e), float(t[0]), float(t[valid][-1]))
        for e, t, valid in zip(windows.episode[far], windows.t[far], windows.valid[far], strict=True)
    ]
    inside = [_inside(i, e.t, spans) for i, e in enumerate(question.recording.episodes)]
    episodes = tuple(_without(e, rows) for e, rows in zip(question.recording.episodes, inside, strict=True))
    count, first = sum(int(rows.sum()) for rows in inside), min(begin for _, begin, _ in spans)
    fact = LogFact("pushed", count=count, value=first + question.origin, unit="s")

    def kept(part: Problem) -> Problem:
        own = part.windows
        hit = [
            any(e == s[0] and t[0] <= s[2] and t[-1] >= s[1] for s in spans)
            for e, t in zip(own.episode, own.t, strict=True)
        ]
        return part.on(own.take(~np.array(hit, dtype=np.bool_)))

    return replace(
        question,
        recording=replace(question.recording, episodes=episodes),
        everything=kept(question.everything),
        searched=kept(question.searched),
        held_out=kept(question.held_out) if len(question.held_out.windows) else question.held_out,
        facts=(*question.facts, fact),
    )


def _few_that_rule(costs: FloatArray, which: BoolArray, numbers: PushSettings) -> bool:
    """Whether some windows, and few of them, cost most of what all cost."""
    few = 0 < int(which.sum()) <= max(numbers.most * len(costs), 1.0)
    return few and float(costs[which].sum()) >= numbers.rules * float(costs.sum())


def _met_elsewhere(problem: Problem, far: BoolArray) -> BoolArray:
    """(W,) whether a window far off lies as near to others in places and commands as is usual."""
    from scipy.spatial import cKDTree  # most recordings never ask

    points = _points(problem.windows, problem)
    usual = points[~far]
    spread = usual.reshape(-1, points.shape[2]).std(axis=0)
    scale = np.where(spread > 0.0, spread, 1.0)
    first, second = ((usual[k::2] / scale).reshape(-1, points.shape[2]) for k in (0, 1))
    within = float(np.quantile(cKDTree(first).query(second)[0], problem.run.settings.pushes.elsewhere))
    tree = cKDTree((usual / scale).reshape(-1, points.shape[2]))
    met = np.zeros(len(far), dtype=np.bool_)
    met[far] = [np.median(tree.query(window / scale)[0]) <= within for window in points[far]]
    return met


def _points(windows: Windows, problem: Problem) -> FloatArray:
    """(W, L, S + A) places and commands of all windows, and the speeds at which they begin: a push changes speeds."""
    speeds = {c.velocity for c in problem.simulator.coordinates}
    parts: list[FloatArray] = []
    for i, channel in enumerate(problem.simulator.state):
        x = windows.measured[:, :-1, i]
        x = np.broadcast_to(x[:, :1], x.shape) if channel.name in speeds else x
        parts += [np.sin(x), np.cos(x)] if channel.wraps else [x]
    return np.concatenate([np.stack(parts, axis=-1), windows.actions], axis=-1)


def _inside(episode: int, t: FloatArray, spans: Sequence[tuple[int, float, float]]) -> BoolArray:
    """Which moments [s] of an episode lie in one of the spans."""
    out = np.zeros(t.shape, dtype=np.bool_)
    for e, begin, end in spans:
        if e == episode:
            out |= (t >= begin) & (t <= end)
    return out


def _without(episode: Episode, inside: BoolArray) -> Episode:
    if not inside.any():
        return episode
    weights = np.ones(episode.states.shape) if episode.weights is None else np.array(episode.weights)
    weights[inside] = 0.0
    return replace(episode, weights=weights)
