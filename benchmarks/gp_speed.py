"""Speed of gpsim's Gaussian process beside scikit-learn and GPyTorch, in one process on one thread.

    python benchmarks/gp_speed.py [--out FILE] [--repeats 200] [--data-sets 6]
    python benchmarks/gp_speed.py --largest 1000 2000 5000      # one step of each at as many rows as a fit takes

Times are processor time: with one thread that is what a free machine would take, however busy this one is.

The data are what the GP sees in the cart-pole experiment: the acceleration that Coulomb friction (mu = 0.9) adds,
at states that random pushes reach. Inputs, number of rows and settings of the fit are those that
`gpsim fit-gp experiment=cartpole` runs. All libraries get the same data, kernel (thesis 4.9), start and noise floor.
Likelihoods are computed by gpsim's formula, in the same standardised units, at the values each library reports.
"""

from __future__ import annotations

import os

# Before NumPy and torch load: they size their thread pools when imported.
os.environ["OMP_NUM_THREADS"] = "1"
os.environ["OPENBLAS_NUM_THREADS"] = "1"
os.environ["MKL_NUM_THREADS"] = "1"

import argparse
import json
import time
import warnings
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from gp_rivals import (
    HAS_GPYTORCH,
    sklearn_fit,
    sklearn_predictor,
    torch_evaluation,
    torch_fit,
    torch_predictors,
)
from gpsim.cli.configuration import resolve
from numpy.typing import NDArray

from gpsim.corrected import Features
from gpsim.files import plain
from gpsim.gp import (
    HyperParameters,
    NotPositiveDefiniteError,
    Predictor,
    Standardisation,
    TrainingData,
    condition,
    covariance,
    first_start,
    fit,
    log_marginal_likelihood,
)
from gpsim.gp.exact import Likelihood
from gpsim.stages.building import base_plant
from gpsim.stages.fit_gp import fit_settings, input_names
from gpsim.stages.stage import Request

FloatArray = NDArray[np.float64]
GRAVITY, CART, POLE, HALF_LENGTH, PUSH, DT = 9.8, 1.0, 0.1, 0.5, 10.0, 0.02
OURS = "gpsim, as configured"
# What `gpsim fit-gp experiment=cartpole` runs: its inputs, rows, starts and stopping.
REQUEST = Request(resolve(["experiment=cartpole"], None))
SETTINGS, ROWS = fit_settings(REQUEST), int(REQUEST.config["gp"]["n_train"])
ONE_START = replace(SETTINGS, restarts=0)
BASE = base_plant(REQUEST.config)
FEATURES = Features.of(input_names(REQUEST), BASE.state + BASE.action)
D = len(FEATURES.names)


def cartpole_rates(state: FloatArray, force: float, mu: float) -> FloatArray:
    """(x_acc, theta_acc) of the cart-pole with Coulomb friction on the cart (thesis 4.11 to 4.13, corrected)."""
    _, x_dot, theta, theta_dot = state
    s, total, sin, cos = np.sign(x_dot), CART + POLE, np.sin(theta), np.cos(theta)
    push = (-force - POLE * HALF_LENGTH * theta_dot**2 * (sin + mu * s * cos)) / total
    inertia = HALF_LENGTH * (4.0 / 3.0 - POLE * cos * (cos - mu * s * sin) / total)
    theta_acc = (GRAVITY * sin + cos * (push + mu * GRAVITY * s)) / inertia
    normal = total * GRAVITY - POLE * HALF_LENGTH * (theta_acc * sin + theta_dot**2 * cos)
    swing = POLE * HALF_LENGTH * (theta_dot**2 * sin - theta_acc * cos)
    return np.array([(force + swing - mu * normal * s) / total, theta_acc])


