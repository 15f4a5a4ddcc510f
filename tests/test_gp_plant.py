"""The corrected simulator: base plus GP, where the GP's inputs may know about a jump."""

import numpy as np
import pytest

from gpsim.channels import Channels
from gpsim.corrected import CorrectedPlant, Features, GpCorrection
from gpsim.errors import UsageError
from gpsim.gp import FitSettings, Predictor, fit_outputs
from gpsim.simulators import make_simulator
from gpsim.targets import FrictionCartPole

CARTPOLE = make_simulator("cartpole")
P = CARTPOLE.defaults()
CHANNELS = CARTPOLE.state + CARTPOLE.action
JUMP = ("x", "x_dot", "theta", "theta_dot", "force", "sign(x_dot)")


def correction(inputs, prediction="mean", sample_noise=False, count=250):
    rng = np.random.default_rng(0)
    states = rng.uniform(-1, 1, (count, 4)) * np.array([1.0, 1.0, 0.2, 2.0])
    actions = rng.choice([-10.0, 10.0], (count, 1))
    target = FrictionCartPole(P, 0.9, 0.02).step(states, actions, {}, rng)
    base = CARTPOLE.step(states, actions, P, np.full(count, 0.02), "euler")
    residual = (target - base)[:, 1::2] / 0.02
    features = Features.of(inputs, CHANNELS)
    gps = fit_outputs(features(np.hstack([states, actions])), residual, FitSettings(restarts=1), rng)
    return GpCorrection(Predictor(gps), features, prediction, sample_noise)


def test_a_sign_input_carries_the_jump():
    """With sgn(x_dot) the corrected simulator follows the target far better than a smooth kernel can."""
    rng = np.random.default_rng(1)
    states = rng.uniform(-1, 1, (400, 4)) * np.array([1.0, 1.0, 0.2, 2.0])
    actions = rng.choice([-10.0, 10.0], (400, 1))
    truth = FrictionCartPole(P, 0.9, 0.02).step(states, actions, {}, rng)
    errors = {}
    for name, inputs in (("raw", JUMP[:-1]), ("jump", JUMP)):
        plant = CorrectedPlant(CARTPOLE, P, "euler", 0.02, correction(inputs))
        errors[name] = np.sqrt(np.mean((plant.step(states, actions, {}, rng) - truth)[:, 1::2] ** 2))
    base = CARTPOLE.step(states, actions, P, np.full(400, 0.02), "euler")
    before = np.sqrt(np.mean((base - truth)[:, 1::2] ** 2))
    assert errors["jump"] < 0.01 * before
    assert errors["jump"] < 0.1 * errors["raw"] < 0.1 * before


def test_samples_scatter_about_the_mean_as_the_variance_says():
    states, actions = np.tile([0.3, 0.4, 0.05, 0.2], (20_000, 1)), np.full((20_000, 1), 10.0)
    noisy = correction(JUMP[:-1], "sample", True)
    inputs = noisy.features(np.hstack([states, actions]))
    mean, variance = noisy.predictor.mean_and_variance(inputs[:1])
    for sample_noise, expected in ((True, variance + noisy.predictor.noise_variances), (False, variance)):
        drawn = GpCorrection(noisy.predictor, noisy.features, "sample", sample_noise).rates(
            states, actions, {}, np.random.default_rng(0)
        )
        np.testing.assert_allclose(drawn.mean(axis=0), mean[0], atol=4 * np.sqrt(expected.max() / 20_000))
        np.testing.assert_allclose(drawn.var(axis=0), expected[0], rtol=0.05)


def test_features_are_parsed_and_mistakes_are_named():
    channels = Channels.of({"a": "m", "b": "rad"})
    features = Features.of(["b", "sign(a)", "cos(b)"], channels)
    values = np.array([[-2.0, 0.5]])
    np.testing.assert_allclose(features(values), [[0.5, -1.0, np.cos(0.5)]])
    assert values[0, 0] == -2.0
    turning = Features.of(["b", "sign(b)", "sin(b)"], Channels.of({"b": "rad"}, wraps=("b",)))
    found = turning(np.array([[4.0], [4.0 - 2.0 * np.pi]]))
    np.testing.assert_allclose(found, [[4.0 - 2.0 * np.pi, -1.0, np.sin(4.0)]] * 2)
    for wrong, message in (
        (["c"], "no channel 'c'; there are: a, b"),
        (["abs(a)"], "neither a channel nor one of sign"),
        (["sign(a"], "neither a channel"),
        ([], "empty"),
    ):
        with pytest.raises(UsageError, match=message):
            Features.of(wrong, channels)
