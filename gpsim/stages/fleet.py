"""diagnose --each: a fleet's recordings, each diagnosed by itself, and one page over all."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from functools import partial
from pathlib import Path

from gpsim.artifacts import Artifact, Recipe
from gpsim.errors import UsageError, near_path
from gpsim.files import Json, write_json
from gpsim.launchers import Launcher
from gpsim.recordings import is_bag_folder
from gpsim.reports.fleet import Deviation, Robot, deviations, fleet_page, headline
from gpsim.stages.diagnose import Task, read_diagnosis, stage_for
from gpsim.stages.jobs import Job, Told, run_jobs
from gpsim.stages.raw_logs import is_raw
from gpsim.stages.stage import Request, stage_about

STAGE_NAME, FORMAT = "fleet", 1
FACTS, PAGE, SCHEMA = "fleet.json", "report.html", "gpsim.fleet/1"


@dataclass(frozen=True)
class Fleet:
    """What was found: the artifact with the page, robots in the order of the recordings, and their diagnoses."""

    artifact: Artifact
    robots: tuple[Robot, ...]
    found: tuple[Deviation, ...]
    made: Mapping[str, Artifact]

    @property
    def said(self) -> str:
        """Which differ, in a sentence."""
        return headline(self.robots, self.found)

    @property
    def failed(self) -> int:
        """How many could not be diagnosed."""
        return sum(robot.diagnosis is None for robot in self.robots)


def recordings_in(paths: Sequence[Path], simulator: str | None) -> dict[str, Path]:
    """Name -> recording: each path, or of a folder that is none all recordings below it; raises UsageError.

    One folder without any holds a raw log a robot: its log files, and its folders of such. A recording is called as it
    lies below the folder that all have in common. With a simulator bare CSV files are recordings, too.
    """
    found: list[Path] = []
    for path in paths:
        if not path.exists():
            raise UsageError(f"{path}: no such recording or folder{near_path(path)}")
        below = _recordings_of(path, simulator, alone=len(paths) == 1)
        if not below:
            raise UsageError(f"{path}: no recordings in it (folders with a recording.yaml), and no logs")
        found += below
    whole = [Path(os.path.abspath(path)) for path in found]  # noqa: PTH100 - links keep their names
    twice = [path for i, path in enumerate(whole) if path in whole[:i]]
    if twice:
        raise UsageError(f"{twice[0]}: named twice")
    common = Path(os.path.commonpath([path.parent for path in whole]))
    return {path.relative_to(common).as_posix(): given for path, given in zip(whole, found, strict=True)}


def _recordings_of(path: Path, simulator: str | None, alone: bool) -> list[Path]:
    if not path.is_dir() or (path / "recording.yaml").is_file():
        return [path]
    homes = [found.parent for found in path.rglob("recording.yaml")]
    bare = path.rglob("*.csv") if simulator is not None else ()
    below = sorted([*homes, *(table for table in bare if table.parent not in homes)])
    if seen := [p for p in below if not any(part.startswith(".") for part in p.relative_to(path).parts)]:
        return seen
    if not is_raw(path, simulator):
        return []
    if not alone or is_bag_folder(path):
        return [path]
    return [p for p in sorted(path.iterdir()) if not p.name.startswith(".") and is_raw(p, simulator)]


def run(request: Request, tasks: Mapping[str, Task | str], launcher: Launcher, told: Told) -> Fleet:
    """Diagnose each recording; one that fails stops no other. Raises UsageError where all do.

    tasks: what each is about, or why it cannot be read.
    """
    if request.out is not None and request.out.exists():
        raise UsageError(
            f"{request.out}: exists already; artifacts are never overwritten, choose another --out"
        )
    unread = {name: task for name, task in tasks.items() if isinstance(task, str)}
    for name, why in unread.items():
        told.failed(name, why)
    alone = replace(request, out=None)
    jobs = [
        Job(name, "diagnose", alone, made_by=partial(stage_for, task))
        for name, task in tasks.items()
        if isinstance(task, Task)
    ]
    made, errors = run_jobs(jobs, launcher, told, keep_going=True)
    errors = unread | errors
    if not made:
        raise UsageError(f"no recording could be diagnosed; the first: {next(iter(errors.values()))}")
    robots = tuple(
        Robot(name, read_diagnosis(made[name].path) if name in made else None, errors.get(name, ""))
        for name in tasks
    )
    found = tuple(deviations(robots))
    artifact, _ = stage_about(STAGE_NAME, _recipe, _write, robots, found, made, format=FORMAT).make(request)
    return Fleet(artifact, robots, found, made)


def _recipe(
    request: Request, robots: Sequence[Robot], found: Sequence[Deviation], made: Mapping[str, Artifact]
) -> Recipe:
    """The diagnoses by their digests, no parents: a fleet of thousands would hold as many folders open."""
    each = [
        {"name": r.name, "made": made[r.name].digest if r.name in made else None, "error": r.error or None}
        for r in robots
    ]
    return Recipe(STAGE_NAME, {"recordings": each}, {}, {"seed": request.seed})


def _write(
    request: Request,
    folder: Path,
    robots: Sequence[Robot],
    found: Sequence[Deviation],
    made: Mapping[str, Artifact],
) -> Json:
    content: Json = {
        "schema": SCHEMA,
        "said": headline(robots, found),
        "robots": [
            {
                "name": r.name,
                "verdict": r.diagnosis.verdict if r.diagnosis is not None else None,
                "diagnosis_sha256": made[r.name].digest if r.name in made else None,
                "error": r.error or None,
            }
            for r in robots
        ],
        "differences": [asdict(d) for d in found],
    }
    write_json(folder / FACTS, content)
    configs = [made[r.name].manifest["config"] if r.name in made else {} for r in robots]
    page = fleet_page(robots, [str(config.get("simulator") or "") for config in configs])
    (folder / PAGE).write_text(page, encoding="utf-8")
    return {"diagnoses": {name: str(artifact.path) for name, artifact in made.items()}}
