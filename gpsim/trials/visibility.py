"""How visible a concealed effect is: what the truth would have looked like without it.

Two figures an effect. Share: how much of the mean squared one-step residual (recording minus base simulator) it makes,
in the channel where that is most. Rollout: how far its absence moves the readings within a second, in standard
deviations of the noise.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from gpsim.channels import FloatArray, IntArray
from gpsim.trials.running import Chain, Run, body_of
from gpsim.trials.sensors import sense
from gpsim.trials.systems import SYSTEMS, dynamics
from gpsim.trials.worlds import TrueEffect, World

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
        """Whether the issue's rule counts it as visible."""
        return self.share >= LEAST_SHARE or self.rollout >= LEAST_ROLLOUT


def visibilities(world: World, truth: Run) -> list[Visibility]:
    """Of every effect of the world."""
    if not world.effects:
        return []
    scale = np.maximum(truth.clean.std(axis=(0, 1)), 1e-9)
    noise = np.maximum([world.noise[n] for n in SYSTEMS[world.system].names], PERFECT * scale)
    columns = seen_columns(world)
    picks, windows = _picks(truth, 1, MOST_STEPS), _picks(truth, _horizon(world, truth), MOST_WINDOWS)
    residual = _base_residual(world, _pick(truth.measured, picks, 1), _actions(truth, picks))
    everything = _Absent(world, truth, world.effects)
    out = []
    for i in range(len(world.effects)):
        absent = _Absent(world, truth, world.effects[:i] + world.effects[i + 1 :])
        change = everything.residual(picks) - absent.residual(picks)
        share = np.mean(change**2, axis=0) / np.maximum(np.mean(residual**2, axis=0), 1e-300)
        moved = everything.moved(windows) - absent.moved(windows)
        rollout = np.sqrt(np.mean(moved**2, axis=0)) / noise
        out.append(Visibility(float(min(share[columns].max(), 1.0)), float(rollout[columns].max())))
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
    if picks.shape[1] > most:
        picks = picks[:, np.linspace(0, picks.shape[1] - 1, most).round().astype(np.int64)]
    return picks


def _pick(values: FloatArray, picks: IntArray, late: int) -> tuple[FloatArray, FloatArray]:
    """Values (K + 1, E, S) at the picks and `late` samples later, (N, S) each."""
    return values[picks[0], picks[1]], values[picks[0] + late, picks[1]]


def _actions(truth: Run, picks: IntArray) -> FloatArray:
    return np.asarray(truth.commands[picks[0], picks[1]])


class _Absent:
    """The same run with only `effects` present, replayed from the true states."""

    def __init__(self, world: World, truth: Run, effects: Sequence[TrueEffect]) -> None:
        self._world, self._truth, self._effects = world, truth, effects
        self._acting = self._what_acted()
        names, n = SYSTEMS[world.system].names, truth.per_sample
        self._read = np.stack(
            [sense(effects, names, truth.fine, k * n, truth.h) for k in range(len(truth.clean))]
        )

    def residual(self, picks: IntArray) -> FloatArray:
        """(N, S) what one step differs from the base simulator's, started at what is read."""
        before, after = _pick(self._read, picks, 1)
        gap = self._replayed(picks, 1) - _pick(self._truth.fine[:: self._truth.per_sample], picks, 1)[1]
        return _base_residual(self._world, (before, after + gap), _actions(self._truth, picks))

    def moved(self, picks: IntArray) -> FloatArray:
        """(N, S) how far the readings move within the horizon."""
        length = _horizon(self._world, self._truth)
        before, after = _pick(self._read, picks, length)
        true = _pick(self._truth.fine[:: self._truth.per_sample], picks, length)[1]
        return np.asarray(after + self._replayed(picks, length) - true - before)

    def _what_acted(self) -> FloatArray:
        """(K n, E, A) what the actuators make of the commands, along the true states."""
        world, truth, n = self._world, self._truth, self._truth.per_sample
        chain = Chain(world.system, self._effects)
        out = np.empty((len(truth.commands) * n, *truth.commands.shape[1:]))
        for i in range(len(out)):
            t = truth.clock + i * truth.h
            out[i] = chain.act(truth.commands[i // n], truth.fine[i], t, truth.h)
        return out

    def _replayed(self, picks: IntArray, length: int) -> FloatArray:
        """(N, S) true states `length` samples after the picks."""
        world, truth, n = self._world, self._truth, self._truth.per_sample
        body = body_of(world, self._effects, "rk4", truth.h)
        state = truth.fine[picks[0] * n, picks[1]]
        hidden = self._hidden(picks, body.begin(state))
        first, late = picks[0] * n, world.dt * picks[0]
        with np.errstate(all="ignore"):
            for j in range(length * n):
                t = truth.clock[picks[1]] + late + j * truth.h
                wall = truth.wall[picks[1]] + late + j * truth.h
                acting = self._acting[first + j, picks[1]]
                state, hidden = body.step(state, hidden, acting, t, wall, truth.h)
        return np.asarray(state)

    def _hidden(self, picks: IntArray, fresh: FloatArray) -> FloatArray:
        """What was hidden then, if the effect that hides it is present."""
        return self._truth.hidden[picks[0], picks[1]] if fresh.shape[1] else fresh


def _base_residual(world: World, readings: tuple[FloatArray, FloatArray], action: FloatArray) -> FloatArray:
    """(N, S) per second: readings after a step, less the base simulator's step from the readings before it."""
    before, after = readings
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
