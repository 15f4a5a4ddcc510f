"""Replaying a concealed run from chosen states with some of its effects absent, and the base simulator's own step."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from typing import NamedTuple

import numpy as np

from gpsim.channels import FloatArray, IntArray, wrap_angle
from gpsim.recordings import Recording
from gpsim.trials import catalogue, outside
from gpsim.trials.truth.running import ActuatorChain, Frame, frame_of, limited, sense
from gpsim.trials.worlds import SYSTEMS, Run, TrueEffect, World, dynamics

HIDDEN_STATES = (
    dict.fromkeys(outside.at_site(outside.HiddenForce), 2)
    | dict.fromkeys(outside.at_site(outside.HiddenTwist), 1)
    | dict.fromkeys((*catalogue.BRISTLES, *catalogue.COUPLINGS), 2)
)
"""Kinds that remember in the body, and how many columns that takes."""


class Replay:
    """The same run with only `effects` present. Picks are (2, N): sample and episode at which pieces begin."""

    def __init__(
        self, world: World, truth: Run, effects: Sequence[TrueEffect], frame: Frame | None = None
    ) -> None:
        self._world, self._truth, self._effects = world, truth, effects
        self._frame = frame or frame_of(world)

    def residual(self, picks: IntArray) -> FloatArray:
        """(N, S) per second, by how much one step differs from the base simulator's, started at what is read."""
        before, after = pick(self._read, picks, 0), pick(self._read, picks, 1)
        gap = self.states(picks, 1) - pick(self._truth.sampled, picks, 1)
        return base_residual(self._world, before, after + gap, pick(self._truth.commands, picks, 0))

    def moved(self, picks: IntArray, length: int) -> FloatArray:
        """(N, S) how far the readings move within `length` transitions."""
        true = pick(self._truth.sampled, picks, length)
        change = pick(self._read, picks, length) - pick(self._read, picks, 0)
        return np.asarray(change + self.states(picks, length) - true)

    def states(self, picks: IntArray, length: int, starts: FloatArray | None = None) -> FloatArray:
        """(N, S) true states `length` transitions after the picks, from `starts` (N, S), by default the true ones."""
        return np.asarray(self.path(picks, length, starts)[-1])

    def path(self, picks: IntArray, length: int, starts: FloatArray | None = None) -> FloatArray:
        """(length, N, S) true states 1 to `length` transitions after the picks, as `states` has the last."""
        world, truth, n = self._world, self._truth, self._truth.per_sample
        body = self._frame.body(self._effects, truth.h)
        state = pick(truth.sampled, picks, 0) if starts is None else starts
        hidden = body.begin(state)
        if hidden.shape[1]:  # what was hidden then, as the effect that hides it is present
            hidden = pick(truth.hidden, picks, 0)[:, self._hidden]
        first, late = picks[0] * n, world.dt * picks[0]
        out = np.empty((length, *state.shape))
        with np.errstate(all="ignore"):
            for j in range(length * n):
                t = truth.clock[picks[1]] + late + j * truth.h
                wall = truth.wall[picks[1]] + late + j * truth.h
                acting = self._acting[first + j, picks[1]]
                state, hidden = body.step(state, hidden, acting, t, wall, truth.h)
                if (j + 1) % n == 0:
                    out[j // n] = state
        return out

    def readings(self, picks: IntArray, length: int) -> FloatArray:
        """(length, N, S) what the sensors say along `path`, begun where they say what is read at the picks.

        They see what is off the true states as it is: exact for what they add, near for what they scale or delay.
        """
        true, read = self._truth.sampled, self._read
        starts = pick(true, picks, 0) + pick(self._truth.clean, picks, 0) - pick(read, picks, 0)
        true, seen = picked(true, picks, length), picked(read, picks, length)
        return np.asarray(self.path(picks, length, starts) - true + seen)

    @property
    def _hidden(self) -> list[int]:
        """The columns of the truth's hidden states that belong to the effects that are present."""
        last = (*catalogue.BRISTLES, *catalogue.COUPLINGS)
        ordered = sorted(self._world.effects, key=lambda e: last.index(e.family) if e.family in last else -1)
        widths = [(e in self._effects, HIDDEN_STATES.get(e.family, 0)) for e in ordered]
        owned = [there for there, width in widths for _ in range(width)]
        return [i for i, there in enumerate(owned) if there]

    @cached_property
    def _read(self) -> FloatArray:
        """(K + 1, E, S) what the sensors say of the true states."""
        truth, names = self._truth, self._frame.names
        steps = range(0, len(truth.fine), truth.per_sample)
        sensors = (*self._effects, *self._world.late)
        read = np.stack([sense(sensors, names, truth.fine, i, truth.h) for i in steps])
        return limited(self._effects, names, read)

    @cached_property
    def _acting(self) -> FloatArray:
        """(K n, E, A) what the actuators make of the commands, along the true states."""
        truth, n = self._truth, self._truth.per_sample
        chain = ActuatorChain(self._frame, self._effects)
        out = np.empty((len(truth.commands) * n, *truth.commands.shape[1:]))
        for i in range(len(out)):
            t = truth.clock + i * truth.h
            out[i] = chain.act(truth.commands[i // n], truth.fine[i], t, truth.h)
        return out


def pick(values: FloatArray, picks: IntArray, late: int) -> FloatArray:
    """(N, ...) of values (K + 1, E, ...), `late` samples after the picks."""
    return np.asarray(values[picks[0] + late, picks[1]])


def picked(values: FloatArray, picks: IntArray, length: int) -> FloatArray:
    """(length, N, ...) of values (K + 1, E, ...), 1 to `length` samples after the picks."""
    return np.stack([pick(values, picks, j) for j in range(1, length + 1)])


def base_residual(world: World, before: FloatArray, after: FloatArray, action: FloatArray) -> FloatArray:
    """(N, S) per second: readings after a step, less the base simulator's step from the readings before it.

    A vehicle's are in its body's frame: v, v_lateral, w.
    """
    if SYSTEMS[world.system].vehicle:
        return _vehicle_residual(world, before, after, action)
    dt = world.dt

    def slope(s: FloatArray) -> FloatArray:
        inverse, force = dynamics(world.system, world.parameters, s, action)
        out = np.empty_like(s)
        out[:, 0::2], out[:, 1::2] = s[:, 1::2], (inverse * force[:, None, :]).sum(axis=2)
        return out

    k1 = slope(before)
    step = before + dt * k1
    if world.integrator == "semi_implicit":
        step[:, 0::2] = before[:, 0::2] + dt * step[:, 1::2]
    elif world.integrator == "rk4":
        k2 = slope(before + dt / 2 * k1)
        k3 = slope(before + dt / 2 * k2)
        step = before + dt / 6 * (k1 + 2 * (k2 + k3) + slope(before + dt * k3))
    return np.asarray((after - step) / dt)


def _vehicle_residual(world: World, before: FloatArray, after: FloatArray, action: FloatArray) -> FloatArray:
    """In the body's frame at the step's start."""
    moved = (after - before) / world.dt
    moved[:, 2] = (moved[:, 2] * world.dt + np.pi) % (2 * np.pi) / world.dt - np.pi / world.dt
    sin, cos = np.sin(before[:, 2]), np.cos(before[:, 2])
    ahead, aside = moved[:, 0] * cos + moved[:, 1] * sin, moved[:, 1] * cos - moved[:, 0] * sin
    return np.stack([ahead - action[:, 0], aside, moved[:, 2] - action[:, 1]], axis=1)


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
