"""fit-gp: one exact Gaussian process per rate on a subsample of the residuals."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from gpsim.artifacts import Artifact, Recipe
from gpsim.channels import FloatArray, IntArray
from gpsim.corrected import CommandFilter, Features, fit_filter, mean_rates, settled_rows
from gpsim.errors import UsageError
from gpsim.files import Json, read_object, write_json
from gpsim.gp import MOST_ROWS, Predictor, fit_chain, fit_outputs
from gpsim.residuals import Residuals
from gpsim.simulators import SimulatorPlant
from gpsim.stages import build_residuals, gp_settings
from gpsim.stages.building import base_plant
from gpsim.stages.gp_settings import chain_of, check, count_of, fit_settings, input_names, settle_of
from gpsim.stages.policy_files import write_gp
from gpsim.stages.stage import Request, Stage, generator


def recipe(request: Request) -> Recipe:
    """The residuals and the GP's settings."""
    check(request)
    gp_settings.observations_of(request)
    parents = {"residuals": build_residuals.STAGE.need(request)}
    return Recipe("fit-gp", request.section("gp"), parents, {"seed": request.seed})


def write(request: Request, recipe: Recipe, folder: Path) -> Json:
    """Fit and write gp.safetensors, gp.json and fit.json (likelihoods, hyper-parameters, convergence, warnings)."""
    section = request.config["gp"]
    states = gp_settings.observations_of(request)
    residuals = build_residuals.read_residuals(recipe.parents["residuals"])
    if states is not None:
        residuals = gp_settings.observed(request, states)
    features = Features.of(input_names(request), residuals.channels)
    base, settle, filtered = base_plant(request.config), settle_of(request), section.get("filter", False)
    count, rows = count_of(request), rows_of(request, residuals)
    if len(rows) < 10:
        late = f" whose action has stood for {settle} steps (gp.settle)" if settle else ""
        raise UsageError(
            f"only {len(rows)} training transitions{late}: record more, or hold out fewer episodes"
        )
    settings = fit_settings(request)
    _check_size(residuals, base, features, count, settle)
    inputs, targets = features(residuals.inputs[rows]), residuals.values[rows]
    chain, rng, names = chain_of(request), generator(request.seed, "fit-gp"), residuals.rate.names
    if chain is None:
        gps = fit_outputs(inputs, targets, settings, rng)
        predictor, fitted = Predictor(gps), dict(zip(names, gps, strict=True))
    else:
        predictor, slow, fast = fit_chain(inputs, targets, settings, chain, rng)
        fitted = {
            f"{name}, {pace}": gp
            for pace, gps in (("slow", slow), ("fast", fast))
            for name, gp in zip(names, gps, strict=True)
        }
    found = find_filter(residuals, base, predictor, features) if filtered else None
    write_gp(folder, predictor, features, found, wraps=features.wraps)
    reports = {name: gp.report.to_dict() for name, gp in fitted.items() if gp.report}
    warnings = [f"{name}: {text}" for name, report in reports.items() for text in report["warnings"]]
    if len(rows) < count and not settle:
        warnings.append(f"asked for {count} training transitions, the recording has {len(rows)}")
    report = {"inputs": list(features.names), "rows": len(rows), "rates": reports, "warnings": warnings}
    if found is not None:
        report["filter"] = dict(zip(base.action.names, found.describe(), strict=True))
    write_json(folder / "fit.json", report)
    return {}


def _check_size(
    residuals: Residuals, base: SimulatorPlant, features: Features, count: int, settle: int
) -> None:
    """Raise UsageError for more distinct training inputs than an exact fit takes, with the most that fit."""

    def distinct(chosen: int) -> int:
        rows = chosen_rows(residuals, base, chosen, settle)
        return len(np.unique(features(residuals.inputs[rows]), axis=0))

    if (found := distinct(count)) <= MOST_ROWS:
        return
    fits, too_many = (
        MOST_ROWS,
        min(count, int(np.sum(~residuals.test))),
    )  # each row adds one distinct input at most
    while too_many - fits > 1:
        middle = (fits + too_many) // 2
        fits, too_many = (middle, too_many) if distinct(middle) <= MOST_ROWS else (fits, middle)
    raise UsageError(
        f"gp.n_train={count}: {found} distinct training inputs, an exact Gaussian process takes at most {MOST_ROWS}; "
        f"give gp.n_train={fits}, which are drawn from all by seed"
    )


def rows_of(request: Request, residuals: Residuals) -> IntArray:
    """The rows that the configuration's GPs are conditioned on."""
    return chosen_rows(residuals, base_plant(request.config), count_of(request), settle_of(request))


def chosen_rows(residuals: Residuals, base: SimulatorPlant, count: int, settle: int) -> IntArray:
    """The rows that the GPs are conditioned on: `count` of the training rows, and of those what has settled."""
    rows = residuals.training_rows(count)
    if not settle:
        return rows
    actions = residuals.inputs[:, len(base.state) :]
    return rows[settled_rows(actions, residuals.episode, residuals.t, settle, base.dt)[rows]]


def find_filter(
    residuals: Residuals, base: SimulatorPlant, predictor: Predictor, features: Features
) -> CommandFilter:
    """Each action's delay and lag, given what the GPs say of actions that have arrived; from the training episodes."""
    rows = ~residuals.test
    split = len(base.state)
    states, actions = residuals.inputs[rows, :split], residuals.inputs[rows, split:]

    def rates_of(arrived: FloatArray) -> FloatArray:
        return mean_rates(base, states, arrived) + predictor.mean(features(np.hstack([states, arrived])))

    data = residuals.take(rows)
    return fit_filter(actions, data.episode, data.t, data.measured, rates_of, base.dt, data.over_gaps)


def notes(artifact: Artifact) -> list[str]:
    """Likelihood and noise of each fit, and its warnings."""
    report = read_object(artifact.path / "fit.json")
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


STAGE = Stage("fit-gp", recipe, write, notes, format=3)
