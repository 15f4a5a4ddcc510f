"""The recording of a world: on an even clock with every row there, or as it was logged, with the defects of a log."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from scipy.signal import savgol_filter

from gpsim.channels import BoolArray, Channels, FloatArray, IntArray, wrap_angle
from gpsim.recordings import Episode, HeldOut, Recording
from gpsim.trials.worlds import SYSTEMS, Rough, Run, World


def even_recording(world: World, readings: FloatArray, truth: Run, kept: FloatArray) -> Recording:
    """The readings (K + 1, E, S) as a user would have them."""
    system = SYSTEMS[world.system]
    state = Channels.of(system.state, ("yaw",) if system.vehicle else ())
    episodes: list[Episode] = []
    for e in np.flatnonzero(kept):
        count = int(kept[e])
        states = readings[:count, e].copy()
        if world.velocities == "differentiated":
            states[:, 1::2] = _differentiated(states[:, 0::2], world.dt, world)
        if system.vehicle and world.wrapped:
            states[:, 2] = wrap_angle(states[:, 2])
        t = world.clock_offsets[e] + world.dt * np.arange(count)
        episodes.append(Episode(str(len(episodes)), np.round(t, 9), states, truth.commands[: count - 1, e]))
    held_out = None
    if world.held_out is not None:
        held_out = HeldOut(episodes_from=round(0.8 * len(episodes)))
    noise = {
        n: sd
        for i, (n, sd) in enumerate(world.noise.items())
        if world.noise_known and not (world.velocities == "differentiated" and i % 2)
    }
    return Recording(
        system=world.system,
        state=state,
        action=Channels.of(system.action),
        episodes=tuple(episodes),
        dt=world.dt,
        parameters=world.parameters,
        integrator=world.integrator,
        velocities=world.velocities,
        clock=world.clock,
        noise=noise,
        held_out=held_out,
    )


MOST_LATE = 0.4  # of a sample, that a stamp is off
SPIKES = 0.01  # share of the stamps that are as late as that
BURST, LONGEST_BURST = 2.0, 8  # rows that are lost together, on average and at most
SWAP = 4  # rows of a swap, at most
WINDOW, ORDER = 7, 2  # of the filter that differentiates


class Logged(NamedTuple):
    """The recording; and how many rows of it have each defect."""

    recording: Recording
    counts: Mapping[str, int]


def logged(world: World, rough: Rough, even: Recording) -> Logged:
    """The log of a recording that is `even`, with measured velocities and without a defect."""
    rng, names = world.generator(5), even.state.names
    counts = dict.fromkeys(("dropped", "repeated", "swapped"), 0)
    episodes = []
    for i, episode in enumerate(even.episodes):
        states = _read(episode.states, names, rough)
        stale = _scattered(len(states), rough.repeated, 1.0, 1, rng)
        for k in np.flatnonzero(stale):
            states[k] = states[k - 1]
        swapped = _scattered(len(states), rough.swapped, 0.5 * SWAP, SWAP, rng)
        for j, name in enumerate(names):
            states[swapped, j] += rough.leap.get(name, 0.0)
        lost = _scattered(len(states), rough.dropped, BURST, LONGEST_BURST, rng)
        there = np.flatnonzero(~lost)
        t = _stamps(episode.t, world, rough, rng)[there]
        states = states[there]
        if world.velocities == "differentiated":
            states[:, 1::2] = _differentiated(states[:, 0::2], t, world)
        if "yaw" in names and world.wrapped:
            states[:, 2] = wrap_angle(states[:, 2])
        counts["repeated"] += int(stale[there].sum())
        counts["swapped"] += int(swapped[there].sum())
        counts["dropped"] += int(lost.sum())
        episodes.append(Episode(str(i), np.round(t, 9), states, episode.actions[there[:-1]]))
    return Logged(replace(even, episodes=tuple(episodes)), counts)


def _read(states: FloatArray, names: Sequence[str], rough: Rough) -> FloatArray:
    """To the nearest of an encoder's steps."""
    out = states.copy()
    for i, name in enumerate(names):
        if step := rough.quantum.get(name, 0.0):
            out[:, i] = step * np.round(out[:, i] / step)
    return out


def _scattered(rows: int, share: float, mean: float, longest: int, rng: np.random.Generator) -> BoolArray:
    """(rows,) a share of them, in bursts; never the first row or the last."""
    hit = np.zeros(rows, dtype=bool)
    starts: IntArray = np.flatnonzero(rng.random(rows) < share / mean)
    for k in starts:
        hit[k : k + min(int(rng.geometric(1.0 / mean)), longest)] = True
    hit[[0, -1]] = False
    return hit


def _stamps(t: FloatArray, world: World, rough: Rough, rng: np.random.Generator) -> FloatArray:
    """(K + 1,) what the recording's clock said at the true moments t."""
    late = np.clip(rng.normal(size=len(t)) * rough.jitter, -MOST_LATE * world.dt, MOST_LATE * world.dt)
    if rough.jitter:
        late[rng.random(len(t)) < SPIKES] = MOST_LATE * world.dt
    return np.asarray((1.0 + rough.drift) * t + late)


def _differentiated(positions: FloatArray, t: FloatArray | float, world: World) -> FloatArray:
    """(K + 1, C) velocities as users make them of positions: over stamps or steps, or by a filter that trusts dt."""
    if world.smoothing == "savgol" and len(positions) > WINDOW:
        return np.asarray(savgol_filter(positions, WINDOW, ORDER, deriv=1, delta=world.dt, axis=0))
    return np.asarray(np.gradient(positions, t, axis=0))
