"""States that nobody measured: worked out once for each hypothesis, and each model starts from its own."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from gpsim import load_simulator
from gpsim.channels import Channels
from gpsim.diagnosis.fitting import Hypothesis
from gpsim.diagnosis.setup import prepare
from gpsim.effects import Term
from gpsim.traces import BASE, EFFECTS, course

from .own_systems import SLIDER
from .worlds import World, record

PULL = 6.0


@pytest.fixture(scope="module")
def question(tmp_path_factory):
    """A slider under a constant pull whose speed nobody measured."""
    path: Path = tmp_path_factory.mktemp("system") / "mine.py"
    path.write_text(SLIDER)
    simulator = load_simulator(f"{path}:Slider")
    full = record(World("slider", forces={0: lambda q, v, t: PULL + 0 * q}), episodes=6, steps=100)
    recording = replace(
        full,
        state=Channels.of({"q": "m"}),
        episodes=tuple(replace(e, states=e.states[:, :1]) for e in full.episodes),
        noise={"q": full.noise["q"]},
    )
    return prepare(recording, simulator, simulator.defaults())


def test_the_course_starts_each_model_from_its_own_hidden_state(question, monkeypatch):
    pulled = Hypothesis((Term("constant_force", "q", {"force": PULL}),), ((),))
    own = course(question, pulled)
    monkeypatch.setitem(course.__globals__, "completed", lambda problem, model, names: problem.windows)
    bases = course(question, pulled)
    assert np.median(own.sizes[EFFECTS]) < 0.2 * np.median(own.sizes[BASE])
    assert np.median(own.sizes[EFFECTS]) < 0.5 * np.median(bases.sizes[EFFECTS])
