"""The recording of a world on an even clock, with every row there."""

from __future__ import annotations

import numpy as np
from scipy.signal import savgol_filter

from gpsim.channels import Channels, FloatArray, wrap_angle
from gpsim.recordings import Episode, HeldOut, Recording
from gpsim.trials.worlds import SYSTEMS, Run, World


def even_recording(world: World, readings: FloatArray, truth: Run, kept: FloatArray) -> Recording:
    """The readings (K + 1, E, S) as a user would have them."""
    system = SYSTEMS[world.system]
    state = Channels.of(system.state, ("yaw",) if system.vehicle else ())
    episodes: list[Episode] = []
    for e in np.flatnonzero(kept):
        count = int(kept[e])
        states = readings[:count, e].copy()
        if world.velocities == "differentiated":
            states[:, 1::2] = _differentiated(states[:, 0::2], world)
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


def _differentiated(positions: FloatArray, world: World) -> FloatArray:
    """(K + 1, C) velocities as users make them of positions."""
    if world.smoothing == "savgol":
        return np.asarray(savgol_filter(positions, 7, 2, deriv=1, delta=world.dt, axis=0))
    return np.asarray(np.gradient(positions, world.dt, axis=0))
