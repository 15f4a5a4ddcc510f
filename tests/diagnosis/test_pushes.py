"""A moment at which something from outside acted is left out and said; what a model misses a little is none."""

from dataclasses import replace

import numpy as np
import pytest

from gpsim.diagnosis.diagnosis import diagnose
from gpsim.simulators import make_simulator

from .worlds import P, World, record

RATE = 0.4  # 1/s, at which friction brakes the slider
BRAKED = World("slider", forces={0: lambda q, v, t: -RATE * P["slider"]["mass"] * v})


def pushed(recording, speed):
    """Its speed jumps by so much [m/s] in an episode, and it goes on from there."""
    one, hit, *others = recording.episodes
    at, states = 90, np.array(hit.states)
    after = hit.t[at:] - hit.t[at]
    states[at:, 1] += speed * np.exp(-RATE * after)
    states[at:, 0] += speed * (1.0 - np.exp(-RATE * after)) / RATE
    return replace(recording, episodes=(one, replace(hit, states=states), *others))


@pytest.mark.parametrize("speed", [0.0, 3.0])
def test_a_push_is_told_and_buys_no_law(speed):
    recording = pushed(record(BRAKED, seed=3, episodes=6, steps=155), speed)
    simulator = make_simulator("slider")
    found = diagnose(recording, simulator, recording.parameters, np.random.default_rng(0)).diagnosis
    assert any(fact.kind == "pushed" for fact in found.facts) == (speed > 0.0)
    assert [(e.family, e.on) for e in found.effects if e.role == "headline"] == [("viscous_friction", "q")]
