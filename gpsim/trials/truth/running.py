"""Running a concealed world: command, actuators, body, sensors, noise; fine steps of a millisecond."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from gpsim.channels import FloatArray
from gpsim.trials import catalogue
from gpsim.trials.truth.actuator_chain import ActuatorChain
from gpsim.trials.truth.body import Body
from gpsim.trials.truth.mujoco_body import MujocoBody
from gpsim.trials.truth.sensing import sense
from gpsim.trials.truth.vehicle import Vehicle
from gpsim.trials.worlds import SYSTEMS, Run, TrueEffect, World, drive, starts

H = 1e-3  # s
FRICTION_H = 2.5e-4  # s: MuJoCo meets a stop at the ends of steps only


def body_of(
    world: World, effects: Sequence[TrueEffect], engine: str, h: float
) -> Body | Vehicle | MujocoBody:
    """What moves."""
    if SYSTEMS[world.system].vehicle:
        return Vehicle(effects)
    if engine == "mujoco":
        return MujocoBody(world.system, world.parameters, effects, h)
    return Body(world.system, world.parameters, effects)


def run(world: World, effects: Sequence[TrueEffect], h: float | None = None) -> Run:
    """Drive the world; `h` is the fine step, by default the engine's own."""
    dry = any(e.family in catalogue.GRIP for e in effects)
    h = h or (FRICTION_H if world.engine == "mujoco" and dry else H)
    n, driving, state = round(world.dt / h), drive(world), starts(world)
    names = SYSTEMS[world.system].names
    body, chain = body_of(world, effects, world.engine, h), ActuatorChain(world.system, effects)
    hidden, sensors = body.begin(state), (*effects, *world.late)
    noise = noise_of(world)
    fine = np.empty((world.steps * n + 1, *state.shape))
    fine[0] = state
    commands = np.empty((world.steps, world.episodes, len(SYSTEMS[world.system].action)))
    clean = np.empty((world.steps + 1, *state.shape))
    kept = np.empty((world.steps + 1, *hidden.shape))
    with np.errstate(all="ignore"):
        for k in range(world.steps):
            clean[k], kept[k] = sense(sensors, names, fine, k * n, h), hidden
            commands[k] = driving.command(k, clean[k] + noise[k])
            for j in range(n):
                late = k * world.dt + j * h
                t, wall = world.clock_offsets + late, world.offsets + late
                acting = chain.act(commands[k], state, t, h)
                state, hidden = body.step(state, hidden, acting, t, wall, h)
                fine[k * n + j + 1] = state
            state = np.nan_to_num(np.clip(state, -1e6, 1e6))
    clean[-1], kept[-1] = sense(sensors, names, fine, world.steps * n, h), hidden
    return Run(fine, h, commands, clean, clean + noise, kept, world.clock_offsets, world.offsets)


def noise_of(world: World) -> FloatArray:
    """(K + 1, E, S) what the sensors add."""
    rng = world.generator(3)
    sd = np.array([world.noise[name] for name in SYSTEMS[world.system].names])
    return np.asarray(rng.normal(size=(world.steps + 1, world.episodes, len(sd))) * sd)
