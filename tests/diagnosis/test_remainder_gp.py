"""The Gaussian process on the remainder: a function of the true state, whatever the sensors make of it."""

from dataclasses import replace

import numpy as np
import pytest

from gpsim.diagnosis.assessment.comparison import single_steps
from gpsim.diagnosis.assessment.remainder_gp import learn, left_with, residual_rates
from gpsim.diagnosis.fitting import Hypothesis, as_it_was, without_sensors
from gpsim.diagnosis.setup import prepare
from gpsim.effects import Term
from gpsim.simulators import make_simulator

from .truths import late, sensor
from .worlds import World, record

STIFFNESS, OFFSET, SCALE = 4.0, 0.5, 2.0
SPRUNG = {0: lambda q, v, t: -STIFFNESS * q}
SENSORS = Hypothesis(
    (
        Term("sensor_bias", "q", {"offset": OFFSET}),
        Term("viscous_friction", "q", {"damping": 0.0}),
        Term("sensor_scale", "q_dot", {"scale": SCALE}),
    ),
    ((), (), ()),
)


def question_of(recording):
    simulator = make_simulator("slider")
    return prepare(recording, simulator, simulator.defaults(recording.parameters))


@pytest.fixture(scope="module")
def question():
    """A slider on a spring that nobody names, behind sensors that are known to be off."""
    recording = record(World("slider", forces=SPRUNG), episodes=6, steps=100, noise=0.0, known_noise=False)
    read = tuple(
        replace(e, states=np.stack([e.states[:, 0] + OFFSET, SCALE * e.states[:, 1]], axis=1))
        for e in recording.episodes
    )
    return question_of(replace(recording, episodes=read))


def test_it_learns_what_the_corrected_simulator_will_ask(question):
    learnt = learn(
        question.everything,
        single_steps(question.everything, question.recording).train,
        SENSORS,
        np.random.default_rng(0),
    )
    q = np.linspace(-0.3, 0.3, 7)
    states = np.stack([q, np.zeros(7)], axis=1)  # true ones, no command
    np.testing.assert_allclose(learnt.rates(states, np.zeros((7, 1)))[:, 0], -STIFFNESS * q / 2.0, atol=0.05)


def test_with_it_one_step_ahead_nothing_is_left(question):
    problem, steps = question.everything, single_steps(question.everything, question.recording)
    learnt = learn(problem, steps.train, SENSORS, np.random.default_rng(0))
    alone = residual_rates(problem, steps.test, SENSORS)
    both = left_with(problem, steps.test, SENSORS, alone, learnt)
    assert np.sqrt(np.mean(both**2)) < 0.05 * np.sqrt(np.mean(alone**2))


def test_without_its_sensors_a_hypothesis_says_the_same_of_what_happened():
    assert [t.family for t in without_sensors(SENSORS).terms] == ["viscous_friction"]
    assert without_sensors(Hypothesis()) == Hypothesis()


def test_a_late_sensors_transitions_are_brought_back_to_the_time_they_are_of():
    """The true states at both ends, but for what the spring did during the delay."""
    world = World("slider", sensors=[sensor(0, late(0.03))])
    args = {"seed": 3, "episodes": 6, "steps": 100, "noise": 0.0, "known_noise": False}
    question, plain = (question_of(record(w, **args)) for w in (world, World("slider")))
    windows, truth = (single_steps(q.everything, q.recording).train for q in (question, plain))
    later = Hypothesis((Term("sensor_delay", "q", {"delay": 0.03}),), ((),))
    seen = ~windows.fresh
    found = as_it_was(question.everything, windows, later).measured[seen]
    off = np.abs(windows.measured[seen] - truth.measured[seen])[..., 0]
    assert np.abs(found - truth.measured[seen])[..., 0].max() < 0.02 * off.max()
    np.testing.assert_allclose(found[..., 1], truth.measured[seen][..., 1], atol=1e-9)
