"""Degenerate data and hyper-parameters: what is refused, and what still works."""

from __future__ import annotations

import numpy as np
import pytest

from gpsim.gp import FitSettings, HyperParameters, Predictor, TooManyRowsError, fit

QUICK = FitSettings(restarts=1)


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
def test_a_value_that_is_not_finite_is_named_by_row_and_column(value: float) -> None:
    rng = np.random.default_rng(0)
    inputs, targets = rng.normal(size=(6, 3)), rng.normal(size=6)
    inputs[4, 2] = value
    with pytest.raises(ValueError, match=r"inputs row 4, column 2"):
        fit(inputs, targets, QUICK, rng)
    inputs[4, 2], targets[1] = 0.0, value
    with pytest.raises(ValueError, match=r"targets row 1"):
        fit(inputs, targets, QUICK, rng)


@pytest.mark.parametrize(
    ("inputs", "targets", "message"),
    [
        (np.zeros(4), np.zeros(4), r"\(N, D\).*got \(4,\)"),
        (np.zeros((0, 2)), np.zeros(0), r"at least 1, got \(0, 2\)"),
        (np.zeros((4, 2)), np.zeros(3), r"\(4,\).*got \(3,\)"),
        (np.zeros((4, 2)), np.zeros((4, 1)), r"\(4,\).*got \(4, 1\)"),
    ],
)
def test_wrong_shapes_are_named(inputs: np.ndarray, targets: np.ndarray, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        fit(inputs, targets, QUICK, np.random.default_rng(0))


def test_more_distinct_rows_than_an_exact_fit_takes_are_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("gpsim.gp.training_data.MOST_ROWS", 20)
    rng = np.random.default_rng(0)
    inputs, targets = rng.normal(size=(21, 2)), rng.normal(size=21)
    with pytest.raises(TooManyRowsError, match=r"21 distinct inputs; .* at most 20"):
        fit(inputs, targets, QUICK, rng)
    inputs[20] = inputs[0]  # a replicate is no new row
    assert fit(inputs, targets, QUICK, rng).data.counts.size == 20


def test_a_constant_column_is_harmless_and_named() -> None:
    rng = np.random.default_rng(1)
    inputs = np.column_stack([rng.normal(size=40), np.full(40, 0.1)])
    targets = np.sin(inputs[:, 0])
    process = fit(inputs, targets, QUICK, rng)
    without = fit(inputs[:, :1], targets, QUICK, rng)
    assert process.report is not None
    assert any("column 1 is constant (0.1)" in text for text in process.report.warnings)
    assert process.standardisation.input_scale[1] == 1.0
    a, b = Predictor([process]).mean(inputs), Predictor([without]).mean(inputs[:, :1])
    np.testing.assert_allclose(a, b, atol=0.01)


def test_constant_targets_are_predicted_and_named() -> None:
    rng = np.random.default_rng(2)
    inputs = rng.normal(size=(20, 2))
    process = fit(inputs, np.full(20, -3.3), QUICK, rng)
    np.testing.assert_allclose(Predictor([process]).mean(inputs), -3.3, atol=1e-9)
    assert process.report is not None
    assert any("targets are constant (-3.3)" in text for text in process.report.warnings)


@pytest.mark.parametrize(
    "vector",
    [[1.0, 0.0, 1.0, 1.0, 1.0], [1.0, 1.0, -1.0, 1.0, 1.0], [1.0, 1.0, 1.0, np.nan, 1.0], [1.0, 1.0]],
)
def test_impossible_hyper_parameters_are_refused(vector: list[float]) -> None:
    with pytest.raises(ValueError, match="hyper-parameter"):
        HyperParameters.from_vector(vector)
