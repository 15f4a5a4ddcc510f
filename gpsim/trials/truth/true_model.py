"""How well the true model itself predicts one step: what no diagnosis can beat by more than chance."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from gpsim.channels import FloatArray, IntArray, wrap_angle
from gpsim.recordings import Recording
from gpsim.trials.truth.replay import Replay, base_residual, pick
from gpsim.trials.worlds import SYSTEMS, Run, World


class OneStep(NamedTuple):
    """Residual rates of every transition of every episode that was kept, (N, R), and their episodes (N,)."""

    base: FloatArray
    own: FloatArray
    episode: IntArray


def one_step(world: World, truth: Run, recording: Recording, clean: Recording, kept: FloatArray) -> OneStep:
    """Of the base simulator and of the true model, both started at what was recorded.

    The true model knows what its actuators remember, what its sensors do and what differentiating positions does
    (`clean` is the recording as it were without noise), not what the noise was.
    """
    rows = np.flatnonzero(kept)
    lengths = [len(episode) for episode in recording.episodes]
    picks = np.hstack(
        [np.stack([np.arange(k), np.full(k, e)]) for k, e in zip(lengths, rows, strict=True)]
    ).astype(np.int64)
    episode = np.repeat(np.arange(len(rows), dtype=np.int64), lengths)
    before, after = _ends(recording)
    clean_before, clean_after = _ends(clean)
    action = np.concatenate([e.actions for e in recording.episodes])
    starts = pick(truth.sampled, picks, 0) + _difference(world, before, clean_before)
    moved = Replay(world, truth, world.effects).states(picks, 1, starts) - pick(truth.sampled, picks, 1)
    left = _difference(world, after, clean_after + moved)
    return OneStep(
        _rates(world, base_residual(world, before, after, action)),
        _rates(world, _framed(world, left, before) / world.dt),
        episode,
    )


def _ends(recording: Recording) -> tuple[FloatArray, FloatArray]:
    """(N, S) the states at both ends of every transition."""
    states = [e.states for e in recording.episodes]
    return np.concatenate([s[:-1] for s in states]), np.concatenate([s[1:] for s in states])


def _rates(world: World, residual: FloatArray) -> FloatArray:
    return residual if SYSTEMS[world.system].vehicle else residual[:, 1::2]


def _framed(world: World, gap: FloatArray, before: FloatArray) -> FloatArray:
    """A vehicle's differences in its body's frame."""
    if not SYSTEMS[world.system].vehicle:
        return gap
    sin, cos = np.sin(before[:, 2]), np.cos(before[:, 2])
    return np.stack([gap[:, 0] * cos + gap[:, 1] * sin, gap[:, 1] * cos - gap[:, 0] * sin, gap[:, 2]], axis=1)


def _difference(world: World, a: FloatArray, b: FloatArray) -> FloatArray:
    gap = np.array(a - b)
    if SYSTEMS[world.system].vehicle:
        gap[:, 2] = wrap_angle(gap[:, 2])
    return gap