def friction_residual(count: int, rng: np.random.Generator) -> tuple[FloatArray, FloatArray]:
    """`count` rows of random-action episodes: the configured inputs, target x_acc residual."""
    rows: list[FloatArray] = []
    targets: list[float] = []
    while len(rows) < 4 * count:
        state = rng.uniform(-0.05, 0.05, 4)
        for _ in range(500):
            force = float(rng.choice([-PUSH, PUSH]))
            true = cartpole_rates(state, force, 0.9)
            rows.append(np.append(state, force))
            targets.append(float(true[0] - cartpole_rates(state, force, 0.0)[0]))
            state = state + DT * np.array([state[1], true[0], state[3], true[1]])
            if abs(state[2]) > 0.2 or abs(state[0]) > 2.4:
                break
    chosen = rng.choice(len(rows), count, replace=False)
    return FEATURES(np.array(rows)[chosen]), np.array(targets)[chosen]


def interleaved(contenders: dict[str, Callable[[], Any]], repeats: int, inner: int) -> dict[str, float]:
    """Median microseconds per call; the contenders take turns, so that a slow moment hits all of them."""
    seconds: dict[str, list[float]] = {name: [] for name in contenders}
    for call in contenders.values():
        call()
    for _ in range(repeats):
        for name, call in contenders.items():
            began = time.process_time()
            for _ in range(inner):
                call()
            seconds[name].append((time.process_time() - began) / inner)
    return {name: float(np.median(values)) * 1e6 for name, values in seconds.items()}


def prediction(repeats: int) -> dict[str, dict[str, float]]:
    rng = np.random.default_rng(0)
    inputs, targets = friction_residual(ROWS, rng)
    new, _ = friction_residual(10, rng)
    process = fit(inputs, targets, SETTINGS, rng)
    predictor, hyper, scaling = Predictor([process]), process.hyper_parameters, process.standardisation
    oracle = sklearn_predictor(process.data, hyper)
    print(f"{process.terms.root.shape[1]} columns of the root left of {ROWS}")
    z = scaling.inputs(new)
    calls: dict[str, dict[str, Callable[[], Any]]] = {
        "mean": {"gpsim": lambda: predictor.mean(new), "scikit-learn": lambda: oracle.predict(z)},
        "mean and variance": {
            "gpsim": lambda: predictor.mean_and_variance(new),
            "scikit-learn": lambda: oracle.predict(z, return_std=True),
        },
    }
    if HAS_GPYTORCH:
        for what, call in torch_predictors(process.data, hyper, z).items():
            calls[what]["GPyTorch"] = call
    mean, variance = (part[:, 0] for part in predictor.mean_and_variance(new))
    for name, call in calls["mean and variance"].items():
        other_mean, spread = call()
        if name != "gpsim":
            other = spread if name == "GPyTorch" else spread**2
            off_mean = np.abs(scaling.targets(mean) - other_mean).max()
            off = np.abs(variance / scaling.target_scale**2 - other).max()
            print(
                f"{name} predicts the same: mean within {off_mean:.0e}, variance within {off:.0e} (standardised)"
            )
    return {what: interleaved(contenders, repeats, 10) for what, contenders in calls.items()}


def large_prediction() -> dict[str, float]:
    """gpsim alone at N = 3000, batch 10: microseconds."""
    rng = np.random.default_rng(0)
    inputs, targets = friction_residual(3000, rng)
    hyper = HyperParameters(1.0, np.ones(D), np.full(D, 0.3), 0.1, 0.05)
    predictor, new = Predictor([condition(inputs, targets, hyper)]), inputs[:10]
    calls: dict[str, Callable[[], Any]] = {
        "mean": lambda: predictor.mean(new),
        "mean and variance": lambda: predictor.mean_and_variance(new),
    }
    return interleaved(calls, 30, 2)


