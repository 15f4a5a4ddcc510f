"""Independent stages side by side, wherever the launcher runs them; what is finished stays so, whatever happens."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Protocol, TypeVar

from gpsim.artifacts import Artifact, listed_once
from gpsim.errors import UsageError
from gpsim.launchers import Launcher, Progress, Task, run_tasks
from gpsim.stages.stage import Request, Stage, check_same_code, code_here, silent

Result = TypeVar("Result")


class Told(Protocol):
    """Who hears of jobs."""

    def update(self, job: str, done: int, total: int, note: str) -> None:
        """How far one is."""

    def made(self, job: str, artifact: Artifact, existed: bool) -> None:
        """What one made, or found."""

    def failed(self, job: str, why: str) -> None:
        """Why one made nothing, where the others go on."""


@dataclass(frozen=True)
class Job:
    """One artifact to make: a stage's name and its request, after the jobs labelled `after`.

    made_by: makes the stage where it is none of the loop's; it travels, so it is a function of a module or a `partial`
    of one with plain arguments.
    """

    label: str
    stage: str
    request: Request
    after: tuple[str, ...] = ()
    made_by: Callable[[], Stage] | None = None

    @property
    def maker(self) -> Stage:
        """The stage itself."""
        if self.made_by is not None:
            return self.made_by()
        from gpsim.stages.registry import STAGES  # who diagnoses need not wait for what trains

        return STAGES[self.stage]


def run_jobs(
    jobs: Sequence[Job], launcher: Launcher, told: Told, *, keep_going: bool = False
) -> tuple[dict[str, Artifact], dict[str, str]]:
    """Run every job as soon as what it waits for is done: what was made or found by its label, and why others failed.

    The first failure stops the rest and is raised; with `keep_going` what does not wait for it goes on. Existing
    artifacts are found, not made again. Version numbers follow the order of `jobs`, not of completion, so that the same
    configuration gives the same folders.
    """
    made: dict[str, Artifact] = {}
    errors: dict[str, str] = {}
    tasks: list[Task] = []
    with listed_once():
        for job, request, existing in list(numbered(jobs)):
            if existing is not None:
                made[job.label] = existing
            else:
                work = partial(_work, replace(job, request=request), code_here())
                tasks.append(Task(job.label, work, job.after))
    for label, artifact in made.items():
        told.made(label, artifact, True)
    for outcome in run_tasks(launcher, tasks, told.update, keep_going=keep_going):
        if outcome.error is not None:
            errors[outcome.label] = _in_a_line(outcome.error)
            told.failed(outcome.label, errors[outcome.label])
        else:
            made[outcome.label], existed = outcome.result
            told.made(outcome.label, made[outcome.label], existed)
    return made, errors


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


def _work(job: Job, code: str, progress: Progress) -> tuple[Artifact, bool]:
    check_same_code(code)
    return job.maker.make(replace(job.request, progress=progress))


def _in_a_line(error: Exception) -> str:
    if isinstance(error, UsageError):
        return str(error)
    lines = str(error).strip().splitlines()
    ends = dict.fromkeys((lines[0].rstrip(":"), lines[-1]) if lines else ())
    return ": ".join([type(error).__name__, *ends])


def run_trials(
    work: Callable[[int], Result], numbers: Sequence[int], launcher: Launcher, progress: Progress
) -> Iterator[tuple[int, Result]]:
    """(number, work(number)) as they finish; `work` must be picklable and keep what it finishes."""
    by_label = {f"trial {number}": number for number in numbers}
    tasks = [Task(label, partial(_run, work, number, code_here())) for label, number in by_label.items()]
    # Trials tell nothing of themselves before they end.
    for done, outcome in enumerate(run_tasks(launcher, tasks, lambda *_: None), 1):
        yield by_label[outcome.label], outcome.result
        where = f" on {outcome.node}" if outcome.node else ""
        progress(done, len(numbers), f"{outcome.label}{where}")


def _run(work: Callable[[int], Result], number: int, code: str, progress: Progress) -> Result:
    check_same_code(code)
    return work(number)
