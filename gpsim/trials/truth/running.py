"""Running a concealed world: command, actuators, what moves, sensors, noise."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from gpsim.channels import FloatArray
from gpsim.trials import catalogue, outside
from gpsim.trials.truth.body import Body, Moving, MujocoBody, Vehicle
from gpsim.trials.worlds import SYSTEMS, Driving, Run, TrueEffect, Values, World, drive, starts

SENSORS = catalogue.SENSORS
REMEMBERING, DISTORTING = outside.at_site(outside.SensorWithMemory), outside.at_site(outside.Distortion)


def sense(
    effects: Sequence[TrueEffect], names: tuple[str, ...], past: FloatArray, index: int, h: float
) -> FloatArray:
    """(E, S) readings at fine step `index`; past: (>= index + 1, E, S) true states every h s.

    What a delayed sensor saw before the start is the start: episodes begin at rest.
    """
    now = past[index].copy()
    ordered = sorted((e for e in effects if e.family in SENSORS), key=lambda e: SENSORS.index(e.family))
    for effect in (e for e in ordered if e.family == "sensor_delay"):
        column = names.index(effect.on)
        back = max(index - round(effect.values["delay"] / h), 0)
        now[:, column] = past[back, :, column]
    for effect in (e for e in effects if e.family in REMEMBERING):
        column = names.index(effect.on)
        now[:, column] = REMEMBERING[effect.family](effect.values).read(past[: index + 1, :, column], h)
    for effect in (e for e in effects if e.family in catalogue.PAST_SENSORS):
        column = names.index(effect.on)
        law = catalogue.PAST_SENSORS[effect.family]
        now[:, column] = law(effect.values, past[: index + 1, :, column], h)
    for effect in ordered:
        catalogue.read(effect, names, now)
    for effect in (e for e in effects if e.family in DISTORTING):
        part = slice(0, 2) if effect.on == "pose" else names.index(effect.on)
        now[:, part] = DISTORTING[effect.family](effect.values).read(now[:, part])
    return np.asarray(now)


def limited(effects: Sequence[TrueEffect], names: tuple[str, ...], readings: FloatArray) -> FloatArray:
    """(..., S) what is written down of readings, noise included: a sensor's range and dead zone act on both."""
    out = readings
    for effect in (e for e in effects if e.family in catalogue.LAST_SENSORS):
        column, out = names.index(effect.on), out.copy()
        out[..., column] = catalogue.LAST_SENSORS[effect.family](effect.values, out[..., column])
    return out


ACTUATORS: Mapping[str, Callable[[Values], catalogue.Actuator]] = {
    **catalogue.ACTUATORS,
    **outside.at_site(outside.Actuator),
}
ACTUATOR_ORDER = tuple(ACTUATORS)


class Frame(NamedTuple):
    """What a world's simulator is made of: its channels, its commands, and what moves with some effects."""

    names: tuple[str, ...]
    actions: tuple[str, ...]
    body: Callable[[Sequence[TrueEffect], float], Moving]


def frame_of(world: World) -> Frame:
    """Of a world whose equations are known; by Runge-Kutta steps."""
    system = SYSTEMS[world.system]
    return Frame(system.names, tuple(system.action), lambda effects, h: body_of(world, effects, "rk4", h))


class ActuatorChain:
    """The actuators of every action, in their order, with their memory."""

    def __init__(self, frame: Frame, effects: Sequence[TrueEffect]) -> None:
        own = (e for e in effects if e.family in ACTUATORS)
        ordered = sorted(own, key=lambda e: ACTUATOR_ORDER.index(e.family))
        self._names = frame.names
        self._parts = [(e, frame.actions.index(e.on), ACTUATORS[e.family](e.values)) for e in ordered]

    def act(self, command: FloatArray, s: FloatArray, t: FloatArray, h: float) -> FloatArray:
        """(B, A) what acts during the next h s."""
        if not self._parts:
            return command
        out = command.copy()
        for effect, column, actuator in self._parts:
            acted = actuator.act(out[:, column].copy(), s, t, h)
            if effect.gated:
                acted = np.where(effect.acts(s, t, self._names) > 0, acted, out[:, column])
            out[:, column] = acted
        return out


H = 1e-3  # s
FRICTION_H = 2.5e-4  # s: MuJoCo meets a stop at the ends of steps only
FAR = 1e6  # where a state that runs away is held


def body_of(world: World, effects: Sequence[TrueEffect], engine: str, h: float) -> Moving:
    """What moves."""
    if SYSTEMS[world.system].vehicle:
        return Vehicle(effects)
    if engine == "mujoco":
        return MujocoBody(world.system, world.parameters, effects, h)
    return Body(world.system, world.parameters, effects)


def run(
    world: World, effects: Sequence[TrueEffect], h: float | None = None, driving: Driving | None = None
) -> Run:
    """Drive the world; `h` is the fine step, by default the engine's own; driving: the world's own excitation."""
    dry = any(e.family in catalogue.GRIP for e in effects)
    h = h or (FRICTION_H if world.engine == "mujoco" and dry else H)
    driving, body = driving or drive(world), body_of(world, effects, world.engine, h)
    return driven(world, effects, frame_of(world), body, driving, starts(world), h)


def driven(
    world: World,
    effects: Sequence[TrueEffect],
    frame: Frame,
    body: Moving,
    driving: Driving,
    state: FloatArray,
    h: float,
    far: float = FAR,
) -> Run:
    """The run of a world from states (E, S), by fine steps of h s; far: where a state that runs away is held."""
    names, n, chain = frame.names, round(world.dt / h), ActuatorChain(frame, effects)
    hidden, sensors, noise = body.begin(state), (*effects, *world.late), noise_of(world, names)
    fine = np.empty((world.steps * n + 1, *state.shape))
    fine[0] = state
    commands = np.empty((world.steps, world.episodes, len(frame.actions)))
    clean = np.empty((world.steps + 1, *state.shape))
    kept, free = np.empty((world.steps + 1, *hidden.shape)), np.ones((world.steps + 1, world.episodes))
    with np.errstate(all="ignore"):
        for k in range(world.steps):
            clean[k], kept[k] = sense(sensors, names, fine, k * n, h), hidden
            commands[k] = driving.command(k, limited(effects, names, clean[k] + noise[k]))
            for j in range(n):
                late = k * world.dt + j * h
                t, wall = world.clock_offsets + late, world.offsets + late
                acting = chain.act(commands[k], state, t, h)
                state, hidden = body.step(state, hidden, acting, t, wall, h)
                fine[k * n + j + 1] = state
            free[k + 1] = free[k] * body.free()
            state = np.nan_to_num(np.clip(state, -far, far))
    clean[-1], kept[-1] = sense(sensors, names, fine, world.steps * n, h), hidden
    perfect, measured = (limited(effects, names, readings) for readings in (clean, clean + noise))
    return Run(fine, h, commands, perfect, measured, kept, world.clock_offsets, world.offsets, free)


def noise_of(world: World, names: tuple[str, ...]) -> FloatArray:
    """(K + 1, E, S) what the sensors add."""
    sd = np.array([world.noise[name] for name in names])
    return np.asarray(world.generator(3).normal(size=(world.steps + 1, world.episodes, len(sd))) * sd)
