"""What sensors make of episodes that were driven: noise, and samples that are lost."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from gpsim.channels import Channels, FloatArray
from gpsim.recordings import Episode


def as_sensed(
    episodes: Sequence[Episode], state: Channels, noise: float, missing: float, rng: np.random.Generator
) -> tuple[tuple[Episode, ...], dict[str, float]]:
    """Episodes with Gaussian noise and lost samples, and the noise's standard deviation by channel.

    noise: share of each channel's spread over all episodes; missing: share of the samples inside an episode. Of 0 and 0
    they are as they were, and nothing is said of the noise.
    """
    if not noise and not missing:
        return tuple(episodes), {}
    spread = noise * np.concatenate([episode.states for episode in episodes]).std(axis=0)
    sensed = tuple(_sensed(episode, spread, missing, rng) for episode in episodes)
    said = dict(zip(state.names, spread.tolist(), strict=True)) if noise else {}
    return sensed, {name: value for name, value in said.items() if value > 0.0}


def _sensed(episode: Episode, spread: FloatArray, missing: float, rng: np.random.Generator) -> Episode:
    states = episode.states + spread * rng.standard_normal(episode.states.shape)
    kept = rng.random(len(states)) >= missing
    kept[[0, -1]] = True
    rows = np.flatnonzero(kept)
    return Episode(episode.name, episode.t[rows], states[rows], episode.actions[rows[:-1]])


def first_of(episodes: Sequence[Episode], transitions: int | None) -> tuple[Episode, ...]:
    """The first so many transitions, the last episode cut where they end; None: all."""
    if transitions is None:
        return tuple(episodes)
    out: list[Episode] = []
    left = transitions
    for episode in episodes:
        if left <= 0:
            break
        count = min(left, len(episode))
        out.append(
            Episode(
                episode.name, episode.t[: count + 1], episode.states[: count + 1], episode.actions[:count]
            )
        )
        left -= count
    return tuple(out)
