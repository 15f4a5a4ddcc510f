"""Running a robot's world: command, actuators, plant, sensors, noise."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from gpsim.channels import Channels, FloatArray
from gpsim.recordings import Episode, Recording, evenly
from gpsim.trials import catalogue
from gpsim.trials.robots.driving import drive, starts
from gpsim.trials.robots.models import layout_of, robot_of
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


SYSTEM = "mjcf"


def recorded(world: World, readings: FloatArray, truth: Run, kept: FloatArray) -> Recording:
    """The readings (K + 1, E, S) of the first kept (E,) samples of every episode; velocities where they are read."""
    layout = layout_of(world.system)
    names = [n for n in layout.names if world.velocities or n in layout.joints]
    columns = [layout.names.index(n) for n in names]
    episodes = tuple(
        Episode(
            str(number),
            np.round(world.dt * np.arange(int(kept[e])), 9),
            readings[: int(kept[e]), e][:, columns].copy(),
            truth.commands[: int(kept[e]) - 1, e],
        )
        for number, e in enumerate(np.flatnonzero(kept))
    )
    return Recording(
        system=SYSTEM,
        state=Channels.of({n: layout.state[n] for n in names}),
        action=Channels.of(layout.action),
        episodes=episodes,
        dt=world.dt,
        velocities=world.velocities,
        noise={n: world.noise[n] for n in names} if world.noise_known else {},
        model=robot_of(world.system).file,
    )


HORIZON, MOST = 0.4, 24  # s; pieces of the run that are replayed
SHOWS = 4.0  # standard deviations of the noise


def shown(world: World, truth: Run, kept: FloatArray) -> list[float]:
    """Of every effect how far its absence moves the readings within the horizon: root mean square, in noise's.

    In the channel where that is most, of those that are recorded. kept: (E,) samples of every episode.
    """
    layout, n = layout_of(world.system), truth.per_sample
    length = max(round(HORIZON / world.dt), 10)
    rows = [(k, e) for e in np.flatnonzero(kept > length) for k in range(0, int(kept[e]) - length, length)]
    if not rows:
        return [0.0] * len(world.effects)
    picks = np.array(rows)[evenly(len(rows), MOST)].T
    noise = np.array([world.noise[name] for name in layout.names])
    recorded = slice(None) if world.velocities else slice(0, None, 2)
    return [_moved(world, truth, picks, length, i, n, noise, recorded) for i in range(len(world.effects))]


def _moved(
    world: World,
    truth: Run,
    picks: FloatArray,
    length: int,
    absent: int,
    n: int,
    noise: FloatArray,
    recorded: slice,
) -> float:
    rest = tuple(e for i, e in enumerate(world.effects) if i != absent)
    names, first, rows = layout_of(world.system).names, picks[0], picks[1]
    acting = _acting(world, truth, rest, n)
    bare = _readings(rest, names, truth, n)
    # Whoever knows nothing of the effect takes what is read for where the robot is.
    state = truth.sampled[first, rows] + truth.clean[first, rows] - bare[first, rows]
    plant = Plant(world.system, rest, truth.h)
    plant.begin(len(first))
    squares = np.zeros(state.shape[1])
    for j in range(length * n):
        state = plant.step(state, acting[first * n + j, rows])
        if (j + 1) % n == 0:
            k = first + (j + 1) // n
            said = state - truth.sampled[k, rows] + bare[k, rows]
            squares += np.mean((said - truth.clean[k, rows]) ** 2, axis=0) / length
    return float(np.max((np.sqrt(np.nan_to_num(squares, nan=np.inf)) / noise)[recorded]))


def _acting(world: World, truth: Run, effects: tuple, n: int) -> FloatArray:  # type: ignore[type-arg]
    """(K n, E, A) what the actuators make of the commands."""
    chain, (count, episodes, actions) = Chain(world.system, effects), truth.commands.shape
    out = np.empty((count * n, episodes, actions))
    for i in range(len(out)):
        out[i] = chain.act(truth.commands[i // n], truth.fine[i], np.full(episodes, i * truth.h), truth.h)
    return out


def _readings(effects: tuple, names: tuple[str, ...], truth: Run, n: int) -> FloatArray:  # type: ignore[type-arg]
    """(K + 1, E, S) what the sensors say of the true states."""
    return np.stack([read(effects, names, truth.fine, i, truth.h) for i in range(0, len(truth.fine), n)])
