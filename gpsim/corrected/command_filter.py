"""What reaches the actuators of a command: a delay and a first-order lag for each action, found from a recording.

A Gaussian process on the commands of the moment cannot know that a robot answers late; with the filter before it, it
speaks of the commands that arrive.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from gpsim.channels import BoolArray, FloatArray, IntArray
from gpsim.errors import UsageError
from gpsim.recordings import OverGaps, gaps, steps_to_next
from gpsim.simulators import Memory, SimulatorPlant

LONGEST_DELAY, SHORTEST_LAG, LONGEST_LAG = 1.0, 1e-3, 2.0
"""Bounds of the search [s]."""


@dataclass(frozen=True)
class CommandFilter:
    """u_a' = (u(t - delay) - u_a) / time_constant for each action; delay, time_constant (A,) s, held for dt s."""

    delay: tuple[float, ...]
    time_constant: tuple[float, ...]
    dt: float

    def begin(self, count: int) -> Memory:
        """Nothing was commanded before."""
        held = int(max(self.delay) // self.dt) + 2
        return {
            "commands": np.zeros((count, held, len(self.delay))),
            "level": np.zeros((count, len(self.delay))),
        }

    def step(self, action: FloatArray, memory: Memory) -> FloatArray:
        """(B, A): the mean over a control step of what arrives of the actions; `memory` moves on."""
        sent, level = memory["commands"], memory["level"]
        sent[:] = np.concatenate([action[:, None], sent[:, :-1]], axis=1)
        out = np.empty_like(action)
        for i, (delay, lag) in enumerate(zip(self.delay, self.time_constant, strict=True)):
            whole = int(delay // self.dt)
            late = delay - whole * self.dt
            total = 0.0
            for command, time in ((sent[:, whole + 1, i], late), (sent[:, whole, i], self.dt - late)):
                gap = level[:, i] - command
                total = total + command * time - gap * lag * np.expm1(-time / lag)
                level[:, i] = command + gap * np.exp(-time / lag)
            out[:, i] = total / self.dt
        return out

    def arrived(
        self, actions: FloatArray, episode: IntArray, t: FloatArray, over_gaps: OverGaps | None = None
    ) -> FloatArray:
        """(N, A): what arrives of the actions (N, A) of a recording; episode (N,) ascending, each starts at rest.

        Where rows are lost, by the clock t (N,) s, the last command before them stands until the next one: a robot
        does not stop because a log does. over_gaps: the commands of rows that were left out because of a gap after
        them; without it the last row's own command is taken for the last. After a gap that outlasts what a filter may
        remember it starts at rest again.
        """
        if over_gaps is not None:
            actions, episode, t, own = over_gaps.put_back(actions, episode, t)
            return self.arrived(actions, episode, t)[own]
        count = steps_to_next(t, episode, self.dt)
        forgotten = count * self.dt > LONGEST_DELAY + LONGEST_LAG
        count[forgotten] = 1
        begins = np.append(True, (np.diff(episode) != 0) | forgotten[:-1])
        first = np.cumsum(count) - count
        standing = np.repeat(
            np.arange(len(actions)), count
        )  # whose command it is, control step by control step
        return np.asarray(self._play(actions[standing], first[begins])[first])

    def _play(self, actions: FloatArray, starts: IntArray) -> FloatArray:
        """(N, A): what arrives of the actions (N, A) of even control steps; at the rows `starts` it is at rest."""
        lengths = np.diff(np.append(starts, len(actions)))
        memory, out = self.begin(len(starts)), np.empty_like(actions)
        for k in range(int(lengths.max())):
            rows = starts + np.minimum(k, lengths - 1)
            got = self.step(actions[rows], memory)
            out[rows[k < lengths]] = got[k < lengths]
        return out

    def describe(self) -> list[dict[str, float]]:
        """Delay and time constant [s], action by action."""
        pairs = zip(self.delay, self.time_constant, strict=True)
        return [{"delay": delay, "time_constant": lag} for delay, lag in pairs]

    def to_json(self) -> dict[str, Any]:
        """For disk."""
        return {"delay": list(self.delay), "time_constant": list(self.time_constant), "dt": self.dt}

    @classmethod
    def from_json(cls, data: Mapping[str, Any]) -> CommandFilter:
        """The inverse of `to_json`; raises UsageError."""
        try:
            return cls(tuple(data["delay"]), tuple(data["time_constant"]), float(data["dt"]))
        except (KeyError, TypeError, ValueError) as error:
            raise UsageError(f"not a command filter that this version can read: {error!r}") from error


def mean_rates(plant: SimulatorPlant, states: FloatArray, actions: FloatArray) -> FloatArray:
    """(N, R): a base simulator's mean rates over a control step from states (N, S) under actions (N, A)."""
    after = plant.simulator.step(
        states, actions, plant.parameters, np.full(len(states), plant.dt), plant.integrator
    )
    return plant.simulator.measured_rates(states, after, np.full(len(states), plant.dt))


def fit_filter(
    actions: FloatArray,
    episode: IntArray,
    t: FloatArray,
    measured: FloatArray,
    rates_of: Callable[[FloatArray], FloatArray],
    dt: float,
    over_gaps: OverGaps | None = None,
) -> CommandFilter:
    """The delays and lags with which rates_of(arrived actions (N, A)) comes nearest to the measured rates (N, R).

    episode (N,) ascending and t (N,) s are the rows', dt [s] is the control step, over_gaps is as in `arrived`. Least
    squares, each rate on the scale of its spread; delay and lag of one action are told apart by the shape of the answer
    only, their sum is known much better.
    """
    from scipy.optimize import least_squares  # here: most of a second that few commands need to wait for

    scale = np.maximum(measured.std(axis=0), 1e-12)
    count = actions.shape[1]

    def made(values: FloatArray) -> CommandFilter:
        return CommandFilter(tuple(values[:count].tolist()), tuple(values[count:].tolist()), dt)

    def errors(values: FloatArray) -> FloatArray:
        predicted = rates_of(made(values).arrived(actions, episode, t, over_gaps))
        return np.asarray(((predicted - measured) / scale).ravel())

    low = np.array([0.0] * count + [SHORTEST_LAG] * count)
    high = np.array([LONGEST_DELAY] * count + [LONGEST_LAG] * count)
    start = np.array([0.5 * dt] * count + [dt] * count)
    start = np.clip(start, low + 1e-9, high - 1e-9)
    found = least_squares(errors, start, bounds=(low, high), diff_step=1e-3, x_scale=dt, xtol=1e-5)
    return made(found.x)


def settled_rows(actions: FloatArray, episode: IntArray, t: FloatArray, steps: int, dt: float) -> BoolArray:
    """(N,): rows whose action has been the same for more than `steps` rows of its episode, none of them lost.

    actions (N, A), episode (N,) ascending, t (N,) s, control step dt [s]: over a gap another command may have stood.
    """
    changed = np.ones(len(actions), dtype=np.bool_)
    changed[1:] = (np.diff(actions, axis=0) != 0).any(axis=1) | (np.diff(episode) != 0) | gaps(t, dt)
    age = np.arange(len(actions)) - np.maximum.accumulate(np.where(changed, np.arange(len(actions)), 0))
    return np.asarray(age >= steps)
