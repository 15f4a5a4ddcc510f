"""Whether a Gaussian process on what the effects leave makes simulations better, said without the held-out data."""

from dataclasses import replace

import numpy as np
import pytest

from gpsim.diagnosis import diagnose
from gpsim.diagnosis.assessment import comparison
from gpsim.diagnosis.assessment.remainder_gp import Corrected, best, learn, why_not
from gpsim.diagnosis.assessment.rollouts import free_runs, whole_windows
from gpsim.diagnosis.data import cut, held_out_mask
from gpsim.diagnosis.fitting import Hypothesis
from gpsim.diagnosis.run import Run
from gpsim.diagnosis.settings import Known, WindowSettings
from gpsim.diagnosis.setup import prepare
from gpsim.effects import Gate, Term
from gpsim.findings import NoGp
from gpsim.simulators import make_simulator

from .worlds import World, record

WHOLE = 155  # transitions of an episode


class Instead:
    """A Gaussian process that says something else."""

    def __init__(self, predictor, change):
        self._predictor, self._change = predictor, change

    def mean(self, features):
        return self._change(self._predictor.mean(features), features)


@pytest.fixture(scope="module")
def question():
    world = World("pendulum", forces={0: lambda q, v, t: 0.8 * np.sin(6 * q)})
    recording = record(world, seed=5, episodes=6, steps=WHOLE, noise=0.2)
    simulator = make_simulator("pendulum")
    return prepare(recording, simulator, simulator.defaults(recording.parameters))


def corrected(question, hypothesis):
    steps = cut(question.recording, WindowSettings(), 1)
    train = steps.take(~held_out_mask(question.recording, steps))
    found = learn(question.everything, train, hypothesis, np.random.default_rng(0))
    runs = whole_windows(question, question.recording, learnt_from=True)
    return Corrected(hypothesis, found, train, runs, free_runs(question, question.recording, WHOLE))


@pytest.fixture(scope="module")
def learnt(question):
    return corrected(question, Hypothesis())


def verdict(question, learnt, change):
    predictor = Instead(learnt.learnt.predictor, change)
    changed = replace(learnt, learnt=replace(learnt.learnt, predictor=predictor))
    return why_not(question.everything, *(changed.errors(question.everything, m) for m in (False, True)))


def test_one_that_has_learnt_the_law_is_kept(question, learnt):
    assert verdict(question, learnt, lambda mean, features: mean) is None


def test_one_that_explains_nothing_is_left_out(question, learnt):
    assert verdict(question, learnt, lambda mean, features: 0.0 * mean) == NoGp("explains nothing")


def test_one_that_is_wrong_by_a_sign_is_left_out(question, learnt):
    said = verdict(question, learnt, lambda mean, features: -mean)
    assert said.reason == "harms"
    assert said.rollout or said.channel == "theta_acc"


def test_one_that_drives_rollouts_astray_is_left_out(question):
    """Better one step ahead does not make up for it."""
    before = np.array([1.0, 0.1, 0.2])  # theta_acc one step ahead, theta and theta_dot after a rollout
    for astray, times in ((0.2, 2.0), (np.inf, np.inf)):
        said = why_not(question.everything, before, np.array([0.5, 0.1, astray + 0.2]))
        assert said == NoGp("harms", "theta_dot", rollout=True, times=times)
    assert why_not(question.everything, before, np.array([0.5, 0.1, 0.2])) is None


def long_diagnosed(force):
    """Of a slider with friction and a force that nobody names: five episodes of 16 s."""
    world = World("slider", forces={0: lambda q, v, t: -4.0 * v + force(q, v)})
    recording, simulator = record(world, seed=3, episodes=5, steps=800, noise=0.2), make_simulator("slider")
    run = Run(known=Known(only=("viscous_friction",)))
    found = diagnose(
        recording, simulator, simulator.defaults(recording.parameters), np.random.default_rng(0), run=run
    )
    return found.comparison


def test_one_that_helps_in_short_windows_and_harms_in_long_runs_is_left_out(monkeypatch):
    """A force of the place, known by a process that is off by a little, which adds up while nothing is read."""
    off = 0.01  # m/s^2

    def learnt(*given):
        found = learn(*given)
        return replace(found, predictor=Instead(found.predictor, lambda mean, features: mean + off))

    monkeypatch.setattr(comparison, "learn", learnt)
    found = long_diagnosed(lambda q, v: 0.5 * np.sin(8 * q))
    assert found.corrected is None
    assert (found.why_no_gp.reason, found.why_no_gp.seconds) == ("strays", pytest.approx(16.0))
    assert found.why_no_gp.times > 1.2
    monkeypatch.setattr(comparison, "strays", lambda *given: None)
    assert long_diagnosed(lambda q, v: 0.5 * np.sin(8 * q)).corrected is not None  # the short windows' word


def test_one_that_helps_in_long_runs_is_kept():
    found = long_diagnosed(lambda q, v: -20.0 * v**3)
    assert found.why_no_gp is None
    assert len(found.corrected.free)
    assert found.corrected.free.length == 800


def test_what_is_held_out_has_no_say(question, learnt):
    for windows in (learnt.train, learnt.runs, learnt.free):
        assert len(windows)
        assert not held_out_mask(question.recording, windows).any()


def test_of_a_partial_account_that_cuts_the_law_to_pieces_the_base_is_learnt_instead(question, learnt):
    pieces = [
        Term("constant_force", "theta", {"force": 6.0}, Gate({"theta": (low, low + 0.05)}))
        for low in (-0.3, -0.15, 0.0, 0.1, 0.2)
    ]
    jagged = corrected(question, Hypothesis(tuple(pieces), ((),) * len(pieces)))
    assert best(question.everything, [jagged, learnt])[0] is learnt
    assert best(question.everything, [learnt, jagged])[0] is learnt
