"""fit-gp: one exact Gaussian process per rate on a subsample of the residuals."""

from __future__ import annotations

import json
from pathlib import Path

from gpsim.artifacts import Artifact, Json, Recipe, write_json
from gpsim.errors import UsageError
from gpsim.features import Features
from gpsim.gp import FitSettings, Predictor, fit_outputs
from gpsim.settings import build, positive
from gpsim.stages import build_residuals
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
    count = positive(section.pop("n_train"), "gp.n_train")
    features = Features.of(section.pop("inputs"), residuals.channels)
    rows = residuals.training_rows(count)
    if len(rows) < 10:
        raise UsageError(f"only {len(rows)} training transitions: record more, or hold out fewer episodes")
    settings = build(FitSettings, section, "gp")
    inputs, targets = features(residuals.inputs[rows]), residuals.values[rows]
    gps = fit_outputs(inputs, targets, settings, generator(request.seed, "fit-gp"))
    write_gp(folder, Predictor(gps), features.names)
    reports = {
        name: gp.report.to_dict() for name, gp in zip(residuals.rate.names, gps, strict=True) if gp.report
    }
    warnings = [f"{name}: {text}" for name, report in reports.items() for text in report["warnings"]]
    if len(rows) < count:
        warnings.append(f"asked for {count} training transitions, the recording has {len(rows)}")
    report = {"inputs": list(features.names), "rows": len(rows), "rates": reports, "warnings": warnings}
    write_json(folder / "fit.json", report)
    return {}


def notes(artifact: Artifact) -> list[str]:
    """Likelihood and noise of each fit, and its warnings."""
    report = json.loads((artifact.path / "fit.json").read_text(encoding="utf-8"))
    lines = [
        f"{name}: log likelihood {fit['log_marginal_likelihood']:.1f} on {fit['rows']} rows, noise "
        f"{fit['hyper_parameters_original']['noise_std']:.3g}, {fit['outcome'].replace('_', ' ')}"
        for name, fit in report["rates"].items()
    ]
    return lines + [f"warning: {text}" for text in report["warnings"]]


STAGE = Stage("fit-gp", "Fit one Gaussian process per rate to the residuals.", recipe, write, notes)
