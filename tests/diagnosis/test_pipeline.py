"""The pipeline: two diagnoses in one process, decisions in their order, settings that change them, progress."""

import json
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

from gpsim.diagnosis import diagnose
from gpsim.diagnosis.run import Run
from gpsim.diagnosis.settings import read_settings
from gpsim.files import plain
from gpsim.simulators import make_simulator

from .worlds import World, record

BRAKED = World("slider", forces={0: lambda q, v, t: -1.3 * v})
PUSHED = World("slider", forces={0: lambda q, v, t: 0.8 + 0.0 * v})


@pytest.fixture(scope="module")
def braked():
    return record(BRAKED, seed=3, episodes=4, steps=120)


def answer(recording, run=None):
    run = run or Run()
    found = diagnose(
        recording, make_simulator("slider"), recording.parameters, np.random.default_rng(0), run=run
    )
    return json.dumps(plain(found.diagnosis.to_dict())), list(found.decisions)


@pytest.fixture(scope="module")
def answered(braked):
    return answer(braked)


def test_two_diagnoses_in_threads_say_what_each_says_alone(braked, answered):
    pushed = record(PUSHED, seed=4, episodes=4, steps=120)
    with ThreadPoolExecutor(2) as pool:
        together = list(pool.map(answer, [braked, pushed]))
    assert together == [answered, answer(pushed)]


def test_decisions_are_written_down_in_their_order_with_the_step_that_made_them(answered):
    _, decisions = answered
    steps = list(dict.fromkeys(d.step for d in decisions))
    order = ["rung 0", "rung 1", "rung 2", "rung 3", "account", "attribute", "rung 4"]
    assert steps == [s for s in order if s in steps]
    gone = [d.candidate for d in decisions if d.taken and d.rule == "does not pay"]
    assert any("coulomb_friction on q" in names for names in gone)
    assert not any("viscous_friction on q" in names for names in gone)


def test_a_setting_changes_what_is_taken(braked):
    deaf = Run(settings=read_settings({"laws": {"law": 1e9}, "curves": {"most": 0}}))
    said, _ = answer(braked, deaf)
    assert not json.loads(said)["effects"]


def test_progress_never_goes_back(braked):
    told, slider = [], make_simulator("slider")
    note = lambda done, total, text: told.append((done, total))  # noqa: E731
    diagnose(braked, slider, braked.parameters, np.random.default_rng(0), note)
    assert told == sorted(told)
    assert told[0] == (0, 100)
    assert told[-1] == (100, 100)
