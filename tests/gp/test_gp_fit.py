"""Fit: recovery of a known truth, outcome and warnings, invariance, determinism."""

from __future__ import annotations

import numpy as np
import pytest

from gpsim.gp import (
    Bounds,
    FitOutcome,
    FitSettings,
    GaussianProcess,
    HyperParameters,
    Predictor,
    covariance,
    fit,
    fit_outputs,
    to_arrays,
)
from gpsim.gp.exact import Likelihood

ONE_START = FitSettings(restarts=0)


def draw_from_prior(inputs: np.ndarray, hyper: HyperParameters, rng: np.random.Generator) -> np.ndarray:
    gram = covariance(inputs, inputs, hyper) + hyper.noise_std**2 * np.eye(len(inputs))
    return np.linalg.cholesky(gram) @ rng.standard_normal(len(inputs))


def standard_errors(process: GaussianProcess) -> np.ndarray:
    """Of the log hyper-parameters: inverse of the likelihood's curvature, by differences of its gradient."""
    likelihood, at = Likelihood(process.data), process.hyper_parameters.to_log_vector()
    rows = []
    for index in range(at.size):
        step = np.zeros_like(at)
        step[index] = 1e-4
        rows.append((likelihood(at - step)[1] - likelihood(at + step)[1]) / 2e-4)
    curvature = np.array(rows)
    return np.sqrt(np.diag(np.linalg.pinv(0.5 * (curvature + curvature.T))))


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_known_hyper_parameters_are_recovered_within_four_errors(seed: int) -> None:
    rng = np.random.default_rng(seed)
    inputs = rng.uniform(-5.0, 5.0, (250, 2))
    truth = HyperParameters(2.0, np.array([0.8, 2.5]), np.array([0.3, 0.3]), 0.5, 0.2)
    process = fit(inputs, draw_from_prior(inputs, truth, rng), FitSettings(), rng)
    found, errors = process.hyper_parameters_original.to_log_vector(), standard_errors(process)
    # One draw holds one slope per input and one bias: the data do not determine those standard deviations.
    for index in (0, 1, 2, -1):
        assert abs(found[index] - truth.to_log_vector()[index]) < 4.0 * errors[index]
        assert errors[index] < 0.5
    assert process.report is not None
    assert process.report.converged


def test_an_iteration_limit_is_an_outcome_with_advice() -> None:
    rng = np.random.default_rng(2)
    inputs = rng.normal(size=(50, 2))
    settings = FitSettings(restarts=0, max_iterations=2)
    report = fit(inputs, np.sin(3.0 * inputs[:, 0]), settings, rng).report
    assert report is not None
    assert report.outcome is FitOutcome.ITERATION_LIMIT
    assert not report.converged
    assert any("max_iterations" in text for text in report.warnings)


def test_a_jump_along_one_input_is_found() -> None:
    """Data on which the ascent from the smooth start blurs a step of one input into noise."""
    rng = np.random.default_rng(3)
    inputs = rng.normal(size=(100, 3))
    targets = np.sign(inputs[:, 1]) + 0.02 * rng.normal(size=100)
    smooth = fit(inputs, targets, ONE_START, np.random.default_rng(0)).report
    turning = fit(inputs, targets, FitSettings(restarts=1), np.random.default_rng(0)).report
    assert smooth is not None
    assert turning is not None
    assert turning.log_marginal_likelihood > smooth.log_marginal_likelihood + 20.0


def test_noise_free_data_reach_the_noise_floor_and_the_report_says_so() -> None:
    rng = np.random.default_rng(3)
    inputs = rng.uniform(-2.0, 2.0, (80, 2))
    report = fit(inputs, np.sin(inputs[:, 0]), FitSettings(), rng).report
    assert report is not None
    assert report.hyper_parameters.noise_std == pytest.approx(Bounds().noise_std.low)
    assert any("noise_std" in text and "noise floor" in text for text in report.warnings)
    # Input 1 plays no part: its lengthscale or slope at a bound is a note, not a warning.
    notes = [item for item in report.at_bounds if item.name.endswith("[1]")]
    assert notes
    assert all(item.harmless and str(item) not in report.warnings for item in notes)


def test_scaling_a_column_scales_its_lengthscale_and_nothing_else() -> None:
    rng = np.random.default_rng(5)
    inputs = rng.normal(size=(60, 3))
    targets = np.sin(inputs[:, 0]) + 0.3 * inputs[:, 1] + 0.1 * rng.normal(size=60)
    # A power of two leaves every rounding alone: the two fits agree to the bit.
    factor = np.array([1.0, 8.0, 0.25])
    plain = fit(inputs, targets, FitSettings(), np.random.default_rng(0))
    scaled = fit(inputs * factor, targets * 4.0, FitSettings(), np.random.default_rng(0))
    a, b = plain.hyper_parameters_original, scaled.hyper_parameters_original
    np.testing.assert_array_equal(b.lengthscales, a.lengthscales * factor)
    np.testing.assert_array_equal(b.linear_stds, a.linear_stds * 4.0 / factor)
    assert (b.signal_std, b.noise_std) == (4.0 * a.signal_std, 4.0 * a.noise_std)
    new = rng.normal(size=(5, 3))
    expected = Predictor([plain]).mean(new) * 4.0
    np.testing.assert_allclose(Predictor([scaled]).mean(new * factor), expected, rtol=1e-12)


def test_same_data_and_seed_give_the_same_bytes() -> None:
    rng = np.random.default_rng(8)
    inputs, targets = rng.normal(size=(40, 2)), rng.normal(size=(40, 2))
    runs = [fit_outputs(inputs, targets, FitSettings(), np.random.default_rng(3)) for _ in range(2)]
    first, second = (to_arrays(Predictor(run))[0] for run in runs)
    assert {name: array.tobytes() for name, array in first.items()} == {
        name: array.tobytes() for name, array in second.items()
    }
    reports = [[p.report.to_dict() for p in run if p.report is not None] for run in runs]
    assert reports[0] == reports[1]
    assert len(reports[0]) == 2


@pytest.mark.parametrize("seed", range(4))
def test_a_law_no_larger_than_the_noise_is_found(seed: int) -> None:
    """Ascents from starts that trust the data end where all of it is noise."""
    rng = np.random.default_rng(seed)
    inputs = rng.normal(size=(250, 4))
    law = lambda x: np.sin(5.0 * x[:, 1])  # noqa: E731
    targets = law(inputs) + 0.8 * rng.normal(size=250)
    fitted = fit(inputs, targets, FitSettings(restarts=2), np.random.default_rng(0))
    asked = rng.normal(size=(500, 4))
    off = Predictor([fitted]).mean(asked)[:, 0] - law(asked)
    assert np.sqrt(np.mean(off**2)) < 0.5 * np.sqrt(np.mean(law(asked) ** 2))
