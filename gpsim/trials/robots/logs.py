"""The recording of a robot's world, as a user of its model would have it."""

from __future__ import annotations

import numpy as np

from gpsim.channels import Channels, FloatArray
from gpsim.recordings import Episode, Recording
from gpsim.trials.robots.models import ROBOTS, layout_of
from gpsim.trials.worlds import Run, World

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
        model=ROBOTS[world.system].file,
    )
