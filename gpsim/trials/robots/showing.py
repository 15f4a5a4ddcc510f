"""How much an effect of a robot's world shows: what the readings would be without it, begun where it is read to be."""

from __future__ import annotations

import numpy as np

from gpsim.channels import FloatArray
from gpsim.recordings import evenly
from gpsim.trials.robots.models import layout_of
from gpsim.trials.robots.plant import Plant
from gpsim.trials.robots.running import Chain, read
from gpsim.trials.worlds import Run, World

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
