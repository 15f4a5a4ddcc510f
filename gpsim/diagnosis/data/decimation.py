"""Fast clocks: a recording at 1 kHz is read every 10 ms, so that windows span what a system needs to show itself."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from gpsim.channels import FloatArray
from gpsim.recordings import Episode, Recording

KEPT_SHARE = 0.99  # of every action's variance, that the means over skipped samples must keep


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
    rows = np.arange(0, len(episode) // k * k + 1, k)
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
    whole = [e.actions[: len(e) // k * k] for e in recording.episodes]
    actions = np.concatenate(whole)
    held = np.concatenate([np.repeat(_means(e, k), k, axis=0) for e in recording.episodes])
    total = np.maximum(actions.var(axis=0), 1e-300)
    return float(1.0 - (np.mean((actions - held) ** 2, axis=0) / total).max())