def fit_contenders(
    inputs: FloatArray, targets: FloatArray, data: TrainingData
) -> dict[str, Callable[[], Any]]:
    rng, start = np.random.default_rng(0), first_start(data)
    contenders: dict[str, Callable[[], Any]] = {
        OURS: lambda: fit(inputs, targets, SETTINGS, rng).hyper_parameters,
        "gpsim, 1 start": lambda: fit(inputs, targets, ONE_START, rng).hyper_parameters,
        "scikit-learn, 1 start": lambda: sklearn_fit(data, start),
    }
    if HAS_GPYTORCH:
        contenders["GPyTorch, Adam, 1 start"] = lambda: torch_fit(data, start, "Adam")
        contenders["GPyTorch, L-BFGS, 1 start"] = lambda: torch_fit(data, start, "L-BFGS")
    return contenders


def reached(data: TrainingData, hyper: HyperParameters) -> float:
    """The log likelihood; minus infinity where a library without bounds left what cannot be factorised."""
    try:
        return log_marginal_likelihood(data, hyper)
    except NotPositiveDefiniteError:
        return float("-inf")


def fits(seeds: int) -> dict[str, dict[str, list[float]]]:
    results: dict[str, dict[str, list[float]]] = {}
    for seed in range(seeds):
        inputs, targets = friction_residual(ROWS, np.random.default_rng(seed))
        scaling = Standardisation.of(inputs, targets)
        data = TrainingData.of(scaling.inputs(inputs), scaling.targets(targets), average_replicates=True)
        for name, call in fit_contenders(inputs, targets, data).items():
            began = time.process_time()
            hyper = call()
            result = results.setdefault(name, {"seconds": [], "likelihood": []})
            result["seconds"].append(time.process_time() - began)
            result["likelihood"].append(reached(data, hyper))
    return results


def growth() -> list[dict[str, float]]:
    rows = []
    for count in (125, 250, 500, 1000):
        inputs, targets = friction_residual(count, np.random.default_rng(0))
        began = time.process_time()
        process = fit(inputs, targets, ONE_START, np.random.default_rng(0))
        seconds = time.process_time() - began
        report, z = process.report, process.data.inputs
        assert report is not None
        gram = covariance(z, z, process.hyper_parameters) + 0.01 * np.eye(count)
        cholesky = interleaved({"cholesky": partial(np.linalg.cholesky, gram)}, 20, 2)["cholesky"]
        each = 1e3 * seconds / report.evaluations
        rows.append({"N": count, "fit_s": seconds, "evaluation_ms": each, "cholesky_ms": cholesky / 1e3})
    return rows


def largest(sizes: list[int]) -> list[dict[str, float]]:
    """Seconds of one evaluation of likelihood and gradient, of conditioning, and of a prediction of 10 rows.

    Beside scikit-learn and GPyTorch, which is told to factorise; their gradients up to RIVALS rows: scikit-learn's
    holds an N x N matrix a hyper-parameter.
    """
    rows = []
    for count in sizes:
        inputs, targets = friction_residual(count, np.random.default_rng(0))
        scaling = Standardisation.of(inputs, targets)
        data = TrainingData.of(scaling.inputs(inputs), scaling.targets(targets), average_replicates=True)
        hyper, new, z = (
            HyperParameters(1.0, np.ones(D), np.full(D, 0.3), 0.1, 0.05),
            inputs[:10],
            data.inputs[:10],
        )
        calls = (
            evaluations(data, hyper)
            if count <= RIVALS
            else {"evaluation gpsim": _own_evaluation(data, hyper)}
        )
        row: dict[str, float] = {"N": count}
        for name, call in calls.items():
            _, row[name] = _timed(call)
        ours, row["condition gpsim"] = _timed(partial(condition, inputs, targets, hyper))
        theirs, row["condition scikit-learn"] = _timed(partial(sklearn_predictor, data, hyper))
        predictor = Predictor([ours])
        (mean, variance), row["prediction gpsim"] = _timed(partial(predictor.mean_and_variance, new))
        (other, spread), row["prediction scikit-learn"] = _timed(partial(theirs.predict, z, return_std=True))
        row["off mean"] = float(np.abs(scaling.targets(mean[:, 0]) - other).max())
        row["off variance"] = float(np.abs(variance[:, 0] / scaling.target_scale**2 - spread**2).max())
        rows.append(row)
        print("  " + ", ".join(f"{name} {value:.3g}" for name, value in row.items()), flush=True)
    return rows


