"""A slow and a fast process, each on what the other leaves; on disk as one."""

import numpy as np
import pytest
from gpsim.cli.configuration import resolve

from gpsim.errors import UsageError
from gpsim.gp import (
    ChainedPredictor,
    ChainSettings,
    FitSettings,
    Predictor,
    fit_chain,
    from_arrays,
    to_arrays,
)
from gpsim.stages import building
from gpsim.stages.stage import Request

SETTINGS = FitSettings(restarts=1, max_iterations=60)


def two_scales(count, rng):
    inputs = rng.uniform(-2.0, 2.0, (count, 2))
    slow, fast = np.sin(inputs[:, 0]), 0.2 * np.sin(9.0 * inputs[:, 1])
    return inputs, np.stack([slow + fast, 2.0 * slow], axis=1)


@pytest.fixture(scope="module")
def chained():
    rng = np.random.default_rng(0)
    inputs, targets = two_scales(150, rng)
    noisy = targets + 0.02 * rng.standard_normal(targets.shape)
    return fit_chain(inputs, noisy, SETTINGS, ChainSettings(least_slow=0.8, most_fast=0.8), rng)


def test_each_process_has_lengths_of_its_own_scale_and_the_sum_explains_both(chained):
    predictor, slow, fast = chained
    assert min(gp.hyper_parameters.lengthscales.min() for gp in slow) >= 0.8 * (1 - 1e-9)
    assert max(gp.hyper_parameters.lengthscales.max() for gp in fast) <= 0.8 * (1 + 1e-9)
    inputs, targets = two_scales(300, np.random.default_rng(1))
    error = (predictor.mean(inputs) - targets).std(axis=0)
    alone = (Predictor(slow).mean(inputs) - targets).std(axis=0)
    assert error[0] < 0.6 * alone[0]
    assert error[0] < 0.1


def test_means_and_variances_add_up_and_a_sample_has_them(chained):
    predictor, inputs = chained[0], np.zeros((4000, 2))
    mean, variance = predictor.mean_and_variance(inputs)
    np.testing.assert_allclose(mean, predictor.mean(inputs))
    np.testing.assert_allclose(mean[0], sum(part.mean(inputs[:1])[0] for part in predictor.parts))
    drawn = predictor.sample(inputs, np.random.default_rng(2), include_noise=True)
    np.testing.assert_allclose(drawn.var(axis=0), variance[0] + predictor.noise_variances, rtol=0.1)


def test_a_chain_on_disk_is_the_same(chained):
    predictor = chained[0]
    read = from_arrays(*to_arrays(predictor))
    assert isinstance(read, ChainedPredictor)
    inputs = np.random.default_rng(3).uniform(-3.0, 3.0, (20, 2))
    np.testing.assert_array_equal(read.mean(inputs), predictor.mean(inputs))
    with pytest.raises(ValueError, match="needs parts"):
        from_arrays({}, {"schema": "gpsim.gp-chain/1", "parts": []})


@pytest.mark.parametrize(
    ("word", "said"),
    [
        ("gp.chain.rounds=0", "gp.chain: rounds must be at least 1"),
        ("gp.chain.least_slow=2000", "gp.chain: bounds of lengthscales need"),
        ("gp.chain.most_fast=-1", "gp.chain: least_slow and most_fast must be positive"),
        ("gp.chain=3", "gp.chain: expected settings"),
    ],
)
def test_a_chain_that_cannot_be_is_one_line(word, said):
    words = ("gp=chained", word)
    with pytest.raises(UsageError) as refused:
        building.check_gp(Request(resolve(list(words), None), words))
    assert str(refused.value).startswith(said)
