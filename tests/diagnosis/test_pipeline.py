"""The pipeline: every step alone with what the one before returned, and two diagnoses in one process."""

import json
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

from gpsim.diagnosis import diagnose
from gpsim.diagnosis.assessment import compare
from gpsim.diagnosis.attribution import attribute, supported
from gpsim.diagnosis.judgement import judge, verdict_of
from gpsim.diagnosis.run import Run
from gpsim.diagnosis.selection import beam_search, prune_on_held_out, refine_grid, refit, stepwise
from gpsim.diagnosis.settings import read_settings
from gpsim.diagnosis.setup import offers_of, prepare
from gpsim.files import plain
from gpsim.simulators import make_simulator

from .worlds import World, record

BRAKED = World("slider", forces={0: lambda q, v, t: -1.3 * v})
PUSHED = World("slider", forces={0: lambda q, v, t: 0.8 + 0.0 * v})


def quiet(*_):
    pass


@pytest.fixture(scope="module")
def braked():
    return record(BRAKED, seed=3, episodes=4, steps=120)


def test_each_step_runs_with_what_the_step_before_returned(braked):
    slider, run = make_simulator("slider"), Run()
    question = prepare(braked, slider, braked.parameters, run)
    assert len(question.searched.windows) <= len(question.everything.windows)
    offers = offers_of(question)
    assert ("viscous_friction", "q") in {c.identity for c in offers}
    found = beam_search(question.searched, offers, "euler", quiet)
    assert found.fits[0].objective <= found.null.objective
    question, found = refine_grid(question, found)
    contenders = refit(question, found)
    assert contenders.leader.hypothesis.claims
    contenders = stepwise(question, contenders, offers, quiet)
    contenders = prune_on_held_out(question, contenders)
    assert contenders.leader.hypothesis.claims == {("viscous_friction", "q")}
    before = contenders.leader.hypothesis.claims
    judgement = judge(question, contenders, found)
    lean = supported(question, judgement.leader, judgement.null, judgement.structured)
    assert lean is judgement.leader
    attribution = attribute(question, judgement.leader, judgement.null)
    assert attribution.share.share > 0.9
    assert attribution.roles == ("headline",)
    assert verdict_of(judgement, attribution, (), run.settings) == "named"
    assert judgement.leader.hypothesis.claims == before  # it adds nothing
    comparison = compare(question, judgement, offers, np.random.default_rng(0), attribution.noise)
    errors = comparison.one_step["q_acc"]
    assert errors.after < errors.before


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
    order = ["usual machine", "search", "refine grid", "refit", "stepwise", "prune on held-out", "judge"]
    assert steps == [s for s in order if s in steps]
    weighed = [d for d in decisions if d.price is not None]
    taken = [d for d in weighed if d.taken and d.candidate == ("viscous_friction on q",)]
    assert taken
    assert taken[0].gain > 4.0
    assert 0.0 < taken[0].share <= 1.0


def test_a_setting_changes_what_is_taken(braked):
    deaf = Run(settings=read_settings({"acceptance": {"per_term": 1e9}}))
    said, decisions = answer(braked, deaf)
    assert not json.loads(said)["effects"]
    assert {d.rule for d in decisions if d.price is not None} <= {"too few nats", "does nothing"}
