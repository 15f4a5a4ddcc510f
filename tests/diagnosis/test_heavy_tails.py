"""A few wild samples must not rule a fit; what physics does is not wild, and without a tail nothing changes."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from gpsim.diagnosis import diagnose
from gpsim.diagnosis.fitting import Hypothesis, fit
from gpsim.diagnosis.selection import Found, without_tails
from gpsim.diagnosis.selection.heavy_tails import _off_line, _tails
from gpsim.diagnosis.setup import prepare
from gpsim.recordings import Recording
from gpsim.simulators import make_simulator

from .worlds import World, record

FRICTION = World("slider", grips={0: lambda q, v, n: 2.0 + 0 * q})


@cache
def clean(friction: bool = True) -> Recording:
    return record(FRICTION if friction else World("slider"), seed=5, episodes=10, steps=250)


def gross(recording: Recording, share: float = 0.01, times: float = 12.0) -> Recording:
    """The same with gross errors: so many standard deviations in so many samples, some larger and some smaller."""
    rng, sd = np.random.default_rng(1), np.array([recording.noise[n] for n in recording.state.names])
    episodes = []
    for e in recording.episodes:
        hit = rng.random(e.states.shape) < share
        episodes.append(replace(e, states=e.states + hit * rng.normal(size=hit.shape) * times * sd))
    return replace(recording, episodes=tuple(episodes))


def asked(recording: Recording):
    simulator = make_simulator("slider")
    return prepare(recording, simulator, simulator.defaults(recording.parameters))


def found(question):
    """The base simulator as all that a search has found."""
    problem = question.searched
    null = fit(problem, Hypothesis(), problem.windows.measured[:, 0], iterations=4)
    return Found([null], null, "fine", problem)


def named(recording: Recording):
    simulator = make_simulator("slider")
    parameters = simulator.defaults(recording.parameters)
    return diagnose(recording, simulator, parameters, np.random.default_rng(0)).diagnosis


@pytest.mark.slow
def test_one_in_a_hundred_gross_errors_leave_effects_and_intervals_what_they_are():
    without, with_them = named(clean()), named(gross(clean()))
    assert without.facts == ()
    assert {(f.kind, f.channel) for f in with_them.facts} == {("outliers", "q"), ("outliers", "q_dot")}
    assert without.verdict == with_them.verdict == "named"
    (one,), (other,) = without.effects, with_them.effects
    assert one.family == other.family == "coulomb_friction"
    a, b = one.parameters["force"], other.parameters["force"]
    assert b.value == pytest.approx(a.value, abs=0.5 * (a.high - a.low))
    assert b.high - b.low < 1.15 * (a.high - a.low)
    assert b.low < 2.0 < b.high
    assert other.evidence_gain > 0.95 * one.evidence_gain  # Gaussian squares made 0.90 of it


def test_without_a_tail_nothing_is_touched():
    question = asked(clean(friction=False))
    at = found(question)
    assert without_tails(question, at) == (question, at)


def test_wild_samples_weigh_little_and_all_others_one():
    recording = gross(clean(friction=False), times=30.0)
    question = asked(recording)
    weighed, at = without_tails(question, found(question))
    for problem in (weighed.everything, weighed.searched, weighed.held_out, at.problem):
        weights = problem.windows.weights
        assert ((weights >= 0) & (weights <= 1)).all()  # 0 where they leap by themselves
        assert (weights == 1).mean() > 0.97
    wild = np.concatenate([e.weights for e in weighed.recording.episodes]) < 0.1
    errors = np.concatenate(
        [a.states - b.states for a, b in zip(recording.episodes, clean(friction=False).episodes, strict=True)]
    ) / np.array([0.001, 0.01])
    assert np.abs(errors[wild]).min() > 3.0
    assert wild[np.abs(errors) > 15.0].mean() > 0.9  # the last samples of episodes are in no window
    assert at.null.objective < found(question).null.objective
    roots = weighed.searched.root_weights
    np.testing.assert_array_equal(at.null.residuals, found(question).null.residuals * roots)


def test_friction_that_nobody_has_named_yet_is_no_tail():
    """What it does beside the base simulator is far from Gaussian; it depends on the speed."""
    question = asked(clean())
    assert _tails(question.everything, Hypothesis()) == {}


def test_a_line_through_neighbours_passes_one_that_is_wild():
    samples = np.array([1.0, 2.0, 3.0, 9.0, 5.0, 6.0, 7.0])[None, None, :, None]
    np.testing.assert_allclose(_off_line(samples)[0, 0, :, 0], [0, 0, 0, 5, 0, 0, 0], atol=1e-12)
