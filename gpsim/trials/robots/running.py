"""Running a robot's world: command, actuators, plant, sensors, noise."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from gpsim.channels import FloatArray
from gpsim.trials import catalogue
from gpsim.trials.robots.driving import drive, starts
from gpsim.trials.robots.models import layout_of
from gpsim.trials.robots.plant import Plant
from gpsim.trials.worlds import Run, TrueEffect, World

ORDER = tuple(catalogue.ACTUATORS)
ADDS = "joint_offset"  # to the reading of its joint, as a sensor's bias does


class Chain:
    """The actuators of every action, in their order, with their memory."""

    def __init__(self, robot: str, effects: Sequence[TrueEffect]) -> None:
        actions = tuple(layout_of(robot).action)
        ordered = sorted((e for e in effects if e.family in ORDER), key=lambda e: ORDER.index(e.family))
        self._parts = [(actions.index(e.on), catalogue.ACTUATORS[e.family](e.values)) for e in ordered]

    def act(self, command: FloatArray, s: FloatArray, t: FloatArray, h: float) -> FloatArray:
        """(E, A) what acts during the next h s."""
        out = command.copy()
        for column, actuator in self._parts:
            out[:, column] = actuator.act(out[:, column].copy(), s, t, h)
        return out


def read(
    effects: Sequence[TrueEffect], names: tuple[str, ...], past: FloatArray, index: int, h: float
) -> FloatArray:
    """(E, S) what the sensors say at fine step `index`; past: (>= index + 1, E, S) true states every h s."""
    now = past[index].copy()
    for effect in (e for e in effects if e.family == "sensor_delay"):
        column = names.index(effect.on)
        now[:, column] = past[max(index - round(effect.values["delay"] / h), 0), :, column]
    for effect in effects:
        if effect.family == ADDS:
            now[:, names.index(effect.on)] += effect.values["offset"]
        catalogue.read(effect, names, now)
    return np.asarray(now)


def run(world: World, effects: Sequence[TrueEffect]) -> tuple[Run, FloatArray]:
    """Drive the world; and (K + 1, E) 1 where nothing touched up to then."""
    names, driving, state = layout_of(world.system).names, drive(world), starts(world)
    plant, chain = Plant(world.system, effects), Chain(world.system, effects)
    h, n = plant.h, round(world.dt / plant.h)
    plant.begin(world.episodes)
    noise = noise_of(world)
    fine = np.empty((world.steps * n + 1, *state.shape))
    fine[0] = state
    commands = np.empty((world.steps, world.episodes, len(layout_of(world.system).action)))
    clean = np.empty((world.steps + 1, *state.shape))
    free = np.ones((world.steps + 1, world.episodes))
    with np.errstate(all="ignore"):
        for k in range(world.steps):
            clean[k] = read(effects, names, fine, k * n, h)
            commands[k] = driving.command(k, clean[k] + noise[k])
            for j in range(n):
                t = np.full(world.episodes, k * world.dt + j * h)
                state = plant.step(state, chain.act(commands[k], state, t, h))
                fine[k * n + j + 1] = state
            free[k + 1] = free[k] * plant.free()
            state = np.nan_to_num(np.clip(state, -1e3, 1e3))
    clean[-1] = read(effects, names, fine, world.steps * n, h)
    hidden, clock = np.empty((world.steps + 1, world.episodes, 0)), np.zeros(world.episodes)
    return Run(fine, h, commands, clean, clean + noise, hidden, clock, world.offsets), free


def noise_of(world: World) -> FloatArray:
    """(K + 1, E, S) what the sensors add."""
    sd = np.array([world.noise[name] for name in layout_of(world.system).names])
    return np.asarray(world.generator(3).normal(size=(world.steps + 1, world.episodes, len(sd))) * sd)
