"""run full-loop: every stage for every seed, side by side where they do not depend on each other; and sweep.

A sweep makes one stage for every combination of settings, then a table of all figures and a page.
"""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import pandas as pd

from gpsim.artifacts import Artifact, Recipe, listed_once
from gpsim.errors import UsageError
from gpsim.files import Json, canonical
from gpsim.launchers import Launcher
from gpsim.recordings import read_recording
from gpsim.reports.sweep_page import sweep_page
from gpsim.residuals import check_clock
from gpsim.runs import figures_of
from gpsim.settings import choice, positive
from gpsim.stages import build_residuals, building, certify, collect, evaluate, train_source
from gpsim.stages.building import base_plant, drivable, make_task, randomised_plant, target_plant
from gpsim.stages.diagnose_loop import find_diagnosis
from gpsim.stages.jobs import Job, Told, run_jobs
from gpsim.stages.registry import STAGES
from gpsim.stages.stage import Request, blamed, stage_about
from gpsim.stages.train_gp_policy import DIAGNOSED, TRAINED_BY, effects_plant, needs_diagnosis, policy_names
from gpsim.stages.train_source import settings_for

SWEEP, FORMAT = "sweep", 1
CSV, PARQUET, PAGE = "sweep.csv", "sweep.parquet", "report.html"
TRAININGS = ("train-source", "train-gp-policy")
DECIDING = {"diagnose": ("simulator", "diagnose", "residuals", "collect", "recording", "seed")}
"""Of a stage whose recipe reads a file of a parent, the settings that it reads beside that."""


def plan(request: Request, seeds: tuple[int, ...]) -> list[Job]:
    """The loop's jobs in the order in which they matter: what others wait for comes first."""
    _check(request)
    jobs = [job for seed in seeds for job in _plan_seed(request.having(seed=seed), seed)]
    shared = [Job("certify", "certify", request.having(seed=seeds[0]))] if drivable(request.config) else []
    jobs += shared
    for seed in seeds:
        after = tuple(f"{name} · seed {seed}" for name in policy_names(request))
        parents = (*after, f"Source · seed {seed}", f"fit-gp · seed {seed}", *(job.label for job in shared))
        jobs.append(Job(f"evaluate · seed {seed}", "evaluate", request.having(seed=seed), parents))
    return jobs


def _check(request: Request) -> None:
    """Settings that are wrong are better found now than after an hour of training."""
    if request.config["deployed"] is not None:
        raise UsageError("deployed= scores logs of a policy and needs no loop: gpsim evaluate deployed=...")
    train_source.tracks(request)
    base_plant(request.config)
    settings_for(request, make_task(request.config))
    evaluate.check(request)
    if "Domain randomisation" in policy_names(request):
        randomised_plant(request.config)
    if request.config["recording"] is None:
        collect.check(request)
    else:  # it must be there, be whole, and be of this experiment's simulator
        build_residuals.recipe(request)
        recording = read_recording(build_residuals.recording_folder(request))
        check_clock(recording)
        build_residuals.check_same(recording, base_plant(request.config))
    if request.config["diagnosis"] is not None:
        effects_plant(request.having(correction="effects"), find_diagnosis(request))
    build_residuals.check(request)
    building.check_gp(request)
    asked, section = request.config["diagnose"]["episodes"], request.config["collect"]
    if asked is not None:
        positive(asked, "diagnose.episodes")
        driven = request.config["recording"] is None and collect.waits_for_policy(request)
        if driven and asked > positive(section["episodes"], "collect.episodes"):
            raise UsageError(
                f"diagnose.episodes={asked}: collect.episodes={section['episodes']} are recorded"
            )
    if drivable(request.config):
        target_plant(request.config)
        certify.recipe(request)


def _plan_seed(request: Request, seed: int) -> list[Job]:
    """What is given, `recording=` or `diagnosis=`, is not made."""

    def job(name: str, after: Sequence[Job] = (), stage: str = "", **settings: str) -> Job:
        asked = request.having(**settings) if settings else request
        return Job(f"{name} · seed {seed}", stage or name, asked, tuple(other.label for other in after))

    source = job("Source", (), "train-source", variant="source")
    driver = [source] if collect.waits_for_policy(request) else []
    recorded = [job("collect", driver)] if request.config["recording"] is None else []
    residuals = job("build-residuals", recorded)
    fit = job("fit-gp", [residuals])
    diagnosed = []
    if needs_diagnosis(request) and request.config["diagnosis"] is None:
        diagnosed = [job("diagnose", recorded)]
    # What waits for no policy goes first: logs that cannot be read are found at once.
    jobs = [source, *recorded] if driver else [*recorded, source]
    jobs += [residuals, fit, *diagnosed]
    for name in policy_names(request):
        stage, settings = TRAINED_BY[name]
        by_gp = [fit] if stage.name == "train-gp-policy" else []
        if name != "Source":
            jobs.append(job(name, diagnosed if name in DIAGNOSED else by_gp, stage.name, **settings))
    return jobs


def run(request: Request, seeds: tuple[int, ...], launcher: Launcher, told: Told) -> None:
    """Make everything the report needs; what exists with the same configuration and parents is kept."""
    with blamed(request.config["simulator"]["name"]):
        run_jobs(plan(request, seeds), launcher, told)


@dataclass(frozen=True)
class Point:
    """One combination. swept: the settings that vary, key to value as written; request: all of them, resolved."""

    swept: Mapping[str, str]
    request: Request

    @property
    def name(self) -> str:
        """`gp.n_train=100 seed=3`."""
        return " ".join(f"{key}={value}" for key, value in self.swept.items()) or "as configured"


