"""Independent stages side by side, wherever the launcher runs them; what is finished stays so, whatever happens."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any, TypeVar

from gpsim.artifacts import Artifact, listed_once
from gpsim.errors import UsageError
from gpsim.launchers import Launcher, Progress, Task, Update, run_tasks, settle
from gpsim.stages.diagnose import Task as Recorded
from gpsim.stages.diagnose import stage_for
from gpsim.stages.stage import Request, Stage, check_same_code, code_here, silent

Finished = Callable[[str, Artifact, bool], None]
"""finished(job, artifact, existed)"""
Failed = Callable[[str, str], None]
"""failed(job, why)"""


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
        from gpsim.stages.registry import STAGES  # the registry holds this module's callers

        return STAGES[self.stage] if self.recorded is None else stage_for(self.recorded)


def run_jobs(
    jobs: Sequence[Job], launcher: Launcher, update: Update, finished: Finished, failed: Failed | None = None
) -> None:
    """Run every job as soon as what it waits for is done.

    The first failure stops the rest and is raised; with `failed` it is told to that, and what does not wait for it goes
    on. Existing artifacts are found, not made again. Version numbers follow the order of `jobs`, not of completion, so
    that the same configuration gives the same folders.
    """
    made: dict[str, Artifact] = {}
    tasks: list[Task] = []
    behind: dict[str, tuple[str, ...]] = {}
    with listed_once():
        numbered = list(_numbered(jobs))
    for job, (request, existing) in zip(jobs, numbered, strict=True):
        behind[job.label] = job.after
        if existing is not None:
            made[job.label] = existing
        else:
            tasks.append(_task(replace(job, request=request), partial(_ancestors, job.after, behind, made)))
    for label, artifact in made.items():
        finished(label, artifact, True)
    for outcome in run_tasks(launcher, tasks, update, keep_going=failed is not None):
        if outcome.error is not None and failed is not None:
            failed(outcome.label, _in_a_line(outcome.error))
            continue
        artifact, existed = outcome.result
        made[outcome.label] = artifact
        finished(outcome.label, artifact, existed)


def gathered(
    jobs: Sequence[Job], launcher: Launcher, update: Update, finished: Finished, failed: Failed
) -> tuple[dict[str, Artifact], dict[str, str]]:
    """Run jobs of which one that fails stops no other: what was made by its label, and why the rest was not."""
    made: dict[str, Artifact] = {}
    errors: dict[str, str] = {}

    def note(label: str, artifact: Artifact, existed: bool) -> None:
        made[label] = artifact
        finished(label, artifact, existed)

    def wrong(label: str, why: str) -> None:
        errors[label] = why
        failed(label, why)

    run_jobs(jobs, launcher, update, note, wrong)
    return made, errors


def _numbered(jobs: Sequence[Job]) -> Iterator[tuple[Request, Artifact | None]]:
    """Every job that is still to be made asks for a version of its own, in the order of the plan.

    Who makes it need not look through the shelf again: ten thousand workers' looks are more than a file server takes.
    """
    marked = {(job.request.store, job.stage): job.request.store.all_marked(job.stage) for job in jobs}
    free = {(job.request.store, job.stage): job.request.store.free_numbers(job.stage) for job in jobs}
    for job in jobs:
        request = replace(job.request, progress=silent)
        looked = marked[request.store, job.stage]
        try:
            existing = request.store.find(job.maker.keyed(request)) if request.out is None else None
            looked = True
        except UsageError:  # a parent is not there yet, so neither is this
            existing = None
        if existing is None:
            request = replace(request, number=next(free[request.store, job.stage]), looked=looked)
        yield request, existing


def _task(job: Job, ancestors: Callable[[], list[Path]]) -> Task:
    """What runs elsewhere: the job with its request, whose settings and words are plain values."""
    root = Path(str(job.request.config["runs_dir"]))
    return Task(
        job.label,
        partial(_work, job, code_here()),
        job.after,
        needs=lambda: [*ancestors(), *_given(job)],
        writes=(root,),
        keep=partial(_keep, job),
    )


def _work(job: Job, code: str, progress: Progress) -> tuple[Artifact, bool]:
    check_same_code(code)
    return job.maker.make(replace(job.request, progress=progress))


def _keep(job: Job, folder: Path, result: tuple[Artifact, bool]) -> tuple[Artifact, bool]:
    """Take in an artifact that was made where no file system is shared."""
    artifact, existed = result
    return job.request.store.adopt(folder / artifact.path, artifact, job.request.number), existed


def _ancestors(
    after: tuple[str, ...], behind: dict[str, tuple[str, ...]], made: dict[str, Artifact]
) -> list[Path]:
    """Folders of all artifacts that a job rests on, however far back: a stage finds each by its recipe."""
    found: dict[str, Path] = {}
    ahead = list(after)
    while ahead:
        label = ahead.pop()
        if label not in found and label in made:
            found[label] = made[label].path
            ahead += behind.get(label, ())
    return list(found.values())


def _given(job: Job) -> Iterator[Path]:
    """Files and folders of the user's that a job reads, beside what other jobs make."""
    from gpsim.simulators import source_file

    config = job.request.config
    source = config["collect"]["source"]
    named = [config["recording"], config["diagnosis"], *(source if isinstance(source, list) else [source])]
    if job.recorded is not None:
        named = [job.recorded.recording]
    simulator = config["simulator"]["name"] if job.recorded is None else job.recorded.simulator
    named += [source_file(str(simulator))] if simulator else []
    for name in named:
        if name is not None:
            path = Path(str(name))
            yield (
                path.parent if path.suffix == ".csv" and (path.parent / "recording.yaml").is_file() else path
            )


