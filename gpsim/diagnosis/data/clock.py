"""The recording's clock: where it begins, and how fast it is read.

A clock that was set long before, as the time of day, is read from the recording's start on; a recording at 1 kHz every
10 ms, so that windows span what a system needs to show itself.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from gpsim.channels import FloatArray
from gpsim.recordings import Episode, Recording, apart

KEPT_SHARE = 0.99  # of every action's variance, that the means over skipped samples must keep


def rebased(recording: Recording) -> tuple[Recording, float]:
    """The recording on a clock of its own, and when that one begins on the recording's clock [s].

    0 where the clock began no longer before the recording than it lasts: a battery sags from when it was put in. Of
    several recordings each has a clock of its own, and what is told of them goes by that.
    """
    if recording.sources:
        parts = [rebased(part)[0] for part in apart(recording)]
        episodes = tuple(episode for part in parts for episode in part.episodes)
        named = zip(recording.sources, parts, strict=True)
        sources = tuple(replace(source, held_out=part.held_out) for source, part in named)
        return replace(recording, episodes=episodes, sources=sources), 0.0
    first = min(float(e.t[0]) for e in recording.episodes)
    last = max(float(e.t[-1]) for e in recording.episodes)
    if first <= last - first:
        return recording, 0.0
    held = recording.held_out
    if held is not None and held.time_from is not None:
        held = replace(held, time_from=held.time_from - first)
    episodes = tuple(replace(e, t=e.t - first) for e in recording.episodes)
    return replace(recording, episodes=episodes, held_out=held), first


def thinned(recording: Recording, pace: float) -> tuple[Recording, int]:
    """Every k-th sample and the mean action over each block of k, and k; 1 where nothing was thinned.

    k is about pace / dt, less where commands change so fast that their means would hide them. What is left of an
    episode after its last whole block is left out.
    """
    most = round(pace / recording.dt)
    longest = max(len(episode) for episode in recording.episodes)
    for k in range(min(most, longest), 1, -1):
        if _share_kept(recording, k) >= KEPT_SHARE:
            episodes = tuple(_blocks(episode, k) for episode in recording.episodes)
            return replace(recording, episodes=episodes, dt=k * recording.dt), k
    return recording, 1


def _blocks(episode: Episode, k: int) -> Episode:
    rows = slice(0, len(episode) // k * k + 1, k)
    weights = None if episode.weights is None else episode.weights[rows]
    return replace(
        episode,
        t=episode.t[rows],
        states=episode.states[rows],
        actions=_means(episode, k),
        weights=weights,
    )


def _means(episode: Episode, k: int) -> FloatArray:
    """(K // k, A) time averages of the actions over whole blocks."""
    count = len(episode) // k
    weight = np.diff(episode.t)[: count * k].reshape(count, k, 1)
    actions = episode.actions[: count * k].reshape(count, k, episode.actions.shape[1])
    return np.asarray((actions * weight).sum(axis=1) / weight.sum(axis=1))


def _share_kept(recording: Recording, k: int) -> float:
    """The least share of an action's variance that its means over blocks of k keep; 1 where none is recorded."""
    if not len(recording.action):
        return 1.0
    actions = np.concatenate([e.actions[: len(e) // k * k] for e in recording.episodes])
    held = np.concatenate([np.repeat(_means(e, k), k, axis=0) for e in recording.episodes])
    total = np.maximum(actions.var(axis=0), 1e-300)
    return float(1.0 - (np.mean((actions - held) ** 2, axis=0) / total).max())
