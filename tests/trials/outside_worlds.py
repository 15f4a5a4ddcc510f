"""Short, perfect worlds with one kind of physics outside the catalogue, and oracles for it."""

from dataclasses import replace

import numpy as np
from scipy.integrate import solve_ivp

from gpsim.trials.catalogue.strengths import Dial, Scales
from gpsim.trials.drawing import draws as drawing
from gpsim.trials.outside.strengths import OUTSIDE
from gpsim.trials.truth.body import Body
from gpsim.trials.truth.replay import Replay
from gpsim.trials.truth.running import run
from gpsim.trials.worlds.systems import SYSTEMS
from gpsim.trials.worlds.world import TrueEffect

H = 1e-3  # s, a fine step


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


def driven(system, parameters, effect, start, push, seconds):
    """(K + 1, S) and (K + 1, H) state and hidden state under the push(t), every fine step."""
    body, s = Body(system, parameters, [effect]), np.array([start])
    z = body.begin(s)
    states, hidden = [s[0]], [z[0]]
    for i in range(round(seconds / H)):
        t = np.full(1, i * H)
        s, z = body.step(s, z, np.full((1, 1), push(i * H + H / 2)), t, t, H)
        states.append(s[0])
        hidden.append(z[0])
    return np.array(states), np.array(hidden)


def reference(slope, start, seconds, points):
    """(points, N) of y' = slope(t, y), by a method and tolerances of its own; no step jumps over a knock."""
    t = np.linspace(0.0, seconds, points)
    return solve_ivp(
        slope, (0.0, seconds), start, method="DOP853", t_eval=t, rtol=1e-10, atol=1e-12, max_step=2e-3
    ).y.T


def check_replay(kind, system):
    """A run that begins in its middle goes on as it did, whatever the kind remembers."""
    effect = effect_of(kind, system, 0.8)
    world = world_of(system, [effect])
    truth = run(world, [effect])
    picks = np.array([[0, 7, 33], [0, 1, 2]])
    states = Replay(world, truth, [effect]).states(picks, 20)
    np.testing.assert_allclose(states, truth.sampled[picks[0] + 20, picks[1]], atol=1e-9)
