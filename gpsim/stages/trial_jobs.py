"""Independent trials side by side, one core each, wherever the launcher runs them.

A process that is killed ends the run with one line; the trials that were finished are kept, and the same command
carries on.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, TypeVar

from gpsim.launchers import Launcher, Task, run_tasks, settle
from gpsim.stages.code import check_same_code, code_here

Result = TypeVar("Result")
Progress = Callable[[int, int, str], None]


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
    tasks = [_task(label, work, number, carried) for label, number in by_label.items()]

    def update(label: str, at: int, total: int, note: str) -> None:
        """Trials tell nothing of themselves before they end."""

    for done, outcome in enumerate(run_tasks(launcher, tasks, update), 1):
        yield by_label[outcome.label], outcome.result
        where = f" on {outcome.node}" if outcome.node else ""
        progress(done, len(numbers), f"{outcome.label}{where}")


def _task(label: str, work: Callable[[int], Any], number: int, carried: Carried | None) -> Task:
    whole = partial(_run, work, number, code_here())
    if carried is None:
        return Task(label, whole)
    return Task(
        label,
        whole,
        needs=partial(carried.needs, number),
        writes=(carried.out,),
        keep=partial(_keep, carried.out),
    )


def _run(work: Callable[[int], Result], number: int, code: str, progress: Progress) -> Result:
    check_same_code(code)
    return work(number)


def _keep(out: Path, folder: Path, result: Result) -> Result:
    settle(folder, out)
    return result
