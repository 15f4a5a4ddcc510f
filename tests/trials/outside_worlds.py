"""Short, perfect worlds with one kind of physics outside the catalogue."""

from dataclasses import replace

import numpy as np

from gpsim.trials import drawing
from gpsim.trials.outside_strengths import OUTSIDE
from gpsim.trials.running import run
from gpsim.trials.strengths import Dial, Scales
from gpsim.trials.systems import SYSTEMS
from gpsim.trials.worlds import TrueEffect


def world_of(system, effects=(), **changes):
    """A short, perfect world of a system."""
    place = SYSTEMS[system]
    velocities = None if place.vehicle else "measured"
    base = drawing._world(3001, 7, 1, "unknown", False, place, velocities, [], np.random.default_rng(3))
    small = {"episodes": 4, "steps": 60, "dt": 0.02, "noise": dict.fromkeys(place.state, 0.0)}
    return replace(base, **{**small, "effects": tuple(effects), "excitation": "sines", **changes})


def effect_of(kind, system, strength, place=0):
    """The kind on one of its places (the first), as strong as asked."""
    world = world_of(system)
    on = drawing.places_of(kind, SYSTEMS[system], "measured")[place]
    values = OUTSIDE[kind](Scales(world, run(world, ())), on, Dial(np.random.default_rng(1), strength))
    return TrueEffect(kind, on, values, outside=True)
