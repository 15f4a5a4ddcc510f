"""How visible a concealed effect is: what the truth would have looked like without it.

Two figures an effect. Share: how much of the mean squared one-step residual (recording minus base simulator) it makes,
in the channel where that is most. Rollout: how far its absence moves the readings within a second, in standard
deviations of the noise.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gpsim.channels import IntArray
from gpsim.recordings import evenly
from gpsim.trials.truth.replay import Replay, base_residual, pick
from gpsim.trials.worlds import SYSTEMS, Run, World

LEAST_SHARE, LEAST_ROLLOUT = 0.05, 0.5
HORIZON = 1.0  # s
MOST_STEPS, MOST_WINDOWS = 2000, 150
PERFECT = 1e-6  # the noise of a perfect sensor, as a share of a channel's standard deviation


@dataclass(frozen=True)
class Visibility:
    """One effect's figures."""

    share: float
    rollout: float

    @property
    def visible(self) -> bool:
        """Whether it counts as visible (docs/method/blind_test.md)."""
        return self.share >= LEAST_SHARE or self.rollout >= LEAST_ROLLOUT


def visibilities(world: World, truth: Run) -> list[Visibility]:
    """Of every effect of the world."""
    if not world.effects:
        return []
    scale = np.maximum(truth.clean.std(axis=(0, 1)), 1e-9)
    noise = np.maximum([world.noise[n] for n in SYSTEMS[world.system].names], PERFECT * scale)
    columns = seen_columns(world)
    picks, windows = _picks(truth, 1, MOST_STEPS), _picks(truth, _horizon(world, truth), MOST_WINDOWS)
    before, after = pick(truth.measured, picks, 0), pick(truth.measured, picks, 1)
    residual = base_residual(world, before, after, pick(truth.commands, picks, 0))
    length = _horizon(world, truth)
    everything = Replay(world, truth, world.effects)
    whole, moved = everything.residual(picks), everything.moved(windows, length)
    out = []
    for i in range(len(world.effects)):
        absent = Replay(world, truth, world.effects[:i] + world.effects[i + 1 :])
        change = whole - absent.residual(picks)
        share = np.mean(change**2, axis=0) / np.maximum(np.mean(residual**2, axis=0), 1e-300)
        rollout = np.sqrt(np.mean((moved - absent.moved(windows, length)) ** 2, axis=0)) / noise
        out.append(Visibility(float(min(share.max(), 1.0)), float(rollout[columns].max())))
    return out


def seen_columns(world: World) -> list[int]:
    """The channels with readings of their own: not the velocities that were differentiated."""
    system = SYSTEMS[world.system]
    own = [n in system.coordinates or world.velocities != "differentiated" for n in system.names]
    return [i for i, seen in enumerate(own) if seen]


def _horizon(world: World, truth: Run) -> int:
    return max(2, min(round(HORIZON / world.dt), len(truth.commands) - 1))


def _picks(truth: Run, length: int, most: int) -> IntArray:
    """(2, N) sample and episode at which pieces of `length` transitions begin, evenly spread."""
    steps, episodes = truth.commands.shape[:2]
    k, e = np.meshgrid(np.arange(0, steps - length + 1, length), np.arange(episodes), indexing="ij")
    picks = np.stack([k.ravel(), e.ravel()])
    return picks[:, evenly(picks.shape[1], most)]
