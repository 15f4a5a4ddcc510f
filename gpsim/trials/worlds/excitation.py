"""How a concealed world is driven: an open-loop signal and, where it is needed, feedback from what is measured."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from gpsim.channels import FloatArray
from gpsim.trials.worlds.closed_loop import (
    FREE,
    REFERENCES,
    SWING,
    TRACKING,
    Loop,
    Pursuit,
    Tracking,
    loop,
    machines_push,
    track,
)
from gpsim.trials.worlds.systems import SYSTEMS
from gpsim.trials.worlds.world import World

BODY_SIGNALS = ("bang_bang", "prbs", "chirp", "sines", "controller")
VEHICLE_SIGNALS = ("sweep", "prbs", "chirp", "sines", "controller")
GRADED_SIGNALS = ("chirp", "sines", "controller", "sweep")
"""Excitations whose commands take many values: what a dead zone or a saturation needs to be seen."""
PLAYED = "played"
"""By commands that were written down, from rest."""
REACH = {"x": 0.8, "q": 0.5}  # m: how far a centring feedback lets a body go
CARTS_PUSH = 10.0  # N
AT_HOME = 0.05  # of the usual spread, where a machine begins that tracks a reference


@dataclass(frozen=True)
class Drive:
    """signal: (K, E, A) in [-1, 1]; command = clip(scale * signal + feedback), its sign alone for bang-bang."""

    signal: FloatArray
    scale: FloatArray  # (A,)
    limit: FloatArray  # (A,)
    gains: FloatArray  # (A, S)
    switching: bool
    towards: bool  # a vehicle that steers for goals

    def command(self, k: int, measured: FloatArray) -> FloatArray:
        """(E, A) what is commanded from sample k to k + 1, given the readings (E, S)."""
        if self.towards:
            return self._steered(k, measured)
        wanted = self.scale * self.signal[k] + measured @ self.gains.T
        if self.switching:
            return np.asarray(self.limit * np.where(wanted >= 0, 1.0, -1.0))
        return np.asarray(np.maximum(np.minimum(wanted, self.limit), -self.limit))

    def _steered(self, k: int, measured: FloatArray) -> FloatArray:
        """Drive on a circle of 1 m about the origin, speed and turn rate dithered."""
        x, y, yaw = measured.T
        wanted = np.arctan2(y, x) + np.pi / 2 + np.arctan2(np.hypot(x, y) - 1.0, 0.5)
        error = (wanted - yaw + np.pi) % (2 * np.pi) - np.pi
        v = self.scale[0] * (0.6 + 0.4 * self.signal[k, :, 0])
        w = np.maximum(
            np.minimum(1.5 * error + self.scale[1] * self.signal[k, :, 1], self.limit[1]), -self.limit[1]
        )
        return np.stack([v, w], axis=1)


class Driving(Protocol):
    """Whatever drives a world."""

    def command(self, k: int, measured: FloatArray) -> FloatArray:
        """(E, A) what is commanded from sample k to k + 1, given the readings (E, S)."""
        ...


def drive(world: World) -> Drive | Tracking | Pursuit | Loop:
    """The world's excitation."""
    if world.excitation in REFERENCES:
        return loop(world, _push(world))
    if world.excitation == TRACKING:
        push = 0.0 if SYSTEMS[world.system].vehicle else _push(world)
        return track(world, push, _balance(push))
    rng = world.generator(1)
    system = SYSTEMS[world.system]
    shape = (world.steps, world.episodes, len(system.action))
    signal = _signal(world.excitation, shape, world.dt, rng, system.vehicle)
    if system.vehicle:
        scale = np.array([rng.uniform(0.5, 1.0), rng.uniform(0.7, 1.5)])
        return Drive(signal, scale, scale, np.zeros((2, 3)), False, world.excitation == "controller")
    push = _push(world)
    if world.excitation == FREE:
        return Drive(0.0 * signal, np.zeros(1), np.zeros(1), np.zeros((1, len(system.state))), False, False)
    gains, share = _feedback(world, push)
    scale = np.array([push * share * rng.uniform(0.6, 1.0)])
    return Drive(signal, scale, np.array([push]), gains, world.excitation == "bang_bang", False)


def starts(world: World) -> FloatArray:
    """(E, S) true states at the episodes' starts, at rest."""
    rng = world.generator(2)
    out = np.zeros((world.episodes, len(SYSTEMS[world.system].state)))
    if world.excitation == PLAYED:
        return out
    swing = world.excitation == FREE
    if world.system == "cartpole":
        out[:, 0] = rng.uniform(-0.3, 0.3, world.episodes)
        spread = 0.06 if world.posture == "upright" else SWING if swing else 0.5
        out[:, 2] = rng.uniform(-spread, spread, world.episodes) + (
            0 if world.posture == "upright" else np.pi
        )
    elif world.system == "slider":
        out[:, 0] = rng.uniform(-0.3, 0.3, world.episodes)
    elif world.system == "pendulum":
        out[:, 0] = rng.uniform(-1.0, 1.0, world.episodes) * (SWING if swing else 1.0)
    else:
        out[:, :2] = rng.uniform(-1.0, 1.0, (world.episodes, 2))
        out[:, 2] = rng.uniform(-np.pi, np.pi, world.episodes)
    if world.excitation in REFERENCES:  # which begin at zero
        out[:, 0] *= AT_HOME
    return out


