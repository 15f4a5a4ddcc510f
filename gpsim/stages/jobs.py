"""Independent stages side by side, wherever the launcher runs them; what is finished stays so, whatever happens."""

from __future__ import annotations

import shutil
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any, TypeVar

from gpsim.artifacts import Artifact, listed_once
from gpsim.errors import UsageError
from gpsim.files import file_digest, written_whole
from gpsim.launchers import Launcher, Progress, Task, Update, run_tasks
from gpsim.simulators import source_file
from gpsim.stages.diagnose import Task as Recorded
from gpsim.stages.diagnose import stage_for
from gpsim.stages.stage import Request, Stage, check_same_code, code_here, silent

Finished = Callable[[str, Artifact, bool], None]
"""finished(job, artifact, existed)"""
Failed = Callable[[str, str], None]
"""failed(job, why)"""
Result = TypeVar("Result")


@dataclass(frozen=True)
class Job:
    """One artifact to make: a stage's name and its request, after the jobs labelled `after`.

    recorded: for a stage `diagnose`, the recording of the user's that it is about instead of the loop's own.
    """

    label: str
    stage: str
    request: Request
    after: tuple[str, ...] = ()
    recorded: Recorded | None = None

    @property
    def maker(self) -> Stage:
        """The stage itself."""
        from gpsim.stages.registry import STAGES  # who diagnoses need not wait for what trains

        return STAGES[self.stage] if self.recorded is None else stage_for(self.recorded)

    def given(self) -> Iterator[Path]:
        """Files and folders of the user's that it reads, beside what other jobs make."""
        config = self.request.config
        if self.recorded is not None:
            named, simulator = [self.recorded.recording], self.recorded.simulator
        else:
            source, simulator = config["collect"]["source"], config["simulator"]["name"]
            sources = source if isinstance(source, list) else [source]
            named = [config["recording"], config["diagnosis"], *sources]
        for name in (*named, source_file(str(simulator)) if simulator else None):
            if name is not None:
                path = Path(str(name))
                whole = path.suffix == ".csv" and (path.parent / "recording.yaml").is_file()
                yield path.parent if whole else path


def run_jobs(
    jobs: Sequence[Job], launcher: Launcher, update: Update, finished: Finished, failed: Failed | None = None
) -> dict[str, Artifact]:
    """Run every job as soon as what it waits for is done; what was made or found, by its label.

    The first failure stops the rest and is raised; with `failed` it is told to that, and what does not wait for it goes
    on. Existing artifacts are found, not made again. Version numbers follow the order of `jobs`, not of completion, so
    that the same configuration gives the same folders.
    """
    made: dict[str, Artifact] = {}
    behind = {job.label: job.after for job in jobs}
    tasks: list[Task] = []
    with listed_once():
        for job, request, existing in list(numbered(jobs)):
            if existing is not None:
                made[job.label] = existing
            else:
                tasks.append(_task(replace(job, request=request), behind, made))
    for label, artifact in made.items():
        finished(label, artifact, True)
    for outcome in run_tasks(launcher, tasks, update, keep_going=failed is not None):
        if outcome.error is not None and failed is not None:
            failed(outcome.label, _in_a_line(outcome.error))
            continue
        made[outcome.label], existed = outcome.result
        finished(outcome.label, made[outcome.label], existed)
    return made


def gathered(
    jobs: Sequence[Job], launcher: Launcher, update: Update, finished: Finished, failed: Failed
) -> tuple[dict[str, Artifact], dict[str, str]]:
    """Run jobs of which one that fails stops no other: what was made by its label, and why the rest was not."""
    errors: dict[str, str] = {}

    def wrong(label: str, why: str) -> None:
        errors[label] = why
        failed(label, why)

    return run_jobs(jobs, launcher, update, finished, wrong), errors


