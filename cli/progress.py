"""Progress with time left: bars on a terminal, a line now and then in a log."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from rich.console import Console
from rich.progress import BarColumn, Progress, TaskID, TextColumn, TimeElapsedColumn, TimeRemainingColumn

Report = Callable[[int, int, str], None]
SECONDS_BETWEEN_LINES = 20.0


class Board:
    """One line a running job."""

    def __init__(self) -> None:
        self._console = Console(stderr=True)
        self._live = self._console.is_terminal
        self._bars = Progress(
            TextColumn("{task.description:<34}"),
            BarColumn(bar_width=28),
            TextColumn("{task.percentage:>3.0f} %"),
            TimeElapsedColumn(),
            TextColumn("left"),
            TimeRemainingColumn(),
            TextColumn("[dim]{task.fields[note]}"),
            console=self._console,
            transient=True,
        )
        self._tasks: dict[str, TaskID] = {}
        self._started: dict[str, float] = {}
        self._spoken: dict[str, float] = {}

    def __enter__(self) -> Board:
        if self._live:
            self._bars.start()
        return self

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        if self._live:
            self._bars.stop()
        if kind is not None and issubclass(kind, KeyboardInterrupt):  # Typer then ends with exit code 130
            print(
                "interrupted: finished artifacts are whole, run the same command to carry on", file=sys.stderr
            )

    def update(self, job: str, done: int, total: int, note: str) -> None:
        """Job `job` has done `done` of `total`."""
        now = time.monotonic()
        self._started.setdefault(job, now)
        if self._live:
            if job not in self._tasks:
                self._tasks[job] = self._bars.add_task(job, total=total, note=note)
            self._bars.update(self._tasks[job], completed=done, total=total, note=note)
            return
        if now - self._spoken.setdefault(job, now) >= SECONDS_BETWEEN_LINES and done < total:
            self._spoken[job] = now
            left = (now - self._started[job]) * (total - done) / max(done, 1)
            print(
                f"  {job}: {100 * done // max(total, 1)} %, {left:.0f} s left, {note}",
                file=sys.stderr,
                flush=True,
            )

    def finish(self, job: str, line: str) -> None:
        """Job `job` is done: say so and drop its bar."""
        if job in self._tasks:
            self._bars.remove_task(self._tasks.pop(job))
        (self._bars.console if self._live else self._console).print(line, highlight=False, soft_wrap=True)


@contextmanager
def single_progress(job: str) -> Iterator[Report]:
    """The progress of one job."""
    with Board() as board:
        yield lambda done, total, note: board.update(job, done, total, note)