def _in_a_line(error: Exception) -> str:
    if isinstance(error, UsageError):
        return str(error)
    lines = str(error).strip().splitlines()
    ends = dict.fromkeys((lines[0].rstrip(":"), lines[-1]) if lines else ())
    return ": ".join([type(error).__name__, *ends])


Result = TypeVar("Result")


def _nothing(number: int) -> Iterable[Path]:
    return ()


@dataclass(frozen=True)
class Carried:
    """What travels where no file system is shared: all trials write below `out`; needs(number): what one reads."""

    out: Path
    needs: Callable[[int], Iterable[Path]] = _nothing


def run_trials(
    work: Callable[[int], Result],
    numbers: Sequence[int],
    launcher: Launcher,
    progress: Progress,
    carried: Carried | None = None,
) -> Iterator[tuple[int, Result]]:
    """(number, work(number)) as they finish; `work` must be picklable and keep what it finishes."""
    by_label = {f"trial {number}": number for number in numbers}
    tasks = [_trial_task(label, work, number, carried) for label, number in by_label.items()]

    def update(label: str, at: int, total: int, note: str) -> None:
        """Trials tell nothing of themselves before they end."""

    for done, outcome in enumerate(run_tasks(launcher, tasks, update), 1):
        yield by_label[outcome.label], outcome.result
        where = f" on {outcome.node}" if outcome.node else ""
        progress(done, len(numbers), f"{outcome.label}{where}")


def _trial_task(label: str, work: Callable[[int], Any], number: int, carried: Carried | None) -> Task:
    whole = partial(_run, work, number, code_here())
    if carried is None:
        return Task(label, whole)
    return Task(
        label,
        whole,
        needs=partial(carried.needs, number),
        writes=(carried.out,),
        keep=partial(_keep_trial, carried.out),
    )


def _run(work: Callable[[int], Result], number: int, code: str, progress: Progress) -> Result:
    check_same_code(code)
    return work(number)


def _keep_trial(out: Path, folder: Path, result: Result) -> Result:
    settle(folder, out)
    return result
