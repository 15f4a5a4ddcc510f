"""What an executor is given, what it gives back, and what it is."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

from gpsim.errors import UsageError

Progress = Callable[[int, int, str], None]
"""progress(done, total, note) of one task"""
Update = Callable[[str, int, int, str], None]
"""update(label, done, total, note) of any task"""


def _nothing() -> Iterable[Path]:
    return ()


def _as_it_is(folder: Path, result: Any) -> Any:
    return result


@dataclass(frozen=True)
class Task:
    """One independent piece of work, after the tasks labelled `after`.

    work(progress) runs elsewhere, so it is a module's function or a `partial` of one with plain arguments. It keeps
    what it finishes, and finds what is finished: a task whose worker is lost runs again.

    The rest counts only where files travel: needs() are the files and folders that it reads, asked for when it is
    handed out; writes: the folders below which it writes; keep(folder, result) puts what came back in `folder` in its
    place, and gives the result as it is known here. All paths are relative to the folder of the command.
    """

    label: str
    work: Callable[[Progress], Any]
    after: tuple[str, ...] = ()
    needs: Callable[[], Iterable[Path]] = _nothing
    writes: tuple[Path, ...] = ()
    keep: Callable[[Path, Any], Any] = _as_it_is


@dataclass(frozen=True)
class Outcome:
    """How a task ended: its result, or its error; node: the machine, empty where it is this one."""

    label: str
    result: Any = None
    error: Exception | None = None
    node: str = ""


class Executor(Protocol):
    """Runs tasks somewhere."""

    def free(self) -> int:
        """How many more tasks it takes now."""

    def start(self, task: Task) -> None:
        """Run a task; it does not wait."""

    def ended(self, update: Update) -> list[Outcome]:
        """Those that ended since the last time; it waits a moment for one, and passes on what running tasks tell."""

    def expect(self, unfinished: int) -> None:
        """So many tasks are not finished yet, whether they can begin or not."""


class JobFailedError(RuntimeError):
    """A mistake of the program, on another machine: its traceback is the message."""


class LostSchedulerError(UsageError):
    """The Dask scheduler is gone in the middle of the work."""
