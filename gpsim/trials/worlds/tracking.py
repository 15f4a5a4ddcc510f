"""A closed loop: a controller makes the system follow a reference, from what is measured."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gpsim.channels import FloatArray
from gpsim.trials.worlds.systems import SYSTEMS
from gpsim.trials.worlds.world import World

TRACKING = "tracking"
SIGNALS = (TRACKING, "controller")
"""Excitations in which what is measured decides what is commanded."""
DAMPING_RATIO = 0.6
REACH = {"slider": 0.5, "pendulum": 1.0, "cartpole": 0.6, "unicycle": 1.2}  # m, rad: how far references go
UPRIGHT = 0.4  # of that, with a pole to balance
SLOWEST = 0.3  # of a vehicle's full speed


@dataclass(frozen=True)
class Tracking:
    """reference: (K, E, S) where the state should be; command = clip(gains (reference - readings) + dither)."""

    reference: FloatArray
    gains: FloatArray  # (A, S)
    dither: FloatArray  # (K, E, A)
    limit: FloatArray  # (A,)

    def command(self, k: int, measured: FloatArray) -> FloatArray:
        """(E, A) what is commanded from sample k to k + 1, given the readings (E, S)."""
        wanted = (self.reference[k] - measured) @ self.gains.T + self.dither[k]
        return np.asarray(np.maximum(np.minimum(wanted, self.limit), -self.limit))


@dataclass(frozen=True)
class Pursuit:
    """A vehicle that drives for a carrot (K, E, 2) that moves, the slower the nearer it is."""

    carrot: FloatArray
    dither: FloatArray  # (K, E, 2)
    limit: FloatArray  # (2,)

    def command(self, k: int, measured: FloatArray) -> FloatArray:
        """(E, 2) speed and turn rate from sample k to k + 1, given the poses (E, 3)."""
        away = self.carrot[k] - measured[:, :2]
        error = (np.arctan2(away[:, 1], away[:, 0]) - measured[:, 2] + np.pi) % (2 * np.pi) - np.pi
        near = np.maximum(np.minimum(np.hypot(*away.T) + self.dither[k, :, 0], 1.0), SLOWEST)
        turn = 1.5 * error + self.limit[1] * self.dither[k, :, 1]
        return np.stack(
            [self.limit[0] * near, np.maximum(np.minimum(turn, self.limit[1]), -self.limit[1])], axis=1
        )


def track(world: World, push: float, upright: FloatArray) -> Tracking | Pursuit:
    """The world's controller. push: the most that it commands; upright: gains (1, S) that balance a pole."""
    rng = world.generator(1)
    system = SYSTEMS[world.system]
    shape = (world.steps, world.episodes)
    amplitude = REACH[world.system] * rng.uniform(0.6, 1.0)
    share = rng.uniform(0.08, 0.2)
    hold = int(rng.integers(2, 7))
    levels = rng.uniform(-1, 1, (world.steps // hold + 1, world.episodes, len(system.action)))
    dither = share * np.repeat(levels, hold, axis=0)[: world.steps]
    if system.vehicle:
        carrot = np.stack([_path(shape, world.dt, 0.12, rng) for _ in range(2)], axis=2)
        limit = np.array([rng.uniform(0.5, 1.0), rng.uniform(0.8, 1.5)])
        return Pursuit(amplitude * carrot, dither, limit)
    balancing = world.posture == "upright"
    if balancing:
        amplitude *= UPRIGHT
    reference = np.zeros((*shape, len(system.state)))
    reference[..., 0] = amplitude * _path(shape, world.dt, 0.15 if balancing else 0.5, rng)
    if rng.random() < 0.5 and not balancing:  # steps from one place to the next
        stay = max(round(rng.uniform(0.8, 2.0) / world.dt), 1)
        reference[..., 0] = np.repeat(reference[::stay, :, 0], stay, axis=0)[: world.steps]
    else:
        reference[..., 1] = np.gradient(reference[..., 0], world.dt, axis=0)
    gains = -upright if balancing else _gains(world, push, rng.uniform(1.0, 2.0))
    return Tracking(reference, gains, push * dither, np.array([push]))


def _gains(world: World, push: float, stiff: float) -> FloatArray:
    """(1, S) of a damped second-order loop on the first coordinate, as stiff as the push allows."""
    p = world.parameters
    if world.system == "pendulum":
        inertia, stiffness = p["mass"] * p["length"] ** 2, push * stiff
    elif world.system == "slider":
        inertia, stiffness = p["mass"], push * stiff / REACH["slider"]
    else:
        inertia, stiffness = p["cart_mass"] + p["pole_mass"], push * stiff / REACH["cartpole"]
    gains = np.zeros((1, len(SYSTEMS[world.system].state)))
    gains[0, :2] = stiffness, 2 * DAMPING_RATIO * np.sqrt(stiffness * inertia)
    return gains


def _path(shape: tuple[int, int], dt: float, fastest: float, rng: np.random.Generator) -> FloatArray:
    """(K, E) in about [-1, 1]: four slow sines an episode, the fastest of `fastest` Hz."""
    t = dt * np.arange(shape[0])[:, None]
    frequency = np.exp(rng.uniform(np.log(fastest / 6), np.log(fastest), (4, 1, shape[1])))
    phase = rng.uniform(0, 2 * np.pi, (4, 1, shape[1]))
    return np.asarray(np.sin(2 * np.pi * frequency * t + phase).sum(axis=0) / 2.0)
