"""fit-gp: one exact Gaussian process per rate on a subsample of the residuals."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np

from gpsim.artifacts import Artifact, Json, Recipe, write_json
from gpsim.channels import FloatArray, IntArray
from gpsim.command_filter import CommandFilter, fit_filter, mean_rates, settled_rows
from gpsim.errors import UsageError
from gpsim.features import Features
from gpsim.gp import FitSettings, Predictor, fit_outputs
from gpsim.residuals import Residuals
from gpsim.settings import build, positive
from gpsim.simulators.plant import SimulatorPlant
from gpsim.stages import build_residuals
from gpsim.stages.building import base_plant
from gpsim.stages.policy_files import write_gp
from gpsim.stages.stage import Request, Stage, generator


def recipe(request: Request) -> Recipe:
    """The residuals and the GP's settings."""
    parents = {"residuals": build_residuals.STAGE.need(request)}
    return Recipe("fit-gp", request.section("gp"), parents, {"seed": request.seed})


def write(request: Request, recipe: Recipe, folder: Path) -> Json:
    """Fit and write gp.safetensors, gp.json and fit.json (likelihoods, hyper-parameters, convergence, warnings)."""
    section = dict(request.config["gp"])
    residuals = build_residuals.read_residuals(recipe.parents["residuals"])
    section.pop("n_train")
    features = Features.of(section.pop("inputs"), residuals.channels)
    base, settle, filtered = (
        base_plant(request.config),
        section.pop("settle", 0),
        section.pop("filter", False),
    )
    count, rows = _count(request), rows_of(request, residuals)
    if len(rows) < 10:
        late = f" whose action has stood for {settle} steps (gp.settle)" if settle else ""
        raise UsageError(
            f"only {len(rows)} training transitions{late}: record more, or hold out fewer episodes"
        )
    settings = build(FitSettings, section, "gp")
    inputs, targets = features(residuals.inputs[rows]), residuals.values[rows]
    gps = fit_outputs(inputs, targets, settings, generator(request.seed, "fit-gp"))
    predictor = Predictor(gps)
    found = find_filter(residuals, base, predictor, features) if filtered else None
    write_gp(folder, predictor, features.names, found)
    reports = {
        name: gp.report.to_dict() for name, gp in zip(residuals.rate.names, gps, strict=True) if gp.report
    }
    warnings = [f"{name}: {text}" for name, report in reports.items() for text in report["warnings"]]
    if len(rows) < count and not settle:
        warnings.append(f"asked for {count} training transitions, the recording has {len(rows)}")
    report = {"inputs": list(features.names), "rows": len(rows), "rates": reports, "warnings": warnings}
    if found is not None:
        report["filter"] = dict(zip(base.action.names, found.describe(), strict=True))
    write_json(folder / "fit.json", report)
    return {}


def _count(request: Request) -> int:
    return positive(request.config["gp"]["n_train"], "gp.n_train")


def rows_of(request: Request, residuals: Residuals) -> IntArray:
    """The rows that the configuration's GPs are conditioned on."""
    settle = request.config["gp"].get("settle", 0)
    return chosen_rows(residuals, len(base_plant(request.config).action), _count(request), settle)


def chosen_rows(residuals: Residuals, actions: int, count: int, settle: int) -> IntArray:
    """The rows that the GPs are conditioned on: `count` of the training rows, and of those what has settled.

    The last `actions` columns of the inputs are the actions.
    """
    rows = residuals.training_rows(count)
    if isinstance(settle, bool) or not isinstance(settle, int) or settle < 0:
        raise UsageError(f"gp.settle: expected a whole number of at least 0, got {settle!r}")
    if not settle:
        return rows
    return rows[settled_rows(residuals.inputs[:, -actions:], residuals.episode, settle)[rows]]


def find_filter(
    residuals: Residuals, base: SimulatorPlant, predictor: Predictor, features: Features
) -> CommandFilter:
    """Each action's delay and lag, given what the GPs say of actions that have arrived; from the training episodes."""
    rows = ~residuals.test
    split = len(base.state)
    states, actions = residuals.inputs[rows, :split], residuals.inputs[rows, split:]

    def rates_of(arrived: FloatArray) -> FloatArray:
        return mean_rates(base, states, arrived) + predictor.mean(features(np.hstack([states, arrived])))

    return fit_filter(actions, residuals.episode[rows], residuals.measured[rows], rates_of, base.dt)


def notes(artifact: Artifact) -> list[str]:
    """Likelihood and noise of each fit, and its warnings."""
    report = json.loads((artifact.path / "fit.json").read_text(encoding="utf-8"))
    lines = [
        f"{name}: log likelihood {fit['log_marginal_likelihood']:.1f} on {fit['rows']} rows, noise "
        f"{fit['hyper_parameters_original']['noise_std']:.3g}, {fit['outcome'].replace('_', ' ')}"
        for name, fit in report["rates"].items()
    ]
    lines += [
        f"{name}: arrives {found['delay']:.3f} s late, then lags by {found['time_constant']:.3f} s"
        for name, found in report.get("filter", {}).items()
    ]
    return lines + [f"warning: {text}" for text in report["warnings"]]


STAGE = Stage("fit-gp", "Fit one Gaussian process per rate to the residuals.", recipe, write, notes)