def sound(world: World, true: FloatArray) -> FloatArray:
    """(E,) how many samples of the true states (K + 1, E, S) an operator would keep before stopping the run."""
    bad = ~np.isfinite(true).all(axis=2) | (np.abs(true) > 1e3).any(axis=2)
    if world.system == "cartpole":
        bad |= np.abs(true[:, :, 0]) > 4.0
        if world.posture == "upright":
            bad |= np.abs(true[:, :, 2]) > 0.9
    return np.where(bad.any(axis=0), np.argmax(bad, axis=0), len(true))


def _push(world: World) -> float:
    p: Mapping[str, float] = world.parameters
    if world.machine is not None and world.system == "pendulum":
        return machines_push(p)
    if world.system == "cartpole":
        return CARTS_PUSH
    if world.system == "slider":
        return 3.0 * p["mass"]
    return 0.6 * p["mass"] * p["gravity"] * p["length"]


def _feedback(world: World, push: float) -> tuple[FloatArray, float]:
    """Gains (1, S) and the share of the push that the open-loop signal gets."""
    controlled = world.excitation == "controller"
    if world.system == "slider":
        return -push * np.array([[1.0 / REACH["q"], 0.5]]) * (1.0 if controlled else 0.4), 0.8
    if world.system == "pendulum":
        return -push * np.array([[0.0, 0.12]]) * (2.0 if controlled else 1.0), 0.9
    if world.posture == "upright":
        return _balance(push), 0.35 if world.excitation != "bang_bang" else 0.6
    return -push * np.array([[0.5, 0.25, 0.0, 0.0]]), 0.8


def _balance(push: float) -> FloatArray:
    """Pole placement by hand for a pole of about a metre; found good for the whole range of parameters."""
    return push / 10 * np.array([[1.5, 3.5, 38.0, 8.0]])


def _signal(
    kind: str, shape: tuple[int, int, int], dt: float, rng: np.random.Generator, vehicle: bool
) -> FloatArray:
    steps, episodes, actions = shape
    t = dt * np.arange(steps)[:, None, None]
    unit = 2.0 if vehicle else 1.0  # vehicles are slower
    if kind == "sweep":
        hold = max(round(rng.uniform(1.0, 2.5) / dt), 1)
        levels = rng.integers(-5, 6, (steps // hold + 1, episodes, actions)) / 5.0
        levels[..., 0] = np.abs(levels[..., 0]) * 0.8 + 0.2
        return np.repeat(levels, hold, axis=0)[:steps]
    if kind in ("bang_bang", "prbs"):
        clock = int(rng.integers(3, 9)) if kind == "prbs" else 1
        stay = 0.5 if kind == "prbs" else 1.0 - 1.0 / rng.uniform(4, 12)
        flips = rng.random((steps // clock + 1, episodes, actions)) > stay
        sign = np.where(rng.random((1, episodes, actions)) < 0.5, 1.0, -1.0)
        binary = sign * np.where(np.cumsum(flips, axis=0) % 2 == 0, 1.0, -1.0)
        out = np.repeat(binary, clock, axis=0)[:steps]
        if vehicle:
            out[..., 0] = 0.65 + 0.35 * out[..., 0]
        return out
    if kind == "chirp":
        low, high = 0.15 / unit, rng.uniform(1.0, 2.5) / unit
        phase = rng.uniform(0, 2 * np.pi, (1, episodes, actions))
        up = 2 * np.pi * (low * t + (high - low) * t**2 / (2 * t[-1]))
        out = np.sin(up * (1.0 + 0.23 * np.arange(actions)) + phase)
    elif kind == "sines":
        frequency = np.exp(rng.uniform(np.log(0.15 / unit), np.log(2.5 / unit), (5, 1, episodes, actions)))
        phase = rng.uniform(0, 2 * np.pi, (5, 1, episodes, actions))
        out = np.sin(2 * np.pi * frequency * t + phase).sum(axis=0) / 2.5
    else:
        hold = int(rng.integers(1, 6))
        levels = rng.uniform(-1, 1, (steps // hold + 1, episodes, actions))
        out = np.repeat(levels, hold, axis=0)[:steps] * (0.6 if vehicle else 1.0)
    if vehicle and kind != "controller":
        out[..., 0] = 0.6 + 0.4 * out[..., 0]
    return np.asarray(out)
