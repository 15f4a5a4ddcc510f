"""How a robot is driven, by sines, a binary signal or Fourier series, about what keeps it in bounds; and its run."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from typing import Any

import numpy as np
from scipy.linalg import solve_discrete_are

from gpsim.channels import FloatArray
from gpsim.trials.bodies import mujoco
from gpsim.trials.driving import Driving
from gpsim.trials.robots.models import Way, layout_of, robot_of, spec_of
from gpsim.trials.robots.moving import FAR, Plant, Stepped, frame_of, step_of, touch_free
from gpsim.trials.truth import driven, noise_of
from gpsim.trials.worlds import Run, TrueEffect, World

Rng = np.random.Generator
SIGNALS = ("sines", "prbs")
FOURIER = "fourier"
SLOWEST, FASTEST = 0.15, 2.0  # Hz, of the sines
OWN_RANGE = 0.95  # of what an actuator takes
DITHER = {"balance": 0.12, "swing": 0.8, "torque": 0.12}
"""How much of what an actuator takes, or of a torque that is plenty, the signal gets."""
TRACKING = 5.0  # rad/s of the controller of a robot with motors
FALLEN = 0.7  # rad, of a pole that is to stand
OFF = 1.6  # times the reach and spread: a servo's or a controller's joint that far from rest has gone wrong
WILD = 60.0  # rad/s
HARMONICS, FADE = 5, 1.0  # of a Fourier series; s until it has begun
SLOWEST_WAVE, ORDINARY = (0.08, 0.2), 3.14  # Hz of a joint that turns at so many rad/s at most
OWN_SPEED, OWN_ROOM = 0.6, 0.9  # of a joint's speed, and of its way to its limits, that are used
STIFF, CRITICAL = 8.0, 0.8  # rad/s and damping of the controller that tracks


def _driven(
    reference: FloatArray, base: FloatArray, gains: FloatArray, low: FloatArray, high: FloatArray, weighed: Any = None
) -> Driving:  # fmt: skip
    """Commands clip(base + gains (reference - readings)); reference: (K + 1, E, S), base: (K, E, A), gains (A, S).

    weighed: MuJoCo's model, by which gravity's part is added; None where nothing is.
    """
    data = None if weighed is None else mujoco().MjData(weighed)

    def command(k: int, measured: FloatArray) -> FloatArray:
        wanted = base[k] + (reference[k] - measured) @ gains.T
        if data is not None:
            for row, read in zip(wanted, measured, strict=True):
                data.qpos[:], data.qvel[:] = read[0::2], 0.0
                mujoco().mj_forward(weighed, data)
                row += data.qfrc_bias
        return np.asarray(np.clip(wanted, low, high))

    return command


def _way_of(world: World) -> Way:
    """How a world is driven; it stands in its posture."""
    ways: dict[str, Way] = {way: way for way in robot_of(world.system).ways}
    return ways[world.posture]


def starts(world: World) -> FloatArray:
    """(E, S) true states at the episodes' starts, at rest near the robot's own place."""
    rng, robot = world.generator(2), robot_of(world.system)
    out = np.zeros((world.episodes, 2 * len(robot.spread)))
    spread = np.array(robot.spread)
    out[:, 0::2] = robot.rest[_way_of(world)] + spread * rng.uniform(-1, 1, (world.episodes, len(spread)))
    return out


def drive(world: World) -> Driving:
    """The world's excitation."""
    rng, way = world.generator(1), _way_of(world)
    robot, layout = robot_of(world.system), layout_of(world.system)
    if world.excitation == FOURIER:
        return _fourier(world, rng)
    model = spec_of(world.system).compile()
    shape = (world.steps + 1, world.episodes)
    rest, reach = np.array(robot.rest[way]), np.array(robot.reach)
    signal = _signal(world.excitation, (*shape, len(layout.action)), world.dt, rng)
    size = rng.uniform(0.6, 1.0, len(layout.action))
    reference = np.zeros((*shape, 2 * len(rest)))
    reference[..., 0::2] = rest
    low, high = OWN_RANGE * np.asarray(model.actuator_ctrlrange, dtype=np.float64).T
    gains = np.zeros((len(layout.action), reference.shape[2]))
    joints = [layout.joints.index(layout.driven[a]) for a in layout.action]
    if way == "servo":
        return _driven(reference, rest[joints] + reach[joints] * size * signal, gains, low, high)
    if way in ("balance", "torque"):
        path = _signal("sines", (*shape, len(rest)), world.dt, rng, 0.5 if way == "torque" else 0.2)
        reference[..., 0::2] += 0.8 * reach * path
        reference[..., 1::2] = np.gradient(reference[..., 0::2], world.dt, axis=0)
    weighed = None
    if way == "balance":
        gains = balancing(world.system, world.dt)
    elif way == "torque":
        # A motor without a range gets what its joint can use.
        limited = np.asarray(model.actuator_ctrllimited, dtype=np.bool_)
        plenty = 4.0 * np.asarray(model.dof_M0) * TRACKING**2 * np.maximum(reach, 0.5)
        low, high = np.where(limited, low, -plenty), np.where(limited, high, plenty)
        inertia = np.array(model.dof_M0)
        gains[:, 0::2], gains[:, 1::2] = np.diag(inertia * TRACKING**2), np.diag(1.4 * inertia * TRACKING)
        weighed = model
    else:  # a weak pull back to rest on every joint that has an actuator
        for i, j in enumerate(joints):
            most = float(model.actuator_ctrlrange[i, 1])
            gains[i, 2 * j], gains[i, 2 * j + 1] = 0.5 * most / robot.reach[j], 0.1 * most / robot.reach[j]
    return _driven(reference, DITHER[way] * high * size * signal[:-1], gains, low, high, weighed)


