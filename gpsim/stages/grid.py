"""sweep: one stage for every combination of settings, side by side; a table of all figures and a page at the end."""

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
from gpsim.launchers import Launcher, Update
from gpsim.reports.sweep_page import sweep_page
from gpsim.runs import figures_of
from gpsim.settings import choice
from gpsim.stages import full_loop
from gpsim.stages.jobs import Failed, Finished, Job, gathered
from gpsim.stages.registry import STAGES
from gpsim.stages.stage import Request, stage_about

STAGE_NAME, FORMAT = "sweep", 1
CSV, PARQUET, PAGE = "sweep.csv", "sweep.parquet", "report.html"
TRAININGS = ("train-source", "train-gp-policy")


@dataclass(frozen=True)
class Point:
    """One combination. swept: the settings that vary, key to value as written; request: all of them, resolved."""

    swept: Mapping[str, str]
    request: Request

    @property
    def name(self) -> str:
        """`gp.n_train=100 seed=3`."""
        return " ".join(f"{key}={value}" for key, value in self.swept.items()) or "as configured"


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
    with listed_once():
        return _grid(points, of)


def _grid(points: Sequence[Point], of: str) -> Grid:
    labels: dict[str, str] = {}
    jobs: list[Job] = []
    targets: list[str] = []
    for point in points:
        plan, target = _plan(point.request, of)
        ids: dict[str, str] = {}
        for job in plan:
            ids[job.label] = name = _identity(job, ids)
            if name not in labels:
                labels[name] = f"{job.label.split(' · ')[0]} · {point.name}"
                after = tuple(labels[ids[label]] for label in job.after if label in ids)
                jobs.append(replace(job, label=labels[name], after=after))
        targets.append(labels[ids[target]])
    return Grid(of, tuple(points), tuple(jobs), tuple(targets))


def run(
    grid: Grid, launcher: Launcher, update: Update, finished: Finished, failed: Failed
) -> tuple[Artifact, int]:
    """Make all of it, then the table and the page; that artifact, and how many points are missing in it.

    A point that fails stops no other. Raises UsageError where none is made.
    """
    made, errors = gathered(grid.jobs, launcher, update, finished, failed)
    if not any(label in made for label in grid.targets):
        raise UsageError(f"sweep: no point could be made; the first: {next(iter(errors.values()))}")
    rows = [
        (p, made.get(label), errors.get(label)) for p, label in zip(grid.points, grid.targets, strict=True)
    ]
    stage = stage_about(STAGE_NAME, _recipe, _write, grid.of, rows, format=FORMAT)
    artifact, _ = stage.make(replace(grid.points[0].request, out=None))
    return artifact, sum(found is None for _, found, _ in rows)


Rows = Sequence[tuple[Point, Artifact | None, str | None]]


def _plan(request: Request, of: str) -> tuple[list[Job], str]:
    """The jobs of the loop on which a stage rests, in their order, that of the stage itself last."""
    plan = full_loop.plan(request, (request.seed,))
    by_label = {job.label: job for job in plan}
    if of in TRAININGS:  # the one that the settings describe: the loop's own are of all variants
        behind = tuple(job.label for job in plan if job.stage in ("fit-gp", "diagnose"))
        target = Job(f"{of} · own", of, request, behind if of == "train-gp-policy" else ())
        by_label[target.label] = target
    else:
        found = [job for job in plan if job.stage == of]
        if not found:
            raise UsageError(f"sweep --of {of}: the loop has no such stage with these settings")
        target = found[-1]
    wanted, ahead = {target.label}, [target.label]
    while ahead:
        for label in by_label[ahead.pop()].after:
            if label not in wanted:
                wanted.add(label)
                ahead.append(label)
    return [job for label, job in by_label.items() if label in wanted], target.label


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


DECIDING = {"diagnose": ("simulator", "diagnose", "residuals", "collect", "recording", "seed")}
"""Of a stage whose recipe reads a file of a parent, the settings that it reads beside that."""


def _recipe(request: Request, of: str, rows: Rows) -> Recipe:
    """What was found is known by its digests. It is no parent: a table of ten thousand would hold as many open."""
    points = [
        {"settings": dict(point.swept), "made": found.digest if found else None, "error": error}
        for point, found, error in rows
    ]
    seeds = sorted({point.request.seed for point, _, _ in rows})
    return Recipe(STAGE_NAME, {"of": of, "points": points}, {}, {"seeds": seeds})


def _write(request: Request, folder: Path, of: str, rows: Rows) -> Json:
    table = table_of(rows)
    table.to_csv(folder / CSV, index=False, lineterminator="\n")
    table.to_parquet(folder / PARQUET, index=False)
    swept = list(rows[0][0].swept)
    (folder / PAGE).write_text(sweep_page(of, swept, table), encoding="utf-8")
    return {"points": [None if found is None else str(found.path) for _, found, _ in rows]}


def table_of(rows: Rows) -> pd.DataFrame:
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
