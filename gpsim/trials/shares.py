"""How visible a concealed effect is: what the truth would have looked like without it.

Two figures an effect. Share: how much of the mean squared one-step residual (recording minus base simulator) it makes,
in the channel where that is most. Rollout: how far its absence moves the readings within a second, in standard
deviations of the noise. Where nuisances hide beside main effects, shares are those of rollouts (`Shares`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import combinations
from math import factorial

import numpy as np

from gpsim.channels import BoolArray, FloatArray, IntArray
from gpsim.recordings import evenly
from gpsim.trials.truth import Replay, base_residual, pick, picked
from gpsim.trials.worlds import SYSTEMS, Rough, Run, TrueEffect, World

LEAST_SHARE, LEAST_ROLLOUT = 0.05, 0.5
HORIZON = 1.0  # s
MOST_STEPS, MOST_WINDOWS = 2000, 150
PERFECT = 1e-6  # the noise of a perfect sensor, as a share of a channel's standard deviation
HELD_OUT = 0.2  # the last episodes, as where a recording says nothing
STARTS, MOST = 8, 300  # how many rollouts begin within a horizon; in all
ABOVE_NOISE = 2.0
RUNAWAY = 1e12  # a square that stands for all that is larger


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
    columns, length = _seen_columns(world), _horizon(world, len(truth.commands) - 1)
    picks, windows = _evenly_picked(truth, 1, MOST_STEPS), _evenly_picked(truth, length, MOST_WINDOWS)
    before, after = pick(truth.measured, picks, 0), pick(truth.measured, picks, 1)
    residual = base_residual(world, before, after, pick(truth.commands, picks, 0))
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


def _seen_columns(world: World) -> list[int]:
    """The channels with readings of their own: not the velocities that were differentiated."""
    system, measured = SYSTEMS[world.system], world.velocities != "differentiated"
    return [i for i, n in enumerate(system.names) if measured or n in system.coordinates]


def _horizon(world: World, most: int) -> int:
    return max(2, min(round(HORIZON / world.dt), most))


def _evenly_picked(truth: Run, length: int, most: int) -> IntArray:
    """(2, N) sample and episode at which pieces of `length` transitions begin, evenly spread."""
    steps, episodes = truth.commands.shape[:2]
    k, e = np.meshgrid(np.arange(0, steps - length + 1, length), np.arange(episodes), indexing="ij")
    picks = np.stack([k.ravel(), e.ravel()])
    return picks[:, evenly(picks.shape[1], most)]


@dataclass(frozen=True)
class MainShare:
    """Of one main effect: its part of what all explain (Shapley), and what they explain less without it."""

    importance: float
    needed: float


class Shares:
    """Shares of the mismatch between the base simulator and a run. kept: (E,) samples that an operator keeps."""

    def __init__(self, world: World, truth: Run, kept: FloatArray) -> None:
        self._world, self._truth = world, truth
        self._columns = _seen_columns(world)
        self._length = _horizon(world, int(kept.max()) - 2)
        self._picks = _picks(kept, self._length, world.held_out)
        self._known: dict[tuple[int, ...], FloatArray] = {}

    @property
    def seen(self) -> list[str]:
        """Names of the channels with readings of their own."""
        return [SYSTEMS[self._world.system].names[i] for i in self._columns]

    @property
    def counts(self) -> BoolArray:
        """(C,) channels in which the mismatch stands out of the noise."""
        return np.asarray(self._before >= (ABOVE_NOISE * self._noise) ** 2)

    def explained(self, effects: Sequence[TrueEffect]) -> float:
        """What the base simulator with these of the world's effects explains; 0 where no channel counts."""
        return self._weighed(1.0 - self._left(effects) / self._before)

    def of(self, effect: TrueEffect) -> float:
        """How much of the mismatch an effect makes: the truth against the truth without it."""
        return self._weighed(self._without(effect) / self._before)

    def beyond(self, effect: TrueEffect) -> float:
        """How far its absence moves the readings, root mean square in standard deviations of the noise.

        In the channel where that is most.
        """
        return float(np.max(np.sqrt(self._without(effect)) / self._noise))

    def late(self) -> float:
        """How much of the mismatch the lag of the late topics makes for a model that does not know of it."""
        rough = self._world.rough
        if rough is None or not rough.late:
            return 0.0
        unaware = replace(self._world, rough=replace(rough, late={}))
        return self._weighed(self._squares(Replay(unaware, self._truth, self._world.effects)) / self._before)

    def left(self, effects: Sequence[TrueEffect]) -> dict[str, float]:
        """Channel -> root mean square of what is read less what the base simulator with these effects says."""
        return dict(zip(self.seen, np.sqrt(self._left(effects)).tolist(), strict=True))

    def main(self) -> list[MainShare]:
        """Of every main effect of the world; its importance is what it adds in the mean over all orders (Shapley)."""
        mains = self._world.main
        n, whole = len(mains), tuple(range(len(mains)))
        subsets = [subset for size in range(n + 1) for subset in combinations(whole, size)]
        value = {subset: self.explained([mains[i] for i in subset]) for subset in subsets}
        out = []
        for i in whole:
            importance = 0.0
            for subset in (s for s in subsets if i not in s):
                weight = factorial(len(subset)) * factorial(n - len(subset) - 1) / factorial(n)
                importance += weight * (value[tuple(sorted((*subset, i)))] - value[subset])
            out.append(MainShare(importance, value[whole] - value[tuple(j for j in whole if j != i)]))
        return out

    def _weighed(self, shares: FloatArray) -> float:
        weights = np.where(self.counts, self._before / self._spread**2, 0.0)
        if not weights.sum() > 0:
            return 0.0
        return float(weights @ np.clip(np.nan_to_num(shares), 0.0, 1.0) / weights.sum())

    @cached_property
    def _before(self) -> FloatArray:
        return np.maximum(self._left(()), 1e-300)

    def _without(self, effect: TrueEffect) -> FloatArray:
        return self._left([e for e in self._world.effects if e is not effect])

    def _left(self, effects: Sequence[TrueEffect]) -> FloatArray:
        """(C,) mean squares of what is read less what a model with these effects says."""
        key = tuple(i for i, e in enumerate(self._world.effects) if any(e is other for other in effects))
        if key not in self._known:
            present = [self._world.effects[i] for i in key]
            self._known[key] = self._squares(Replay(self._world, self._truth, present))
        return self._known[key]

    def _squares(self, model: Replay) -> FloatArray:
        """(C,) mean squares over all steps of all rollouts, kept finite."""
        said = model.readings(self._picks, self._length)
        state_error = (picked(self._truth.clean, self._picks, self._length) - said)[..., self._columns]
        squares = np.nan_to_num(state_error**2, nan=RUNAWAY, posinf=RUNAWAY).mean(axis=(0, 1))
        return np.asarray(np.minimum(squares, RUNAWAY))

    @cached_property
    def _spread(self) -> FloatArray:
        """(C,) standard deviations of the channels over the rollouts."""
        k, e = self._picks
        read = np.stack([self._truth.clean[k + j, e] for j in range(self._length + 1)])
        return np.asarray(np.maximum(read.reshape(-1, read.shape[2]).std(axis=0), 1e-9)[self._columns])

    @cached_property
    def _noise(self) -> FloatArray:
        """(C,) of sensors, of their steps, and of stamps that jitter while the system moves."""
        names, rough = SYSTEMS[self._world.system].names, self._world.rough or Rough()
        k, e = self._picks
        rates = (self._truth.clean[k + 1, e] - self._truth.clean[k, e]) / self._world.dt
        sd, step = self._world.noise, rough.quantum
        noise = [
            np.sqrt(sd[n] ** 2 + step.get(n, 0.0) ** 2 / 12.0 + (rough.jitter * rate) ** 2)
            for n, rate in zip(names, np.sqrt(np.mean(rates**2, axis=0)), strict=True)
        ]
        return np.asarray(noise)[self._columns]


def _picks(kept: FloatArray, length: int, held_out: int | None) -> IntArray:
    """(2, N) sample and episode at which rollouts begin in the held-out episodes, evenly spread."""
    rows = np.flatnonzero(kept > length)
    first = round((1.0 - HELD_OUT if held_out is None else 0.8) * len(rows))
    stride = max(length // STARTS, 1)
    held = rows[min(first, len(rows) - 1) :]
    picks = np.array(
        [(k, e) for e in held for k in range(0, int(kept[e]) - length, stride)], dtype=np.int64
    ).T
    return np.asarray(picks[:, evenly(picks.shape[1], MOST)])