def _fourier(world: World, rng: Rng) -> Driving:
    """Fourier series in every joint (Swevers et al. 1997), within its limits: a servo's commands or what is tracked.

    Tracked by the torques of the model as it is believed, and a proportional and derivative controller.
    """
    robot, layout = robot_of(world.system), layout_of(world.system)
    model = spec_of(world.system).compile()
    q = _series(world, model, rng)
    joints = [layout.joints.index(layout.driven[a]) for a in layout.action]
    reference = np.zeros((*q.shape[:2], 2 * q.shape[2]))
    reference[..., 0::2], reference[..., 1::2] = q, np.gradient(q, world.dt, axis=0)
    gains = np.zeros((len(joints), reference.shape[2]))
    low, high = np.array(model.actuator_ctrlrange, dtype=np.float64).T
    if _way_of(world) == "servo":
        return _driven(reference, q[:, :, joints], gains, low, high)
    high = np.array(robot.drives.torque)[joints]
    rates = np.gradient(reference[..., 1::2], world.dt, axis=0)
    base = bare_torques(model, q, reference[..., 1::2], rates)[:, :, joints]
    moved = np.array(model.dof_M0)[joints] + high / robot.drives.spin[1]
    for i, j in enumerate(joints):
        gains[i, 2 * j : 2 * j + 2] = moved[i] * STIFF**2, 2.0 * CRITICAL * moved[i] * STIFF
    return _driven(reference, base, gains, -high, high)


def _series(world: World, model: Any, rng: Rng) -> FloatArray:
    """(K + 1, E, C) the places that are wanted, from where each episode begins."""
    robot, first = robot_of(world.system), starts(world)[:, 0::2]
    rest = np.array(robot.rest[_way_of(world)])
    t = world.dt * np.arange(world.steps + 1)[:, None, None]
    shape = (HARMONICS, 1, world.episodes, len(rest))
    turns = 2.0 * np.pi * rng.uniform(*SLOWEST_WAVE, shape[1:]) * robot.drives.speed / ORDINARY
    order = np.arange(1, HARMONICS + 1).reshape(-1, 1, 1, 1)
    size, phase = rng.normal(size=shape) / order, rng.uniform(0, 2 * np.pi, shape)
    wave = (size * np.sin(order * turns * t + phase)).sum(axis=0)
    wave /= np.abs(wave).max(axis=0)
    fastest = np.abs(np.gradient(wave, world.dt, axis=0)).max(axis=0)
    room = np.array(robot.reach)
    limited = np.asarray(model.jnt_limited, dtype=bool)
    ways = OWN_ROOM * np.abs(np.asarray(model.jnt_range) - rest[:, None]).min(axis=1)
    room = np.where(limited, np.minimum(room, ways), room)
    reach = np.minimum(room * rng.uniform(0.7, 1.0, wave.shape[1:]), OWN_SPEED * robot.drives.speed / fastest)
    begun = np.clip(t / FADE, 0.0, 1.0)
    begun = begun**2 * (3.0 - 2.0 * begun)
    return np.asarray(first + begun * (rest + reach * wave - first))


def bare_torques(model: Any, q: FloatArray, v: FloatArray, a: FloatArray) -> FloatArray:
    """(..., C) the torques that inertia and gravity ask for along a motion (..., C); neither limits nor friction."""
    mj = mujoco()
    data, flags = mj.MjData(model), int(model.opt.disableflags)
    loss, damping = np.array(model.dof_frictionloss), np.array(model.dof_damping)
    model.opt.disableflags |= int(mj.mjtDisableBit.mjDSBL_CONSTRAINT)
    model.dof_frictionloss[:] = model.dof_damping[:] = 0.0
    out = np.empty((q[..., 0].size, q.shape[-1]))
    for row, *at in zip(out, *(x.reshape(out.shape) for x in (q, v, a)), strict=True):
        data.qpos[:], data.qvel[:], data.qacc[:] = at
        mj.mj_inverse(model, data)
        row[:] = data.qfrc_inverse
    model.opt.disableflags = flags
    model.dof_frictionloss[:], model.dof_damping[:] = loss, damping
    return out.reshape(q.shape)