def numbered(jobs: Sequence[Job]) -> Iterator[tuple[Job, Request, Artifact | None]]:
    """Every job that is still to be made asks for a version of its own, in the order of the plan.

    Who makes it need not look through the shelf again: ten thousand workers' looks are more than a file server takes.
    """
    shelves = {(job.request.store, job.stage) for job in jobs}
    marked = {(store, stage): store.all_marked(stage) for store, stage in shelves}
    free = {(store, stage): store.free_numbers(stage) for store, stage in shelves}
    for job in jobs:
        request, shelf = replace(job.request, progress=silent), (job.request.store, job.stage)
        looked = marked[shelf]
        try:
            existing = request.store.find(job.maker.keyed(request)) if request.out is None else None
            looked = True
        except UsageError:  # a parent is not there yet, so neither is this
            existing = None
        if existing is None:
            request = replace(request, number=next(free[shelf]), looked=looked)
        yield job, request, existing


def _task(job: Job, behind: dict[str, tuple[str, ...]], made: dict[str, Artifact]) -> Task:
    """What runs elsewhere: the job with its request, whose settings and words are plain values."""

    def needs() -> Iterable[Path]:
        """Folders of all artifacts that the job rests on, however far back: a stage finds each by its recipe."""
        found: dict[str, Path] = {}
        ahead = list(job.after)
        while ahead:
            label = ahead.pop()
            if label not in found and label in made:
                found[label] = made[label].path
                ahead += behind.get(label, ())
        return [*found.values(), *job.given()]

    def keep(folder: Path, result: tuple[Artifact, bool]) -> tuple[Artifact, bool]:
        """Take in an artifact that was made where no file system is shared."""
        artifact, existed = result
        return job.request.store.adopt(folder / artifact.path, artifact, job.request.number), existed

    root = Path(str(job.request.config["runs_dir"]))
    return Task(job.label, partial(_work, job, code_here()), job.after, needs, (root,), keep)


def _work(job: Job, code: str, progress: Progress) -> tuple[Artifact, bool]:
    check_same_code(code)
    return job.maker.make(replace(job.request, progress=progress))


def _in_a_line(error: Exception) -> str:
    if isinstance(error, UsageError):
        return str(error)
    lines = str(error).strip().splitlines()
    ends = dict.fromkeys((lines[0].rstrip(":"), lines[-1]) if lines else ())
    return ": ".join([type(error).__name__, *ends])


@dataclass(frozen=True)
class Carried:
    """What travels where no file system is shared: all trials write below `out`; needs(number): what one reads."""

    out: Path
    needs: Callable[[int], Iterable[Path]] = lambda number: ()


def run_trials(
    work: Callable[[int], Result],
    numbers: Sequence[int],
    launcher: Launcher,
    progress: Progress,
    carried: Carried | None = None,
) -> Iterator[tuple[int, Result]]:
    """(number, work(number)) as they finish; `work` must be picklable and keep what it finishes."""
    by_label = {f"trial {number}": number for number in numbers}
    tasks = [Task(label, partial(_run, work, number, code_here())) for label, number in by_label.items()]
    if carried is not None:
        out, needs = carried.out, carried.needs
        tasks = [
            replace(task, needs=partial(needs, number), writes=(out,), keep=partial(_settled, out))
            for task, number in zip(tasks, numbers, strict=True)
        ]

    def update(label: str, at: int, total: int, note: str) -> None:
        """Trials tell nothing of themselves before they end."""

    for done, outcome in enumerate(run_tasks(launcher, tasks, update), 1):
        yield by_label[outcome.label], outcome.result
        where = f" on {outcome.node}" if outcome.node else ""
        progress(done, len(numbers), f"{outcome.label}{where}")


def _run(work: Callable[[int], Result], number: int, code: str, progress: Progress) -> Result:
    check_same_code(code)
    return work(number)


def _settled(out: Path, arrived: Path, result: Any) -> Any:
    """Put what came back below `arrived`/OUT in its place, OUT/KIND/NAME, each such file or folder whole."""
    for unit in sorted((arrived / out).glob("*/*")):
        target = out / unit.relative_to(arrived / out)
        if unit.is_file() and target.is_file() and file_digest(unit) == file_digest(target):
            continue
        target.parent.mkdir(parents=True, exist_ok=True)
        with written_whole(target) as made:
            if unit.is_dir():
                shutil.copytree(unit, made)
                shutil.rmtree(target, ignore_errors=True)
            else:
                shutil.copyfile(unit, made)
    return result