Row = tuple[Point, Artifact | None, str | None]
"""A point, what was made of it, and why nothing was."""


@dataclass(frozen=True)
class Grid:
    """A sweep's jobs, each once however many points rest on it, and which of them is each point's own."""

    of: str
    points: tuple[Point, ...]
    jobs: tuple[Job, ...]
    targets: tuple[str, ...]


def grid_of(points: Sequence[Point], of: str = "evaluate") -> Grid:
    """The jobs that make stage `of` for every point, with all that it rests on; raises UsageError."""
    choice(of, tuple(STAGES), "sweep --of")
    labels: dict[str, str] = {}
    jobs: list[Job] = []
    targets: list[str] = []
    with listed_once():
        for point in points:
            ids: dict[str, str] = {}
            for job in _behind(point.request, of):
                ids[job.label] = name = _identity(job, ids)
                if name not in labels:
                    labels[name] = f"{job.label.split(' · ')[0]} · {point.name}"
                    after = tuple(labels[ids[label]] for label in job.after if label in ids)
                    jobs.append(replace(job, label=labels[name], after=after))
            targets.append(labels[name])
    return Grid(of, tuple(points), tuple(jobs), tuple(targets))


def run_grid(grid: Grid, launcher: Launcher, told: Told) -> tuple[Artifact, int]:
    """Make all of it, then the table and the page; that artifact, and how many points are missing in it.

    A point that fails stops no other. Raises UsageError where none is made.
    """
    made, errors = run_jobs(grid.jobs, launcher, told, keep_going=True)
    if not any(label in made for label in grid.targets):
        raise UsageError(f"sweep: no point could be made; the first: {next(iter(errors.values()))}")
    points = zip(grid.points, grid.targets, strict=True)
    rows = [(point, made.get(label), errors.get(label)) for point, label in points]
    stage = stage_about(SWEEP, _recipe, _write, grid.of, rows, format=FORMAT)
    artifact, _ = stage.make(replace(grid.points[0].request, out=None))
    return artifact, sum(found is None for _, found, _ in rows)


def _behind(request: Request, of: str) -> list[Job]:
    """The jobs of the loop on which a stage rests, in their order, that of the stage itself last."""
    jobs = plan(request, (request.seed,))
    by_label = {job.label: job for job in jobs}
    if of in TRAININGS:  # the one that the settings describe: the loop's own are of all variants
        behind = tuple(job.label for job in jobs if job.stage in ("fit-gp", "diagnose"))
        target = Job(f"{of} · own", of, request, behind if of == "train-gp-policy" else ())
        by_label[target.label] = target
    else:
        found = [job for job in jobs if job.stage == of]
        if not found:
            raise UsageError(f"sweep --of {of}: the loop has no such stage with these settings")
        target = found[-1]
    wanted, ahead = set[str](), [target.label]
    while ahead:
        label = ahead.pop()
        if label not in wanted:
            wanted.add(label)
            ahead += by_label[label].after
    return [*(job for label, job in by_label.items() if label in wanted - {target.label}), target]


def _identity(job: Job, ids: Mapping[str, str]) -> str:
    """Equal for jobs that make the same artifact.

    That is the same recipe, with its parents' identities in the place of parents that are not made yet.
    """
    request, store = replace(job.request, planned=True), job.request.store
    try:
        own = job.maker.keyed(request).key
    except UsageError:  # its recipe reads a file of a parent: alike is what has the same settings
        keys = DECIDING.get(job.stage) or [key for key in job.request.config if key != "launcher"]
        own = hashlib.sha256(canonical({key: job.request.config[key] for key in keys})).hexdigest()
    behind = sorted(ids[label] for label in job.after if label in ids)
    where = [str(store.root), store.experiment, job.stage]
    return hashlib.sha256(canonical([*where, own, *behind])).hexdigest()


def _recipe(request: Request, of: str, rows: Sequence[Row]) -> Recipe:
    """What was found is known by its digests. It is no parent: a table of ten thousand would hold as many open."""
    points = [
        {"settings": dict(point.swept), "made": found.digest if found else None, "error": error}
        for point, found, error in rows
    ]
    seeds = sorted({point.request.seed for point, _, _ in rows})
    return Recipe(SWEEP, {"of": of, "points": points}, {}, {"seeds": seeds})


def _write(request: Request, folder: Path, of: str, rows: Sequence[Row]) -> Json:
    table = table_of(rows)
    table.to_csv(folder / CSV, index=False, lineterminator="\n")
    table.to_parquet(folder / PARQUET, index=False)
    page = sweep_page(of, list(rows[0][0].swept), table)
    (folder / PAGE).write_text(page, encoding="utf-8")
    return {"points": [None if found is None else str(found.path) for _, found, _ in rows]}


def table_of(rows: Sequence[Row]) -> pd.DataFrame:
    """A row a point: the settings that vary, all figures of what was made, its version, and why there is none."""
    found = []
    for point, artifact, error in rows:
        facts: dict[str, Any] = {key: _typed(value) for key, value in point.swept.items()}
        facts |= {} if artifact is None else figures_of(artifact.path)
        facts |= {"sha256": None if artifact is None else artifact.digest, "error": error}
        found.append(facts)
    table = pd.DataFrame(found)
    for name in table.columns:  # one type a column, as parquet wants
        kinds = {type(value) for value in table[name].dropna()}
        if len(kinds) > 1 and not kinds <= {int, float, bool}:
            table[name] = table[name].map(lambda value: None if value is None else str(value))
    last = ["sha256", "error"]
    return table[[name for name in table.columns if name not in last] + last]


def _typed(value: str) -> int | float | str:
    for kind in (int, float):
        try:
            return kind(value)
        except ValueError:
            continue
    return value
