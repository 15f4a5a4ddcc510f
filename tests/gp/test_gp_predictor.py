"""Predictor: interpolation, calibration, samples, several outputs, chunks, round trip."""

from __future__ import annotations

import io
import json

import numpy as np
import pytest

from gpsim.gp import (
    HyperParameters,
    Predictor,
    Standardisation,
    condition,
    covariance,
    from_arrays,
    to_arrays,
)


def make_predictor(seed: int = 0) -> tuple[Predictor, np.ndarray]:
    """Two GPs on data with different rows, so that their standardisations differ; and new inputs."""
    rng = np.random.default_rng(seed)
    inputs = rng.normal(size=(40, 3)) * [1.0, 20.0, 0.1] + [0.0, 100.0, 5.0]
    hyper = [
        HyperParameters(1.0, np.array([0.5, 1.5, 2.0]), np.array([0.3, 0.2, 0.1]), 0.4, 0.1),
        HyperParameters(0.6, np.array([1.5, 0.7, 1.0]), np.array([0.1, 0.9, 0.3]), 0.2, 0.3),
    ]
    first = condition(inputs, rng.normal(size=40) * 3.0, hyper[0])
    second = condition(inputs[:25], rng.normal(size=25) - 8.0, hyper[1])
    return Predictor([first, second]), inputs[:11] + 0.3 * rng.normal(size=(11, 3))


def test_ninety_percent_intervals_hold_ninety_percent() -> None:
    """400 functions drawn from the prior, one new observation each: the count inside is binomial."""
    rng = np.random.default_rng(2)
    hyper = HyperParameters(1.0, np.array([0.7, 1.5]), np.array([0.5, 0.3]), 0.4, 0.2)
    identity = Standardisation(np.zeros(2), np.ones(2), 0.0, 1.0)
    scores = []
    for _ in range(400):
        inputs = rng.uniform(-2.0, 2.0, (21, 2))
        gram = covariance(inputs, inputs, hyper) + hyper.noise_std**2 * np.eye(21)
        targets = np.linalg.cholesky(gram) @ rng.standard_normal(21)
        predictor = Predictor([condition(inputs[:20], targets[:20], hyper, standardisation=identity)])
        means, variances = predictor.mean_and_variance(inputs[20:])
        spread = np.sqrt(variances[0, 0] + predictor.noise_variances[0])
        scores.append((targets[20] - means[0, 0]) / spread)
    z = np.array(scores)
    inside = np.mean(np.abs(z) < 1.6449)
    assert inside == pytest.approx(0.9, abs=4.0 * np.sqrt(0.9 * 0.1 / 400))
    assert np.mean(z**2) == pytest.approx(1.0, abs=4.0 * np.sqrt(2.0 / 400))


@pytest.mark.parametrize("include_noise", [False, True])
def test_samples_have_the_named_moments(include_noise: bool) -> None:
    predictor, new = make_predictor()
    count = 40_000
    draws = predictor.sample(
        np.tile(new[0], (count, 1)), np.random.default_rng(0), include_noise=include_noise
    )
    means, variances = predictor.mean_and_variance(new[:1])
    expected = variances[0] + (predictor.noise_variances if include_noise else 0.0)
    error = np.sqrt(expected / count)
    assert np.all(np.abs(draws.mean(axis=0) - means[0]) < 5.0 * error)
    np.testing.assert_allclose(draws.var(axis=0), expected, rtol=5.0 * np.sqrt(2.0 / count))
    centred = (draws - draws.mean(axis=0)) / draws.std(axis=0)
    assert abs(np.mean(centred[:, 0] * centred[:, 1])) < 5.0 / np.sqrt(count)
    assert abs(np.mean(centred[1:, 0] * centred[:-1, 0])) < 5.0 / np.sqrt(count)


def test_outputs_together_predict_what_each_predicts_alone() -> None:
    predictor, new = make_predictor()
    means, variances = predictor.mean_and_variance(new)
    assert means.shape == variances.shape == (11, 2)
    for column, output in enumerate(predictor.outputs):
        alone = Predictor([output])
        single_mean, single_variance = alone.mean_and_variance(new)
        np.testing.assert_allclose(means[:, [column]], single_mean, rtol=1e-9, atol=1e-10)
        np.testing.assert_allclose(variances[:, [column]], single_variance, rtol=1e-8, atol=1e-10)
        assert predictor.noise_variances[column] == alone.noise_variances[0]
    np.testing.assert_array_equal(predictor.mean(new), means)


@pytest.mark.parametrize("strip", [1, 7, 40, 1000])
def test_strips_give_the_variance_of_a_direct_solve(strip: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("gpsim.gp.predictor.STRIP", strip)
    outputs, new = make_predictor()[0].outputs, make_predictor()[1]
    variances = Predictor(outputs).mean_and_variance(new)[1]
    for output, found in zip(outputs, variances.T, strict=True):
        scaling, hyper = output.standardisation, output.hyper_parameters
        support = output.terms.support
        at = (new - scaling.input_mean) / scaling.input_scale
        gram = covariance(support, support, hyper) + hyper.noise_std**2 * np.eye(len(support))
        cross = covariance(support, at, hyper)
        latent = np.diag(covariance(at, at, hyper)) - np.sum(cross * np.linalg.solve(gram, cross), axis=0)
        np.testing.assert_allclose(found, latent * scaling.target_scale**2, rtol=1e-6)


def test_round_trip_through_bytes_keeps_every_bit() -> None:
    predictor, new = make_predictor()
    arrays, metadata = to_arrays(predictor)
    stream = io.BytesIO()
    np.savez(stream, **arrays)
    stream.seek(0)
    loaded = dict(np.load(stream, allow_pickle=False))
    again = from_arrays(loaded, json.loads(json.dumps(metadata, allow_nan=False)))
    assert again.mean(new).tobytes() == predictor.mean(new).tobytes()
    for part, expected in zip(again.mean_and_variance(new), predictor.mean_and_variance(new), strict=True):
        assert part.tobytes() == expected.tobytes()
    draws = [
        p.sample(new, np.random.default_rng(1), include_noise=True).tobytes() for p in (again, predictor)
    ]
    assert draws[0] == draws[1]
    assert {name: array.tobytes() for name, array in to_arrays(again)[0].items()} == {
        name: array.tobytes() for name, array in arrays.items()
    }


def test_damaged_arrays_are_refused() -> None:
    arrays, metadata = to_arrays(make_predictor()[0])
    with pytest.raises(ValueError, match="schema"):
        from_arrays(arrays, {**metadata, "schema": "other/9"})
    with pytest.raises(ValueError, match=r"missing: 1/root"):
        from_arrays({name: a for name, a in arrays.items() if name != "1/root"}, metadata)
    with pytest.raises(ValueError, match=r"0/support must be float64"):
        from_arrays({**arrays, "0/support": arrays["0/support"].astype(np.float32)}, metadata)


def test_wrong_inputs_are_named() -> None:
    predictor, new = make_predictor()
    with pytest.raises(ValueError, match=r"\(B, 3\), got \(11, 2\)"):
        predictor.mean(new[:, :2])
    with pytest.raises(ValueError, match="at least one"):
        Predictor([])
    other = condition(new[:, :1], new[:, 1], HyperParameters(1.0, np.ones(1), np.ones(1), 1.0, 1.0))
    with pytest.raises(ValueError, match=r"\[1, 3\]"):
        Predictor([predictor.outputs[0], other])
    assert [part.shape for part in predictor.mean_and_variance(np.empty((0, 3)))] == [(0, 2), (0, 2)]