RIVALS = 2000  # rows


def _own_evaluation(data: TrainingData, hyper: HyperParameters) -> Callable[[], Any]:
    likelihood, vector = Likelihood(data), hyper.to_log_vector()
    return lambda: likelihood(vector)


def evaluations(data: TrainingData, hyper: HyperParameters) -> dict[str, Callable[[], Any]]:
    """One evaluation of log likelihood and gradient in each library."""
    theirs = sklearn_predictor(data, hyper)
    calls = {
        "evaluation gpsim": _own_evaluation(data, hyper),
        "evaluation scikit-learn": lambda: theirs.log_marginal_likelihood(
            theirs.kernel_.theta, eval_gradient=True
        ),
    }
    if HAS_GPYTORCH:
        calls["evaluation GPyTorch"] = torch_evaluation(data, hyper)
    return calls


def _timed(call: Callable[[], Any]) -> tuple[Any, float]:
    began = time.process_time()
    result = call()
    return result, time.process_time() - began


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--out", type=Path, help="write the numbers as JSON")
    parser.add_argument("--repeats", type=int, default=200, help="timed rounds of every prediction")
    parser.add_argument("--data-sets", type=int, default=6, help="data sets that are fitted")
    parser.add_argument("--largest", type=int, nargs="+", help="instead: what one step costs at so many rows")
    arguments = parser.parse_args()
    # scikit-learn warns of every hyper-parameter at a bound, GPyTorch of its own jitter.
    warnings.simplefilter("ignore")
    if not HAS_GPYTORCH:
        print("GPyTorch is not installed and left out: pip install gpytorch")
    if arguments.largest:
        print(f"D = {D}, one thread, processor seconds; off: gpsim from scikit-learn, standardised")
        found = largest(arguments.largest)
        if arguments.out:
            arguments.out.write_text(json.dumps(plain({"largest": found}), indent=2) + "\n", encoding="utf-8")
        return
    predicted, large, fitted, grown = (
        prediction(arguments.repeats),
        large_prediction(),
        fits(arguments.data_sets),
        growth(),
    )
    for what, times in predicted.items():
        print(f"\n{what}, N = {ROWS}, batch 10, D = {D}, median of {arguments.repeats} rounds")
        for name, micro in times.items():
            print(f"  {name:14s} {micro:9.1f} us  {micro / times['gpsim']:7.1f} x gpsim")
    print(
        "\ngpsim alone, N = 3000, batch 10: " + ", ".join(f"{what} {us:.0f} us" for what, us in large.items())
    )
    print(
        f"\nfit, N = {ROWS}, D = {D}, {arguments.data_sets} data sets: median seconds, log marginal likelihood of each"
    )
    for name, result in fitted.items():
        ratio = np.median(result["seconds"]) / np.median(fitted[OURS]["seconds"])
        values = "  ".join(f"{value:8.1f}" for value in result["likelihood"])
        print(f"  {name:26s} {np.median(result['seconds']):7.3f} s  {ratio:5.1f} x ours   {values}")
    print("\ngrowth of a fit (1 start) beside a plain Cholesky factorisation")
    for row in grown:
        print(
            f"  N {row['N']:5.0f}  fit {row['fit_s']:6.3f} s  one evaluation {row['evaluation_ms']:7.2f} ms  "
            f"Cholesky {row['cholesky_ms']:7.2f} ms  ratio {row['evaluation_ms'] / row['cholesky_ms']:5.1f}"
        )
    if arguments.out:
        numbers = {"prediction_us": predicted, "prediction_3000_us": large, "fit": fitted, "growth": grown}
        arguments.out.write_text(json.dumps(plain(numbers), indent=2) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
