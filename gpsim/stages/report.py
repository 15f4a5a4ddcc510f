"""report: tables, figures and one HTML page of a finished loop, over one seed or several."""

from __future__ import annotations

import shlex
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pandas as pd
from safetensors.numpy import load_file

from gpsim.artifacts import MANIFEST, Artifact, Recipe, read_artifact
from gpsim.channels import BoolArray, FloatArray
from gpsim.corrected import GpCorrection
from gpsim.evaluation import start_sets, success_by_set, summarise_seeds
from gpsim.files import Json, plain, read_object, write_json
from gpsim.reports.loop_figures import residual_slices
from gpsim.reports.loop_page import render
from gpsim.reports.loop_report import LoopReport, MadeBy, TripReport
from gpsim.stages import build_residuals, certify, collect, evaluate, fit_gp, train_gp_policy
from gpsim.stages.building import base_plant, drivable, make_task, training_settings
from gpsim.stages.diagnose_loop import find_diagnosis, sentences
from gpsim.stages.stage import Request, Stage, stage_about
from gpsim.tasks import Balance, Task

SETTINGS = (
    "simulator", "target", "task", "policy", "collect", "residuals", "gp", "sample_noise", "randomise", "evaluate",
)  # fmt: skip
Curve = tuple[FloatArray, FloatArray]
GIVEN = ("recording", "diagnosis")


def stage_for(seeds: tuple[int, ...], shown: list[LoopReport] | None = None) -> Stage:
    """The report over these seeds, as a stage; what it shows is added to `shown` when it is made."""

    def write(request: Request, folder: Path, seeds: tuple[int, ...]) -> Json:
        report = gather(request, seeds)
        write_json(folder / "summary.json", plain(report.summary))
        (folder / "report.html").write_text(render(report), encoding="utf-8")
        if shown is not None:
            shown.append(report)
        return {}

    return stage_about("report", _recipe, write, seeds, format=1)


def made(request: Request, seeds: tuple[int, ...]) -> tuple[Artifact, LoopReport]:
    """The report over these seeds, made or found, and what it shows, which is gathered once."""
    shown: list[LoopReport] = []
    artifact, _ = stage_for(seeds, shown).make(request)
    return artifact, shown[0] if shown else gather(request, seeds)


def _recipe(request: Request, seeds: tuple[int, ...]) -> Recipe:
    parents = {
        f"{role}/{seed}" if seed is not None else role: artifact
        for role, seed, artifact in artifacts_of(request, seeds)
    }
    # The page prints the command: what is printed is part of what it is made from.
    config = {**settings_of(request), "command": command_of(request, seeds)}
    return Recipe("report", config, parents, {"seeds": list(seeds)})


def gather(request: Request, seeds: tuple[int, ...]) -> LoopReport:
    """Read everything the report shows from the loop's artifacts."""
    requests = {seed: request.having(seed=seed) for seed in seeds}
    evaluated = {seed: evaluate.STAGE.need(r) for seed, r in requests.items()}
    evaluations = [read_object(artifact.path / "evaluation.json") for artifact in evaluated.values()]
    experiment = str(request.config["experiment"])
    driven = _driven(request, list(evaluated.values())) if drivable(request.config) else Driven()
    summary = summarise_seeds(evaluations, driven.returns, driven.starts, experiment)
    if driven.trips:
        summary |= success_by_set(driven.trips, driven.starts)
    first, base, task = requests[seeds[0]], base_plant(request.config), make_task(request.config)
    training, policies = training_settings(request.config), train_gp_policy.policy_names(request)

    curves: dict[str, list[Curve]] = {}
    for name in policies:
        stage, settings = train_gp_policy.TRAINED_BY[name]
        parts = [stage.need(r.having(**settings)).path / "learning_curve.csv" for r in requests.values()]
        tables = [pd.read_csv(path)[["steps", "mean_return"]].to_numpy(dtype=np.float64) for path in parts]
        curves[name] = [(table[:, 0], table[:, 1]) for table in tables]
    paths = load_file(evaluated[seeds[0]].path / "rollouts.safetensors")
    section = request.config["task"]
    limits = {"theta": section.get("angle_limit"), "x": section.get("position_limit")}
    residuals = build_residuals.read_residuals(build_residuals.STAGE.need(first))
    correction = train_gp_policy.corrected_plant(first, fit_gp.STAGE.need(first).path).correction
    assert isinstance(correction, GpCorrection)
    return LoopReport(
        experiment=experiment,
        seeds=seeds,
        summary=summary,
        returns=driven.returns,
        trips=driven.trips,
        system=base.simulator.name,
        starts=driven.starts,
        best_return=_best(task, driven.returns),
        earns_steps=isinstance(task, Balance),
        own_rewards=train_gp_policy.full_return(task) is None,
        held=getattr(training, "action_repeat", 1),
        curves=curves,
        slices=residual_slices(residuals, correction, fit_gp.rows_of(first, residuals)),
        named=told_by_diagnoses(requests) if train_gp_policy.needs_diagnosis(request) else {},
        given=_given(request),
        fits={seed: read_object(fit_gp.STAGE.need(r).path / "fit.json") for seed, r in requests.items()},
        outside={
            seed: evaluation.get("outside_recording") or {}
            for seed, evaluation in zip(seeds, evaluations, strict=True)
        },
        states=base.state.names,
        velocities=tuple(coordinate.velocity for coordinate in base.simulator.coordinates),
        # A path that ran away ends where it did so: no figure has room for infinity.
        rollouts={name: np.where(np.isfinite(path), path, np.nan) for name, path in paths.items()},
        dt=base.dt,
        units=base.state.units | base.simulator.rate.units,
        limits={channel: float(value) for channel, value in limits.items() if value is not None},
        settings=settings_of(request),
        artifacts=[
            MadeBy(made.stage, role, made.digest, seed, made.manifest)
            for role, seed, made in artifacts_of(request, seeds)
        ],
        command=command_of(request, seeds),
    )


