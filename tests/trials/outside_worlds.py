"""Short, perfect worlds with one kind of physics outside the catalogue, and oracles for it."""

from dataclasses import replace
from functools import cache

import numpy as np

from gpsim.trials import drawing as draws
from gpsim.trials.bodies import Body, Now
from gpsim.trials.drawing import places_of
from gpsim.trials.out_of_catalogue import KINDS
from gpsim.trials.truth import Replay, run
from gpsim.trials.worlds import SYSTEMS, Dial, Scales, TrueEffect

CART = {"gravity": 9.8, "cart_mass": 1.2, "pole_mass": 0.2, "pole_half_length": 0.4}
BOB = {"gravity": 9.8, "mass": 0.8, "length": 0.5}
H = 1e-3  # s, a fine step


def world_of(system, effects=(), **changes):
    """A short, perfect world of a system."""
    place = SYSTEMS[system]
    velocities = None if place.vehicle else "measured"
    base = draws.bare_world(3001, 7, 1, "unknown", False, place, velocities, [], np.random.default_rng(3))
    small = {"episodes": 4, "steps": 60, "dt": 0.02, "noise": dict.fromkeys(place.state, 0.0)}
    return replace(base, **{**small, "effects": tuple(effects), "excitation": "sines", **changes})


@cache
def bare(system, steps=60):
    """A world without effects, and what truly happens in it."""
    world = world_of(system, steps=steps)
    return world, run(world, ())


def effect_of(kind, system, strength, place=0):
    """The kind on one of its places (the first), as strong as asked."""
    on = places_of(kind, SYSTEMS[system], "measured")[place]
    values = KINDS[kind].drawn(Scales(*bare(system)), on, Dial(np.random.default_rng(1), strength))
    return TrueEffect(kind, on, values, out_of_catalogue=True)


def driven(system, parameters, effect, start, push, seconds):
    """(K + 1, S) and (K + 1, H) state and hidden state under the push(t), every fine step."""
    body, s = Body(system, parameters, [effect]), np.array([start])
    z = body.begin(s)
    states, hidden = [s[0]], [z[0]]
    for i in range(round(seconds / H)):
        t = np.full(1, i * H)
        s, z = body.step(s, z, Now(np.full((1, 1), push(i * H + H / 2)), t, t), H)
        states.append(s[0])
        hidden.append(z[0])
    return np.array(states), np.array(hidden)


def slid(kind, k, start, push, seconds):
    """State and hidden state of a slider of 2 kg, every fine step."""
    return driven("slider", {"mass": 2.0}, TrueEffect(kind, "q", k), start, push, seconds)


def check_replay(kind, system):
    """A run that begins in its middle goes on as it did, whatever the kind remembers."""
    effect = effect_of(kind, system, 0.8)
    world = world_of(system, [effect], steps=45)
    truth = run(world, [effect])
    picks = np.array([[0, 7, 33], [0, 1, 2]])
    states = Replay(world, truth, [effect]).states(picks, 12)
    np.testing.assert_allclose(states, truth.sampled[picks[0] + 12, picks[1]], atol=1e-9)
