"""How machines are driven for identification: a controller tracks a reference as such experiments use it.

Trapezoids of velocity and triangles of position are those of axes (Janot, Gautier and Brunot 2019: the EMPS benchmark);
multisines are those of robots (Swevers et al. 1997).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from gpsim.channels import FloatArray
from gpsim.trials.worlds.systems import SYSTEMS
from gpsim.trials.worlds.world import World

REFERENCES = ("trapezoid", "triangle", "multisine")
"""Excitations that track a reference of that shape."""
FREE = "free"
"""Nothing is commanded: it swings until it stands."""
SWING = 1.4  # rad, or times the usual spread: from how far a free swing begins
STROKE = {"slider": (0.08, 0.3), "pendulum": (0.5, 1.3), "cartpole": (0.1, 0.35)}  # m, rad
SPEED = {"slider": (0.2, 0.5), "pendulum": (1.0, 3.0), "cartpole": (0.3, 0.7)}  # m/s, rad/s at the most
RAMP = {"slider": (0.8, 2.0), "pendulum": (4.0, 10.0), "cartpole": (0.8, 2.0)}  # m/s^2, rad/s^2
LATE = 0.35  # rad of phase that delays may cost at the loop's bandwidth
SLOWEST, FASTEST = 0.1, 1.0  # Hz of a multisine
LIFTS = 1.2  # times the weight of a servo's pendulum, that it can hold


class Loop:
    """A PID controller: command = clip(kp e + kd e' + ki integral of e), with e = reference - reading."""

    def __init__(self, reference: FloatArray, gains: FloatArray, integral: float, limit: float, dt: float):
        self._reference, self._gains, self._limit, self._dt = reference, gains, limit, dt
        self._integral, self._sum = integral, np.zeros(reference.shape[1])

    def command(self, k: int, measured: FloatArray) -> FloatArray:
        """(E, A) what is commanded from sample k to k + 1, given the readings (E, S)."""
        error = self._reference[k] - measured
        wanted = error @ self._gains + self._integral * self._sum
        free = np.abs(wanted) < self._limit  # no winding up while it can do no more
        self._sum = self._sum + self._dt * np.where(free, error[:, 0], 0.0)
        return np.asarray(np.clip(wanted, -self._limit, self._limit))[:, None]


def loop(world: World, push: float) -> Loop:
    """The world's controller; push: the most that it commands."""
    rng = world.generator(1)
    path = _reference(world, rng)
    reference = np.zeros((*path.shape, len(SYSTEMS[world.system].state)))
    reference[..., 0], reference[..., 1] = path, np.gradient(path, world.dt, axis=0)
    inertia, bandwidth = _inertia(world.system, world.parameters), LATE / (2.5 * world.dt + 0.02)
    stiffness = inertia * bandwidth**2
    gains = np.zeros(reference.shape[2])
    gains[:2] = stiffness, 1.8 * inertia * bandwidth
    integral = stiffness * bandwidth / 6 if rng.random() < 0.5 else 0.0
    return Loop(reference, gains, integral, push, world.dt)


def machines_push(p: Mapping[str, float]) -> float:
    """N m: what a servo's motor can do."""
    return LIFTS * p["mass"] * p["gravity"] * p["length"]


def _inertia(system: str, p: Mapping[str, float]) -> float:
    if system == "slider":
        return p["mass"]
    if system == "pendulum":
        return p["mass"] * p["length"] ** 2
    return p["cart_mass"] + p["pole_mass"]


def _reference(world: World, rng: np.random.Generator) -> FloatArray:
    """(K, E) where the first coordinate should be."""
    t: FloatArray = world.dt * np.arange(world.steps, dtype=np.float64)
    if world.excitation == "multisine":
        return np.stack([_multisine(t, world.system, rng) for _ in range(world.episodes)], axis=1)
    return np.stack(
        [_to_and_fro(t, world.system, world.excitation, rng) for _ in range(world.episodes)], axis=1
    )


def _multisine(t: FloatArray, system: str, rng: np.random.Generator) -> FloatArray:
    """Five sines whose fastest motion is a usual one, begun at rest."""
    frequency = np.exp(rng.uniform(np.log(SLOWEST), np.log(FASTEST), 5))
    phase, size = rng.uniform(0, 2 * np.pi, 5), 1.0 / frequency
    path = (size[:, None] * np.sin(2 * np.pi * frequency[:, None] * t + phase[:, None])).sum(axis=0)
    speed = np.abs(np.gradient(path, t[1])).max()
    path *= min(rng.uniform(*SPEED[system]) / speed, STROKE[system][1] / np.abs(path).max())
    return np.asarray(path * np.minimum(t / 0.5, 1.0))


def _to_and_fro(t: FloatArray, system: str, shape: str, rng: np.random.Generator) -> FloatArray:
    """From one random place to the next by trapezoids of velocity; a triangle has ten times steeper ramps."""
    ramp = rng.uniform(*RAMP[system]) * (10.0 if shape == "triangle" else 1.0)
    path, place, k = np.zeros(len(t)), 0.0, 0
    while k < len(t):
        target = rng.choice([-1.0, 1.0]) * rng.uniform(*STROKE[system])
        if target * place > 0:
            target = -target
        speed, pause = rng.uniform(*SPEED[system]), rng.uniform(0.0, 0.4)
        move = _trapezoid(abs(target - place), speed, ramp, t[1])
        part = place + np.sign(target - place) * move
        part = np.concatenate([part, np.full(int(pause / t[1]), target)])[: len(t) - k]
        path[k : k + len(part)] = part
        k, place = k + len(part), target
    return path


def _trapezoid(way: float, speed: float, ramp: float, dt: float) -> FloatArray:
    """Positions from 0 to `way` with a trapezoid of velocity."""
    speed = min(speed, float(np.sqrt(way * ramp)))
    rise, whole = speed / ramp, way / speed + speed / ramp
    t = np.arange(dt, whole + dt, dt)
    early = 0.5 * ramp * np.minimum(t, rise) ** 2
    cruise = speed * np.clip(t - rise, 0.0, whole - 2 * rise)
    late = np.clip(t - (whole - rise), 0.0, rise)
    return np.asarray(early + cruise + speed * late - 0.5 * ramp * late**2)


TRACKING = "tracking"
SIGNALS = (TRACKING, "controller")
"""Excitations in which what is measured decides what is commanded."""
DAMPING_RATIO = 0.6
REACH = {"slider": 0.5, "pendulum": 1.0, "cartpole": 0.6, "unicycle": 1.2}  # m, rad: how far references go
UPRIGHT = 0.4  # of that, with a pole to balance
SLOWEST_TURN = 0.3  # of a vehicle's full speed


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
        near = np.maximum(np.minimum(np.hypot(*away.T) + self.dither[k, :, 0], 1.0), SLOWEST_TURN)
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
