"""Likelihood, gradient and posterior against independent oracles."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import multivariate_normal

from gpsim.gp import (
    JITTER,
    HyperParameters,
    NotPositiveDefiniteError,
    Predictor,
    TrainingData,
    condition,
    covariance,
    log_marginal_likelihood,
)
from gpsim.gp.exact import DROWNED, Likelihood


def dense_covariance(a: np.ndarray, b: np.ndarray, hyper: HyperParameters) -> np.ndarray:
    """(4.9) written out entry by entry, as the thesis prints it."""
    out = np.empty((len(a), len(b)))
    for i, p in enumerate(a):
        for j, q in enumerate(b):
            rbf = hyper.signal_std**2 * np.exp(-0.5 * np.sum((p - q) ** 2 / hyper.lengthscales**2))
            out[i, j] = rbf + np.sum(hyper.linear_stds**2 * p * q) + hyper.bias_std**2
    return out


def random_hyper(rng: np.random.Generator, dimension: int) -> HyperParameters:
    low, high = np.log(0.05), np.log(3.0)
    return HyperParameters.from_log_vector(rng.uniform(low, high, 2 * dimension + 3))


def random_data(rng: np.random.Generator, rows: int, dimension: int, replicates: bool) -> TrainingData:
    inputs = rng.normal(size=(rows, dimension))
    if replicates:
        inputs = inputs[rng.integers(0, max(1, rows // 2), rows)]
    return TrainingData.of(inputs, rng.normal(size=rows), replicates)


@given(
    seed=st.integers(0, 2**32 - 1),
    rows=st.integers(1, 30),
    dimension=st.integers(1, 4),
    replicates=st.booleans(),
)
@settings(max_examples=60, deadline=None)
def test_gradient_agrees_with_finite_differences(
    seed: int, rows: int, dimension: int, replicates: bool
) -> None:
    rng = np.random.default_rng(seed)
    data = random_data(rng, rows, dimension, replicates)
    likelihood = Likelihood(data)
    at = random_hyper(rng, dimension).to_log_vector()
    value, gradient = likelihood(at)
    step = 1e-5
    for index in range(at.size):
        offset = np.zeros_like(at)
        offset[index] = step
        slope = (likelihood(at + offset)[0] - likelihood(at - offset)[0]) / (2.0 * step)
        assert gradient[index] == pytest.approx(slope, rel=1e-5, abs=1e-5 * (1.0 + abs(value)))


@given(seed=st.integers(0, 2**32 - 1), rows=st.integers(1, 25), dimension=st.integers(1, 3))
@settings(max_examples=40, deadline=None)
def test_likelihood_is_the_density_of_a_multivariate_normal(seed: int, rows: int, dimension: int) -> None:
    rng = np.random.default_rng(seed)
    data, hyper = random_data(rng, rows, dimension, False), random_hyper(rng, dimension)
    dense = dense_covariance(data.inputs, data.inputs, hyper) + (hyper.noise_std**2 + JITTER) * np.eye(rows)
    expected = multivariate_normal(np.zeros(rows), dense).logpdf(data.targets)
    assert log_marginal_likelihood(data, hyper) == pytest.approx(expected, rel=1e-9, abs=1e-9)
    assert Likelihood(data)(hyper.to_log_vector())[0] == pytest.approx(expected, rel=1e-9, abs=1e-9)


@given(seed=st.integers(0, 2**32 - 1), rows=st.integers(2, 30))
@settings(max_examples=40, deadline=None)
def test_averaging_replicates_keeps_the_likelihood_of_all_rows(seed: int, rows: int) -> None:
    rng = np.random.default_rng(seed)
    inputs = rng.normal(size=(rows, 2))[rng.integers(0, max(1, rows // 3), rows)]
    targets, hyper = rng.normal(size=rows), random_hyper(rng, 2)
    full = TrainingData.of(inputs, targets, False)
    averaged = TrainingData.of(inputs, targets, True)
    assert averaged.counts.size < full.counts.size == averaged.rows
    expected = log_marginal_likelihood(full, hyper)
    assert log_marginal_likelihood(averaged, hyper) == pytest.approx(expected, rel=1e-8, abs=1e-8)


def test_covariance_is_the_formula_of_the_thesis() -> None:
    rng = np.random.default_rng(0)
    a, b, hyper = rng.normal(size=(7, 3)), rng.normal(size=(5, 3)), random_hyper(rng, 3)
    np.testing.assert_allclose(covariance(a, b, hyper), dense_covariance(a, b, hyper), rtol=1e-12)


@given(seed=st.integers(0, 2**32 - 1), rows=st.integers(1, 20), dimension=st.integers(1, 4))
@settings(max_examples=40, deadline=None)
def test_posterior_is_the_conditional_normal(seed: int, rows: int, dimension: int) -> None:
    """(4.7) and (4.8) by a plain solve, in raw units: standardisation must not change what they mean."""
    rng = np.random.default_rng(seed)
    inputs = rng.normal(size=(rows, dimension)) * 5.0 + 2.0
    targets, new = rng.normal(size=rows) * 3.0 - 7.0, rng.normal(size=(6, dimension)) * 5.0
    process = condition(inputs, targets, random_hyper(rng, dimension))
    scaling, raw = process.standardisation, process.hyper_parameters_original
    a, b = inputs - scaling.input_mean, new - scaling.input_mean
    noise = raw.noise_std**2 + JITTER * scaling.target_scale**2
    gram = dense_covariance(a, a, raw) + noise * np.eye(rows)
    cross = dense_covariance(b, a, raw)
    mean = scaling.target_mean + cross @ np.linalg.solve(gram, targets - scaling.target_mean)
    prior = np.diag(dense_covariance(b, b, raw))
    variance = prior - np.sum(cross * np.linalg.solve(gram, cross.T).T, axis=1)
    predictor = Predictor([process])
    means, variances = predictor.mean_and_variance(new)
    scale = scaling.target_scale
    np.testing.assert_allclose(means[:, 0], mean, rtol=1e-6, atol=1e-7 * scale)
    assert np.all(np.abs(variances[:, 0] - variance) <= 1e-6 * variance + DROWNED * prior + 1e-7 * scale**2)
    np.testing.assert_allclose(predictor.noise_variances, [raw.noise_std**2])


def test_no_cholesky_factor_is_an_error_and_not_a_number() -> None:
    inputs = np.repeat(np.linspace(0.0, 1e-9, 40)[:, None], 2, axis=1)
    data = TrainingData.of(inputs, np.zeros(40), False)
    hyper = HyperParameters(1e6, np.ones(2), np.full(2, 1e3), 1e6, 1e-12)
    with pytest.raises(NotPositiveDefiniteError, match="noise"):
        log_marginal_likelihood(data, hyper)
