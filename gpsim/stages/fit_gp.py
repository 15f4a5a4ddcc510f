"""fit-gp: one exact Gaussian process per rate on a subsample of the residuals, of estimated states if asked."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from gpsim.artifacts import Artifact, Recipe
from gpsim.channels import FloatArray, IntArray
from gpsim.corrected import (
    CommandFilter,
    Features,
    GpCorrection,
    Smoother,
    fit_filter,
    mean_rates,
    settled_rows,
)
from gpsim.errors import UsageError
from gpsim.files import Json, read_object, write_json
from gpsim.gp import MOST_ROWS, Predictor, fit_chain, fit_outputs
from gpsim.recordings import Recording, read_recording
from gpsim.residuals import Residuals
from gpsim.settings import build, number
from gpsim.simulators import SimulatorPlant
from gpsim.stages import build_residuals, building
from gpsim.stages.building import base_plant, count_of, fit_settings, input_names, settle_of
from gpsim.stages.policy_files import write_gp
from gpsim.stages.stage import Request, Stage, generator


def recipe(request: Request) -> Recipe:
    """The residuals and the GP's settings."""
    building.check_gp(request)
    observations_of(request)
    parents = {"residuals": build_residuals.STAGE.need(request)}
    return Recipe("fit-gp", request.section("gp"), parents, {"seed": request.seed})


def write(request: Request, recipe: Recipe, folder: Path) -> Json:
    """Fit and write gp.safetensors, gp.json and fit.json (likelihoods, hyper-parameters, convergence, warnings)."""
    section = request.config["gp"]
    states = observations_of(request)
    residuals = build_residuals.read_residuals(recipe.parents["residuals"])
    if states is not None:
        residuals = observed(request, states)
    features = Features.of(input_names(request), residuals.channels)
    base, settle, filtered = base_plant(request.config), settle_of(request), section.get("filter", False)
    count, rows = count_of(request), rows_of(request, residuals)
    if len(rows) < 10:
        late = f" whose action has been held for {settle} steps (gp.settle)" if settle else ""
        raise UsageError(
            f"only {len(rows)} training transitions{late}: record more, or hold out fewer episodes"
        )
    settings = fit_settings(request)
    _check_size(residuals, base, features, count, settle)
    inputs, targets = features(residuals.inputs[rows]), residuals.values[rows]
    chain, rng, names = building.chain_of(request), generator(request.seed, "fit-gp"), residuals.rate.names
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
    # Each row adds one distinct input at most.
    fits, too_many = MOST_ROWS, min(count, int(np.sum(~residuals.test)))
    while too_many - fits > 1:
        middle = (fits + too_many) // 2
        fits, too_many = (middle, too_many) if distinct(middle) <= MOST_ROWS else (fits, middle)
    raise UsageError(
        f"gp.n_train={count}: {found} distinct training inputs, an exact Gaussian process allows at most {MOST_ROWS}; "
        f"set gp.n_train={fits} to draw that many with the seed"
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


LEAST = 0.05  # of the residual's spread: so much the rates may be off at the least


@dataclass(frozen=True)
class ObservationSettings:
    """noise: channel -> standard deviation of an observation, None: what the recording says; rounds: see `observed`."""

    noise: Mapping[str, float] | None = None
    rounds: int = 3

    def __post_init__(self) -> None:
        if self.rounds < 1:
            raise ValueError(f"rounds must be at least 1, got {self.rounds}")


def observations_of(request: Request) -> ObservationSettings | None:
    """How states are estimated; None: they are taken as they were recorded."""
    section = request.config["gp"].get("observations")
    if section is None:
        return None
    if not isinstance(section, Mapping):
        raise UsageError(f"gp.observations: expected settings, as {{rounds: 3}}, or null, got {section!r}")
    if request.config["gp"].get("filter"):
        raise UsageError(
            "gp.observations: it estimates states without the command filter: set gp.filter=false"
        )
    return build(ObservationSettings, section, "gp.observations")


def observed(request: Request, settings: ObservationSettings) -> Residuals:
    """Residuals of smoothed states, of transitions whose command is known.

    In the first round the base simulator says how states may follow each other, then the one that is corrected by the
    Gaussian processes of the round before.
    """
    recording, base = read_recording(build_residuals.recording_folder(request)), base_plant(request.config)
    noise = _noise_of(recording, settings.noise)
    spread, correction = _spread(request, recording, base, noise), None
    swing = np.concatenate([episode.actions for episode in recording.episodes]).std(axis=0)
    least = LEAST * spread
    for turn in range(settings.rounds):
        residuals = _smoothed(request, recording, base, Smoother(base, correction, noise, spread, swing))
        request.progress(turn + 1, settings.rounds, "states from observations")
        if turn + 1 < settings.rounds:
            correction, spread = _learnt(request, residuals)
            spread = np.maximum(spread, least)
    return residuals


def _smoothed(request: Request, recording: Recording, base: SimulatorPlant, smoother: Smoother) -> Residuals:
    parts = [smoother(episode) for episode in recording.episodes]
    whole = replace(recording, episodes=tuple(episode for episode, _ in parts))
    if not np.isfinite(np.concatenate([e.states for e in whole.episodes])).all():
        raise UsageError(
            "gp.observations: the simulator diverges on the recording, so no states can be estimated"
        )
    found = build_residuals.subtracted(request, whole, base).take(
        np.concatenate([known for _, known in parts])
    )
    order = np.full(len(found.order), -1, dtype=np.int64)
    training = np.flatnonzero(found.order >= 0)
    order[training[np.argsort(found.order[training])]] = np.arange(training.size)
    return replace(found, order=order)


def _learnt(request: Request, residuals: Residuals) -> tuple[GpCorrection, FloatArray]:
    """What the residuals say of the rates, and how far (R,) they may still be off."""
    features = Features.of(input_names(request), residuals.channels)
    rows = residuals.training_rows(count_of(request))
    inputs = features(residuals.inputs[rows])
    rng = generator(request.seed, "fit-gp/observations")
    predictor = Predictor(fit_outputs(inputs, residuals.values[rows], fit_settings(request), rng))
    _, variance = predictor.mean_and_variance(inputs)
    spread = np.sqrt(variance.mean(axis=0) + predictor.noise_variances)
    return GpCorrection(predictor, features, "mean", sample_noise=False), spread


def _spread(request: Request, recording: Recording, base: SimulatorPlant, noise: FloatArray) -> FloatArray:
    """(R,): the spread of the residuals less what the noise makes of it, which as much noise once more shows."""
    rng = generator(request.seed, "fit-gp/noise")
    shaken = (
        replace(e, states=e.states + noise * rng.standard_normal(e.states.shape)) for e in recording.episodes
    )
    parts = (recording, replace(recording, episodes=tuple(shaken)))
    total, again = (build_residuals.subtracted(request, part, base).values.var(axis=0) for part in parts)
    return np.asarray(np.sqrt(np.maximum(total - np.maximum(again - total, 0.0), LEAST * total) + 1e-300))


def _noise_of(recording: Recording, given: Mapping[str, Any] | None) -> FloatArray:
    """(S,): of every channel; raises UsageError for one of which nobody says it."""
    named = dict(recording.noise) if given is None else given
    for name in recording.state.names:
        if name not in named or not number(named[name], f"gp.observations.noise.{name}") > 0.0:
            raise UsageError(
                f"gp.observations: the noise of {name} is unknown; give standard deviations in recording.yaml (noise), "
                f"or as gp.observations.noise={{{name}: 0.001, ...}}"
            )
    return np.array([float(named[name]) for name in recording.state.names])


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
