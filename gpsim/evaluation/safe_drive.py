"""A policy on a target under a monitor: who stops it first, the monitor, a limit, or nobody."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from gpsim.channels import BoolArray, Channels, FloatArray, IntArray
from gpsim.environments import Act, Episodes
from gpsim.errors import UsageError
from gpsim.evaluation.monitor import Monitor
from gpsim.simulators import Memory, Plant, part_of
from gpsim.tasks import Task

NEVER = -1


@dataclass(frozen=True)
class Limits:
    """A box that the state must not leave: of some channels the largest size, in the channel's unit."""

    columns: IntArray
    most: FloatArray

    @classmethod
    def of(cls, given: Mapping[str, float], state: Channels) -> Limits:
        """By channel; raises UsageError for one that is none of the state, and for a limit that is not positive."""
        for name, value in given.items():
            if name not in state.names:
                raise UsageError(
                    f"deploy.limits: no channel '{name}'; the state has {', '.join(state.names)}"
                )
            if not value > 0.0:
                raise UsageError(f"deploy.limits.{name}: expected a positive number, got {value:g}")
        columns = np.array([state.index(name) for name in given], dtype=np.int64)
        return cls(columns, np.array(list(given.values()), dtype=np.float64))

    def left(self, states: FloatArray) -> BoolArray:
        """(B,): which states are outside, or are no numbers any more."""
        within = np.abs(states[:, self.columns]) <= self.most
        return np.asarray(~within.all(axis=1) | ~np.isfinite(states).all(axis=1))


@dataclass(frozen=True)
class ChangingPlant:
    """A target that becomes another one `at` control steps after an episode began.

    Both follow every command from the state that there is, so that the actuators of either have it behind them.
    """

    before: Plant
    after: Plant
    at: int

    @property
    def state(self) -> Channels:
        """The target's state channels."""
        return self.before.state

    @property
    def action(self) -> Channels:
        """The target's action channels."""
        return self.before.action

    @property
    def dt(self) -> float:
        """The control step [s]."""
        return self.before.dt

    def begin(self, count: int, rng: np.random.Generator) -> Memory:
        """What both remember, and how long each episode has gone on."""
        both = {"before": self.before.begin(count, rng), "after": self.after.begin(count, rng)}
        memory = {f"{part}/{key}": values for part, own in both.items() for key, values in own.items()}
        return memory | {"steps": np.zeros(count)}

    def step(
        self, state: FloatArray, action: FloatArray, memory: Memory, rng: np.random.Generator
    ) -> FloatArray:
        """(B, S): the state after one control step of the one that it is now."""
        before = self.before.step(state, action, part_of(memory, "before/"), rng)
        after = self.after.step(state, action, part_of(memory, "after/"), rng)
        changed = memory["steps"] >= self.at
        memory["steps"] += 1.0
        return np.where(changed[:, None], after, before)

    def measure(self, state: FloatArray, memory: Memory, rng: np.random.Generator) -> FloatArray:
        """(B, S): what the target's sensors say."""
        return self.before.measure(state, part_of(memory, "before/"), rng)


@dataclass(frozen=True)
class Drives:
    """Of every drive the step at which the monitor stopped it and at which it left the limits, NEVER where it did not.

    returns: what it earned until it was over; steps: how long each went on.
    """

    stopped: IntArray
    left: IntArray
    returns: FloatArray
    steps: IntArray


def drive(
    plant: Plant,
    task: Task,
    act: Act,
    monitor: Monitor,
    limits: Limits,
    *,
    count: int,
    steps: int,
    endless: bool,
    rng: np.random.Generator,
    fallback: Act | None = None,
) -> Drives:
    """Drive `count` times for `steps` control steps at most; a stop ends a drive.

    endless: an episode that ends, or leaves the limits, is followed by another under one monitor; else a drive is one.
    fallback: drives on where the monitor stops, if there is one.
    """
    running = Episodes(plant, task, count, rng)
    seen = running.begin()
    monitor.begin(_measured(running))
    stopped, left = (np.full(count, NEVER, dtype=np.int64) for _ in range(2))
    alive, returns, lasted = np.ones(count, dtype=np.bool_), np.zeros(count), np.zeros(count, dtype=np.int64)
    for step in range(1, steps + 1):
        actions = act(seen)
        if fallback is not None and (given_over := stopped != NEVER).any():
            other = fallback(seen)
            actions = np.where(given_over.reshape(-1, *[1] * (other.ndim - 1)), other, actions)
        rewards, terminated, truncated = running.step(actions)
        returns += np.where(alive, rewards, 0.0)
        lasted[alive] = step
        alarm = monitor.observe(task.command(actions), _measured(running)) & alive & (stopped == NEVER)
        out = limits.left(running.states) & alive
        left[out & (left == NEVER)] = step
        stopped[alarm & ~out] = step
        over = terminated | truncated | out
        if not endless:
            alive &= ~over
        if fallback is None:
            alive &= ~alarm
        if not alive.any():
            break
        if over.any():
            running.restart(over)
            monitor.rejoin(over, _measured(running)[over])
        seen = running.observe()
    return Drives(stopped, left, returns, lasted)


def _measured(running: Episodes) -> FloatArray:
    return running.plant.measure(running.states, running.memory, running.rng)
