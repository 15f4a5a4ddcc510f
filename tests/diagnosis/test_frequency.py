"""The frequency view: the response of a machine that is known, and none where nothing excites it."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.linalg import expm

import gpsim
from gpsim.traces import EFFECTS, MEASURED, frequency

from .worlds import World, record

MASS, DAMPING, STIFFNESS = 2.0, 6.0, 72.0
SPRUNG = World("slider", forces={0: lambda q, v, t: -STIFFNESS * q - DAMPING * v})
KNOWN = {"only": ["spring", "viscous_friction"]}
NAME = "frequency_response"
SURE = (
    0.9  # coherence from which the measured line is held to a tenth: it errs by as much as sqrt(1 - c) says
)


def sampled(f, dt, channel):
    """(F,) magnitude of the response of mass, spring and damper whose command is held over every step."""
    slopes = np.array([[0.0, 1.0, 0.0], [-STIFFNESS / MASS, -DAMPING / MASS, 1.0 / MASS], [0.0, 0.0, 0.0]])
    whole = expm(slopes * dt)
    turns = np.exp(2j * np.pi * f * dt)
    answers = [np.linalg.solve(z * np.eye(2) - whole[:2, :2], whole[:2, 2]) for z in turns]
    return np.abs(np.array(answers)[:, channel])


@pytest.fixture(scope="module")
def recording():
    return record(SPRUNG, seed=1, episodes=6, steps=1500)


def test_a_known_response_is_recovered_where_it_is_coherent(recording):
    found = gpsim.diagnose(recording, families=KNOWN)
    picture = found.plot(NAME)
    assert picture.png.startswith(b"\x89PNG")
    assert "coherence" in picture.caption
    outcome = found._found.outcome
    response = frequency(outcome.question, outcome.judgement.leader.hypothesis)
    truth = sampled(response.f, recording.dt, response.channel)
    shown = response.shown
    assert response.f[shown].max() > 10 * response.f[shown].min()
    off = {kind: np.abs(m / truth - 1.0) for kind, m in response.magnitudes.items()}
    assert off[EFFECTS][shown].max() < 0.1
    assert off[MEASURED][response.coherences[MEASURED] >= SURE].max() < 0.1
    assert off["base"][shown].max() > 1.0  # it has no resonance


def test_there_is_none_without_excitation(recording):
    quiet = tuple(replace(e, actions=0.0 * e.actions) for e in recording.episodes)
    found = gpsim.diagnose(replace(recording, episodes=quiet), families=KNOWN)
    assert "residual_time" in found.plots
    assert NAME not in found.plots
