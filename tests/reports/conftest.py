"""A fabricated loop: two rates, five policies, any number of seeds, all of it known."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from gpsim.reports.loop_report import LoopReport, MadeBy, ResidualSlice

POLICIES = {"Source": 0.0, "Domain randomisation": 0.3, "GP-Mean": 0.9, "GP-Sample": 0.98, "Target": 1.0}
STATES = ("x", "x_dot", "theta", "theta_dot")
UNITS = dict(
    zip((*STATES, "x_acc", "theta_acc"), ("m", "m/s", "rad", "rad/s", "m/s^2", "rad/s^2"), strict=True)
)
MakeReport = Callable[..., LoopReport]


@pytest.fixture(scope="session")
def make_report() -> MakeReport:
    return _report


def _report(seeds: int = 1, policies: tuple[str, ...] = tuple(POLICIES)) -> LoopReport:
    rng = np.random.default_rng(5)
    returns = {
        name: np.where(
            rng.random((seeds, 60)) < POLICIES.get(name, 0.5), 500.0, rng.integers(20, 300, (seeds, 60))
        )
        for name in policies
    }
    starts = {"returns": rng.random(60) < 0.8, "returns_all": np.ones(60, dtype=np.bool_)}
    starts["returns_certified"] = starts["returns"] | (rng.random(60) < 0.5)
    summary: dict[str, Any] = {
        "experiment": "cartpole",
        "seeds": list(range(seeds)),
        **{key: {n: _stats(r[:, mask]) for n, r in returns.items()} for key, mask in starts.items()},
        "share": {key: float(mask.mean()) for key, mask in starts.items()},
        "one_step": {"x_acc": _scores(0.0031), "theta_acc": _scores(0.0172)},
        "one_step_random": {"transitions": 300, "x_acc": _scores(0.0213), "theta_acc": _scores(0.0444)},
        "rollout": _rollout(),
        "own_simulator": {name: 400.0 + i for i, name in enumerate(policies)},
    }
    steps = np.arange(1, 31) * 1000.0
    return LoopReport(
        experiment="cartpole",
        seeds=tuple(range(seeds)),
        summary=summary,
        returns=returns,
        starts=starts,
        curves={name: [(steps, 500.0 * rng.random(30)) for _ in range(seeds)] for name in policies},
        slices={"x_acc": _slice("x_acc"), "theta_acc": _slice("theta_acc")},
        fits={seed: _fit() for seed in range(seeds)},
        states=STATES,
        velocities=("x_dot", "theta_dot"),
        rollouts={name: rng.normal(size=(4, 21, 4)) for name in ("Target", "Source", "GP-Mean", "GP-Sample")},
        dt=0.02,
        units=UNITS,
        limits={"theta": 0.2},
        settings={"gp": {"n_train": 250, "inputs": ["x", "sign(x_dot)"]}, "sample_noise": True},
        artifacts=[
            MadeBy("fit-gp", "fit-gp", "ab" * 32, seed, {"stage": "fit-gp", "note": "<b>&</b>"})
            for seed in range(seeds)
        ],
        command="gpsim run full-loop experiment=cartpole",
    )


def _stats(returns: np.ndarray) -> dict[str, Any]:
    """As in summary.json; the intervals are made up, bootstrapping them would take the tests' time."""
    mean, middle = float(returns.mean()), float(np.median(returns))
    return {
        "mean": mean, "std": float(returns.std()), "episodes": returns.size, "interval": [mean - 7.3, mean + 6.1],
        "iqm": middle, "iqm_interval": [middle - 9.2, middle + 8.4], "by_seed": returns.mean(axis=1).tolist(),
    }  # fmt: skip


def _scores(nrmse: float) -> dict[str, Any]:
    errors = {"nrmse": nrmse, "nrmse_std": nrmse / 3, "r2": 1.0 - nrmse**2, "rmse": 20 * nrmse}
    coverage = {"0.5": 0.46 + nrmse, "0.9": 0.87 + nrmse, "0.99": 0.955 + nrmse}
    return {
        "mean": errors, "sample": {**errors, "nrmse": 2 * nrmse}, "negative_log_likelihood": -1.0 - nrmse,
        "coverage": coverage, "predicted_std": 0.02, "range": 20.0,
    }  # fmt: skip


def _rollout() -> dict[str, Any]:
    rms = {name: 0.1234 * (i + 1) for i, name in enumerate(STATES)}
    simulators = {name: {"rms": rms} for name in ("Source", "GP-Mean", "GP-Sample")}
    return {"horizon_s": 0.4, "rollouts": 12, "dt": 0.02, **simulators}


def _slice(rate: str) -> ResidualSlice:
    grid = np.linspace(-1.0, 1.0, 41)
    points = np.linspace(-0.9, 0.9, 30)
    return ResidualSlice(
        rate=rate,
        channel="x_dot",
        at={"x": 0.0, "theta": 0.01},
        grid=grid,
        mean=-9.0 * np.sign(grid),
        observed_std=np.full(41, 0.2),
        point_inputs=points,
        point_residuals=-9.0 * np.sign(points),
        point_errors=0.01 * np.sin(points),
        near=np.arange(30) % 4 == 0,
    )


def _fit() -> dict[str, Any]:
    rate = {
        "outcome": "likelihood_settled", "advice": "The fit converged.", "converged": True, "rows": 80,
        "hyper_parameters_original": {"noise_std": 0.0094},
    }  # fmt: skip
    warned = ["x_acc: noise <floor>"]
    rates = {"x_acc": rate, "theta_acc": rate}
    return {"inputs": ["x", "sign(x_dot)"], "rows": 80, "rates": rates, "warnings": warned}