def sound(world: World, truth: Run) -> FloatArray:
    """(E,) samples that an operator would keep: until a joint ran away, met its limit, or something touched."""
    robot, way, true = robot_of(world.system), _way_of(world), truth.sampled
    away = np.abs(true[..., 0::2] - np.array(robot.rest[way]))
    bad = ~np.isfinite(true).all(axis=2) | (np.abs(true[..., 1::2]) > WILD).any(axis=2) | (truth.free == 0)
    if way == "balance":
        bad |= (away[..., 1:] > FALLEN).any(axis=2)
    elif way in ("servo", "torque"):
        bad |= (away > OFF * (np.array(robot.reach) + np.array(robot.spread))).any(axis=2)
    return np.where(bad.any(axis=0), np.argmax(bad, axis=0), len(true))


@lru_cache(maxsize=8)
def balancing(robot: str, dt: float) -> FloatArray:
    """(A, S) gains that keep the poles up: a linear quadratic regulator about the robot's rest."""
    plant, layout = Plant(robot, ()), layout_of(robot)
    rest = np.zeros(len(layout.state))
    rest[0::2] = robot_of(robot).rest["balance"]
    width, actions, nudge = len(rest), len(layout.action), 1e-4

    def after(state: FloatArray, action: FloatArray) -> FloatArray:
        row = state[None]
        plant.begin(row)
        for _ in range(round(dt / plant.h)):
            row = plant.after(row, action[None])
        return np.asarray(row[0])

    none = np.zeros(actions)
    moved = [after(rest + nudge * e, none) - after(rest - nudge * e, none) for e in np.eye(width)]
    acted = [after(rest, nudge * e) - after(rest, -nudge * e) for e in np.eye(actions)]
    a, b = (np.stack(rows, axis=1) / (2 * nudge) for rows in (moved, acted))
    weight = np.diag([10.0 if i % 2 == 0 else 0.1 for i in range(width)])
    # An actuator at its limit weighs as much as a quarter of a metre or a radian.
    dear = np.diag(1.0 / np.asarray(plant.model.actuator_ctrlrange)[:, 1] ** 2)
    cost = solve_discrete_are(a, b, weight, dear)
    return np.asarray(np.linalg.solve(dear + b.T @ cost @ b, b.T @ cost @ a))


def _signal(
    kind: str, shape: tuple[int, int, int], dt: float, rng: Rng, fastest: float = FASTEST
) -> FloatArray:
    """(K + 1, E, A) in about [-1, 1]: five sines each, or levels of either sign held for a random while."""
    count, episodes, actions = shape
    if kind == "prbs":
        hold = max(round(rng.uniform(0.05, 0.25) / dt), 1)
        flips = rng.random((count // hold + 1, episodes, actions)) > 0.5
        return np.repeat(np.where(flips, 1.0, -1.0), hold, axis=0)[:count]
    t = dt * np.arange(count)[:, None, None]
    spread = (5, 1, episodes, actions)
    frequency = np.exp(rng.uniform(np.log(SLOWEST), np.log(fastest), spread))
    phase = rng.uniform(0, 2 * np.pi, spread)
    return np.asarray(np.clip(np.sin(2 * np.pi * frequency * t + phase).sum(axis=0) / 2.5, -1.0, 1.0))


def run(world: World, effects: Sequence[TrueEffect]) -> Run:
    """Drive a world of few effects."""
    plant, state = Plant(world.system, effects), starts(world)
    return driven(world, effects, frame_of(world.system), plant, drive(world), state, plant.h)


def run_whole(world: World) -> Run:
    """Drive a whole robot; a fine state is a sample's."""
    driving, state = drive(world), starts(world)
    noise = noise_of(world, layout_of(world.system).names)
    plant = Stepped(world.system, world.effects, step_of(world.system))
    n = round(world.dt / plant.h)
    held = plant.late // n  # samples
    plant.late -= held * n
    plant.begin(state)
    fine = np.empty((world.steps + 1, *state.shape))
    fine[0], free = state, np.ones((world.steps + 1, world.episodes))
    commands = np.empty((world.steps, world.episodes, len(layout_of(world.system).action)))
    for k in range(world.steps):
        commands[k] = driving(k, fine[k] + noise[k])
        # Nothing else was commanded before the start.
        before, now = (commands[max(k - back, 0)] for back in (held + 1, held))
        fine[k + 1] = np.nan_to_num(np.clip(plant.sample(before, now, n), -FAR, FAR))
        free[k + 1] = free[k] * touch_free(plant.data)
    empty, clock = np.empty((world.steps + 1, world.episodes, 0)), np.zeros(world.episodes)
    return Run(fine, world.dt, commands, fine, fine + noise, empty, clock, world.offsets, free)
