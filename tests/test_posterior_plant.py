"""Simulators drawn from a posterior: correlations, intervals, rivals by probability, one function an episode."""

import numpy as np
import pytest

from gpsim.corrected import (
    Drawable,
    EffectsPlant,
    Features,
    FunctionCorrection,
    PosteriorPlant,
    Size,
    Spread,
    value_key,
)
from gpsim.effects import Term
from gpsim.environments import Episodes
from gpsim.gp import DrawnFunctions, FitSettings, Predictor, fit_outputs
from gpsim.simulators import make_simulator
from gpsim.tasks import Balance

SLIDER, DT = make_simulator("slider"), 0.02
LINEAR = np.array([[1.0, -0.9], [-0.9, 1.0]])


def slider(*terms, **kwargs):
    return EffectsPlant(SLIDER, {"mass": 1.0}, terms, "fine", 2, DT, **kwargs)


def size(term, name, value, low, high, least=0.0, most=10.0):
    return Size(term, name, value, low, high, least, most)


def two_dampings():
    """Viscous friction of about 1, and in a third of the episodes a constant force instead."""
    friction = slider(
        Term("viscous_friction", "q", {"damping": 1.0}), Term("constant_force", "q", {"force": 0.5})
    )
    sizes = (size(0, "damping", 1.0, 0.8, 1.4), size(1, "force", 0.5, 0.4, 0.6))
    rival = slider(Term("constant_force", "q", {"force": -1.0}))
    return PosteriorPlant(
        (
            Drawable(friction, 0.6, Spread(sizes, LINEAR, 0.9)),
            Drawable(rival, 0.3, Spread((size(0, "force", -1.0, -1.0, -1.0, -5.0, 5.0),), np.eye(1), 0.9)),
        )
    )


def test_draws_have_the_intervals_and_the_correlations_that_are_stated():
    spread = two_dampings().explanations[0].spread
    drawn = spread.draw(40_000, np.random.default_rng(0))
    np.testing.assert_allclose(np.quantile(drawn[:, 0], [0.05, 0.5, 0.95]), [0.8, 1.0, 1.4], atol=0.01)
    np.testing.assert_allclose(np.quantile(drawn[:, 1], [0.05, 0.95]), [0.4, 0.6], atol=0.005)
    rank = np.argsort(np.argsort(drawn, axis=0), axis=0)
    assert np.corrcoef(rank.T)[0, 1] == pytest.approx(-0.89, abs=0.02)
    tight = Spread((size(0, "damping", 1.0, 0.5, 1.5, 0.9, 1.1),), np.eye(1), 0.9)
    assert np.ptp(tight.draw(1000, np.random.default_rng(0))) == pytest.approx(0.2)


def test_an_episode_is_driven_in_the_simulator_that_it_drew():
    drawn, rng = two_dampings(), np.random.default_rng(1)
    memory = drawn.begin(300, rng)
    rivals = memory["which"] == 1.0
    assert rivals.mean() == pytest.approx(1 / 3, abs=0.08)
    state = np.tile([0.0, 1.0], (300, 1))
    after = drawn.step(state, np.zeros((300, 1)), memory, rng)
    np.testing.assert_allclose(after[rivals, 1], 1.0 - DT, rtol=1e-9)
    damping, force = (memory[f"0/{value_key(*key)}"] for key in ((0, "damping"), (1, "force")))
    closed = force / damping + (1.0 - force / damping) * np.exp(-damping * DT)
    np.testing.assert_allclose(after[~rivals, 1], closed[~rivals], rtol=1e-6)
    assert np.unique(after[~rivals, 1]).size > 100
    np.testing.assert_array_equal(drawn.measure(after, memory, rng), after)


def test_what_an_episode_remembers_is_kept_and_a_new_one_draws_anew():
    late = slider(Term("actuator_delay", "force", {"delay": 0.04}))
    sizes = (size(0, "delay", 0.04, 0.02, 0.06, 0.0, 0.1),)
    drawn = PosteriorPlant((Drawable(late, 1.0, Spread(sizes, np.eye(1), 0.9)),))
    running = Episodes(drawn, Balance(), 4, np.random.default_rng(0))
    running.states, running.memory = np.zeros((4, 2)), drawn.begin(4, running.rng)
    delays = running.memory[f"0/{value_key(0, 'delay')}"].copy()
    for _ in range(10):
        running.states = drawn.step(running.states, np.ones((4, 1)), running.memory, running.rng)
    np.testing.assert_allclose(running.states[:, 1], 10 * DT - delays, atol=1e-9)


@pytest.fixture(scope="module")
def predictor():
    rng = np.random.default_rng(0)
    inputs = rng.uniform(-1.0, 1.0, (60, 3))
    targets = np.stack([np.sin(3.0 * inputs[:, 0]), inputs[:, 1] ** 2], axis=1)
    noisy = targets + 0.05 * rng.standard_normal(targets.shape)
    return Predictor(fit_outputs(inputs, noisy, FitSettings(restarts=1), rng))


@pytest.mark.slow
def test_drawn_functions_vary_as_the_process_says(predictor):
    inputs = np.random.default_rng(1).uniform(-1.3, 1.3, (50, 3))
    mean, variance = predictor.mean_and_variance(inputs)
    functions = DrawnFunctions(predictor, 2000, np.random.default_rng(2))
    values = np.stack([functions(np.repeat(x[None], 2000, axis=0), np.arange(2000)) for x in inputs])
    deviation = np.sqrt(variance)
    assert np.abs(values.mean(axis=1) - mean).max() < 0.15 * deviation.max()
    np.testing.assert_allclose(values.std(axis=1), deviation, rtol=0.25, atol=0.2 * deviation.min())


def test_an_episode_has_one_function_the_same_at_every_step(predictor):
    functions = DrawnFunctions(predictor, 8, np.random.default_rng(0))
    features = Features.of(["q", "q_dot", "force"], SLIDER.state + SLIDER.action)
    correction, rng = FunctionCorrection(functions, features), np.random.default_rng(3)
    memory = correction.begin(6, rng)
    state, action = np.zeros((6, 2)), np.full((6, 1), 0.3)
    first = correction.rates(state, action, memory, rng)
    np.testing.assert_array_equal(first, correction.rates(state, action, memory, rng))
    assert np.unique(first[:, 0]).size == np.unique(memory["function"]).size > 1
