"""Bins of a channel, or of time: how a gate's place is looked for, and how far its edges may move.

An angle that wraps is a circle. Where part of it was never visited it is cut there and is a line like any other; where
it was visited all round, bins and regions go on over the cut.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from gpsim.channels import FloatArray, IntArray, wrap_angle
from gpsim.diagnosis.fitting import Problem
from gpsim.diagnosis.settings import GateSettings
from gpsim.effects import EPISODE, LooksAt, closed
from gpsim.recordings import evenly

BINS_OF_A_ROBOT = 12  # bins of a channel, or of time, in one of which a term is switched on at a time
EDGE_MARGIN = 0.05  # share of a channel's range by which the outer edges lie beyond what was visited

TURN = 2.0 * np.pi  # of a circle, in radians


def bin_edges(problem: Problem, channel: LooksAt) -> FloatArray:
    """Edges of a channel's bins, of time where it is None, of EPISODE: outer ones open, inner ones quantiles.

    Those of an angle that wraps go round the circle once at most, from where it was not visited.
    """
    windows, settings = problem.windows, problem.run.settings.gates
    if closed(problem.simulator) is not None:
        settings = replace(settings, bins=BINS_OF_A_ROBOT)
    if channel is EPISODE:
        return _between_episodes(settings, windows.episode)
    if channel is None:
        return _bins(settings, windows.t[windows.valid])
    names = problem.simulator.state.names
    if channel not in names:
        return _bins(settings, windows.actions[..., problem.simulator.action.index(channel)].ravel())
    values = windows.measured[..., names.index(channel)][windows.valid]
    if turns(problem, channel) and (1 + 2 * EDGE_MARGIN) * np.ptp(values) > TURN:
        return _round_bins(settings, values)
    return _bins(settings, values)


def turns(problem: Problem, channel: LooksAt) -> bool:
    """Whether a channel is an angle known modulo a whole turn."""
    state = problem.simulator.state
    return channel in state.names and bool(state.wraps[state.names.index(channel)])


def goes_round(problem: Problem, channel: LooksAt, edges: FloatArray) -> bool:
    """Whether the last bin of an angle has the first one for a neighbour."""
    return turns(problem, channel) and bool(np.isclose(edges[-1] - edges[0], TURN, rtol=1e-9))


def range_around(
    problem: Problem, channel: LooksAt, region: tuple[float, float] | None
) -> tuple[float, float]:
    """Between which values the edges of a region of `channel` may move, in the turn in which the region lies."""
    edges = bin_edges(problem, channel)
    first, last = float(edges[0]), float(edges[-1])
    if region is None or not turns(problem, channel):
        return first, last
    middle = (region[0] + region[1]) / 2
    if goes_round(problem, channel, edges):
        return middle - TURN / 2, middle + TURN / 2
    moved = nearest_turn(middle, (first + last) / 2)
    return first + moved, last + moved


def nearest_turn(angle: float, other: float) -> float:
    """How far to move `other`, by whole turns, to bring it next to `angle`."""
    return TURN * round((angle - other) / TURN)


def _between_episodes(settings: GateSettings, episodes: IntArray) -> FloatArray:
    """Edges between episodes, and before the first and behind the last; as many bins at most."""
    known = np.unique(episodes)
    return np.append(known[evenly(len(known), settings.bins)], known[-1] + 1) - 0.5


def _bins(
    settings: GateSettings, values: FloatArray, least: float = -np.inf, most: float = np.inf
) -> FloatArray:
    """Edges of bins that hold equally many values, the outer ones no further out than least and most."""
    inner = np.unique(np.quantile(values, np.linspace(0, 1, settings.bins + 1)))
    if len(inner) < 2:
        return inner
    margin = EDGE_MARGIN * (inner[-1] - inner[0])
    inner[0] = max(inner[0] - margin, least)
    inner[-1] = min(inner[-1] + margin, most)
    return inner


def _round_bins(settings: GateSettings, angles: FloatArray) -> FloatArray:
    """The same of angles all round: the circle is cut in the middle of its widest gap, at pi where it has none."""
    visited = np.sort(wrap_angle(angles))
    gaps = np.diff(visited, append=visited[0] + TURN)
    widest = int(np.argmax(gaps))
    if gaps[widest] <= TURN / settings.bins:
        inner = np.quantile(wrap_angle(angles), np.linspace(0, 1, settings.bins + 1)[1:-1])
        return np.unique([-np.pi, *inner, np.pi])
    cut = float(visited[widest] + gaps[widest] / 2)
    cut -= TURN * round((cut - np.pi) / TURN)  # what lies opposite is in the usual turn
    first = cut - TURN
    return _bins(settings, first + np.mod(angles - first, TURN), first, cut)