@dataclass(frozen=True)
class Driven:
    """Layer 3 of every seed; empty where the target cannot be driven."""

    returns: Mapping[str, FloatArray] = field(default_factory=dict)
    starts: Mapping[str, BoolArray] = field(default_factory=dict)
    trips: TripReport | None = None


def _best(task: Task, returns: Mapping[str, FloatArray]) -> float:
    """What an episode may earn, as far as anybody knows: the most that one earned where rewards are the task's own."""
    full = train_gp_policy.full_return(task)
    earned = [float(np.nanmax(values)) for values in returns.values() if np.isfinite(values).any()]
    return float(full) if full is not None else max([*earned, 1.0])


def _driven(request: Request, evaluated: list[Artifact]) -> Driven:
    tables = [evaluate.read_returns(artifact) for artifact in evaluated]
    certified = tables[0][1]
    returns = {name: np.stack([values[name] for values, _ in tables]) for name in tables[0][0]}
    trips, steps = _trips(request, evaluated), train_gp_policy.full_return(make_task(request.config))
    return Driven(returns, start_sets(returns, certified, steps, trips.reached if trips else None), trips)


def _trips(request: Request, evaluated: list[Artifact]) -> TripReport | None:
    """Every seed's trips, where the task has a goal; paths are the first seed's."""
    task = certify.goal_task(request)
    if task is None:
        return None
    read = [certify.read_trips(artifact) for artifact in evaluated]
    parts = {
        part: {name: np.stack([found[part][name] for found, _ in read]) for name in read[0][0][part]}
        for part in ("reached", "steps", "path")
    }
    paths = dict(load_file(evaluated[0].path / certify.PATHS))  # of the goal, on the target, in the simulator
    return TripReport(
        **parts,
        behind=read[0][1],
        paths=paths,
        goal_radius=task.goal_radius,
        arena=task.arena,
        floor=task.floor,
    )


def _given(request: Request) -> tuple[str, ...]:
    """What the loop was given instead of making it: `recording`, `diagnosis`."""
    return tuple(name for name in GIVEN if request.config[name] is not None)


def settings_of(request: Request) -> Json:
    """The configuration that decided something: a recording that is given was not collected."""
    given = _given(request)
    names = [name for name in SETTINGS if name != "collect" or "recording" not in given]
    return request.section(*names, *given)


def artifacts_of(request: Request, seeds: tuple[int, ...]) -> list[tuple[str, int | None, Artifact]]:
    """(role, seed, artifact) of everything that the report rests on; None where the seeds share it."""
    found: list[tuple[str, int | None, Artifact]] = []
    given, with_effects = _given(request), train_gp_policy.needs_diagnosis(request)
    if "recording" in given:
        folder = build_residuals.recording_folder(request)
        # A folder that gpsim did not make has no manifest; its digests stand in that of the residuals.
        found += [("recording", None, read_artifact(folder))] if (folder / MANIFEST).is_file() else []
    if "diagnosis" in given and with_effects:
        found.append(("diagnose", None, find_diagnosis(request)))
    own_stages = [build_residuals.STAGE, fit_gp.STAGE]
    for seed in seeds:
        own = request.having(seed=seed)
        for stage in own_stages if "recording" in given else [collect.STAGE, *own_stages]:
            found.append((stage.name, seed, stage.need(own)))
        if with_effects and "diagnosis" not in given:
            found.append(("diagnose", seed, find_diagnosis(own)))
        for name in train_gp_policy.policy_names(request):
            stage, settings = train_gp_policy.TRAINED_BY[name]
            found.append((name, seed, stage.need(own.having(**settings))))
        found.append(("evaluate", seed, evaluate.STAGE.need(own)))
    if drivable(request.config):
        found.append(("certify", None, certify.STAGE.need(request)))
    return found


def told_by_diagnoses(requests: Mapping[int, Request]) -> Mapping[int, list[str]]:
    """Of each seed what its diagnosis names; one that was given for all of them is told once."""
    found = {seed: sentences(find_diagnosis(request)) for seed, request in requests.items()}
    given = [seed for seed, request in requests.items() if request.config["diagnosis"] is not None]
    return {seed: said for seed, said in found.items() if seed not in given[1:]}


def command_of(request: Request, seeds: tuple[int, ...]) -> str:
    """What makes the report again, wherever its artifacts lie."""
    apart = ("seed", "runs_dir", "track")
    words = [shlex.quote(w) for w in request.words if w.partition("=")[0].lstrip("+") not in apart]
    start = [f"seed={seeds[0]}"] if seeds[0] else []
    several = [f"--seeds {len(seeds)}"] if len(seeds) > 1 else []
    return " ".join(["gpsim run full-loop", *words, *start, *several])
