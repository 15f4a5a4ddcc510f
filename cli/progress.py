"""Progress with time left: bars on a terminal, a line now and then in a log."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING

from rich.console import Console
from rich.progress import BarColumn, Progress, ProgressColumn, Task, TaskID, TextColumn, TimeElapsedColumn
from rich.text import Text

from gpsim.reports.sheets import literal, printable

from .answers import QUIET, warned

Shares = Sequence[tuple[float, float]]
"""(share of the steps that are done, share of the time that has usually gone by then), ascending, from 0 to 1."""
EVEN: Shares = ((0.0, 0.0), (1.0, 1.0))
DIAGNOSIS: Shares = (
    (0.0, 0.0), (0.05, 0.05), (0.2, 0.55), (0.4, 0.6), (0.55, 0.72), (0.9, 0.92), (0.98, 0.99), (1.0, 1.0),
)  # fmt: skip
"""Of a diagnosis with a built-in simulator, measured on data/cart.csv: half the time goes into the usual effects."""
MUJOCO: Shares = (
    (0.0, 0.0), (0.05, 0.01), (0.4, 0.05), (0.68, 0.27), (0.9, 0.47), (0.92, 0.72), (0.98, 0.99), (1.0, 1.0),
)  # fmt: skip
"""Of one with a MuJoCo model, measured on data/arm.csv: most goes into the search and into checking its result."""
OVERRUN = 0.5  # of the time that a step has taken so far, that it takes at least from now on
EARLIEST = 0.02  # of the time: before that nobody can tell how long the whole takes
BELOW_A_MINUTE = 5  # s, to which less than a minute is rounded


class Pace:
    """The time left of one job: as much as its steps usually take beside those that are done."""

    def __init__(self, shares: Shares, began: float) -> None:
        self._shares, self._began, self._reached, self.share = shares, began, began, 0.0

    def update(self, done: int, total: int, now: float) -> None:
        """`done` of `total` is done now; what was done is never taken back."""
        part = done / total if total else 0.0
        for (low, before), (high, after) in pairwise(self._shares):
            if (
                low <= part <= high
                and (share := before + (after - before) * (part - low) / (high - low)) > self.share
            ):
                self.share, self._reached = share, now

    def left(self, now: float) -> float | None:
        """Seconds; None where nobody can tell yet."""
        if self.share < EARLIEST:
            return None
        whole = (self._reached - self._began) / self.share
        return max(whole - (now - self._began), OVERRUN * (now - self._reached))


def clock(seconds: float) -> str:
    """`40 s`, `3 min`: no finer than a forecast is good for."""
    if seconds < 60.0 - BELOW_A_MINUTE / 2:
        return f"{BELOW_A_MINUTE * max(round(seconds / BELOW_A_MINUTE), 1)} s"
    return f"{max(round(seconds / 60.0), 1)} min"


if TYPE_CHECKING:
    from gpsim.artifacts import Artifact

Report = Callable[[int, int, str], None]
SECONDS_BETWEEN_LINES = 20.0
INTERRUPTED = "interrupted: finished artifacts are complete; run the same command to continue"
LONGEST = 60  # letters of what a bar says beside it


def shown(text: str) -> str:
    """A bar has one line: its text without control characters, and no longer than that."""
    line = " ".join(printable(text).split())
    return line if len(line) <= LONGEST else f"{line[: LONGEST - 1]}…"


class LeftColumn(ProgressColumn):
    """The time left of a job, by its pace."""

    def render(self, task: Task) -> Text:
        """`0:42`; nothing where nobody can tell yet."""
        pace: Pace | None = task.fields.get("pace")
        left = None if pace is None else pace.left(time.monotonic())
        return Text("-:--:--" if left is None else clock(left), style="progress.remaining")


class Board:
    """One line a running job and, of several, one for all of them. shares: how far a job's time is at its steps."""

    def __init__(self, jobs: int = 0, shares: Shares = EVEN) -> None:
        self._shares = shares
        self._jobs, self._done, self._kept, self._began = jobs, 0, 0, time.monotonic()
        self._all: TaskID | None = None
        self._console = Console(stderr=True)
        self._quiet = QUIET.get()
        self._live = self._console.is_terminal and not self._quiet
        self._bars = Progress(
            TextColumn("{task.description:<34}", markup=False),
            BarColumn(bar_width=28),
            TextColumn("{task.percentage:>3.0f} %"),
            TimeElapsedColumn(),
            TextColumn("left"),
            LeftColumn(),
            TextColumn("{task.fields[note]}", style="dim", markup=False),
            console=self._console,
            transient=True,
        )
        self._tasks: dict[str, TaskID] = {}
        self._paces: dict[str, Pace] = {}
        self._spoken: dict[str, float] = {}
        self.finished: list[dict[str, object]] = []

    def __enter__(self) -> Board:
        if self._live:
            self._bars.start()
            if self._jobs:
                self._all = self._bars.add_task("all jobs", total=self._jobs, note="")
        return self

    def __exit__(self, *_: object) -> None:
        if self._live:
            self._bars.stop()

    def update(self, job: str, done: int, total: int, note: str) -> None:
        """Job `job` has done `done` of `total`; of no total: what it waits for, said at once."""
        if self._quiet:
            return
        if not total and not self._live:
            _say(f"  {job}: {note}")
            return
        now = time.monotonic()
        pace = self._paces.setdefault(job, Pace(self._shares, now))
        pace.update(done, total, now)
        if self._live:
            note = shown(note)
            if job not in self._tasks:
                self._tasks[job] = self._bars.add_task(
                    shown(job), total=1.0 if total else None, note=note, pace=pace
                )
            self._bars.update(self._tasks[job], completed=pace.share, total=1.0 if total else None, note=note)
            return
        if now - self._spoken.setdefault(job, now) >= SECONDS_BETWEEN_LINES and done < total:
            self._spoken[job] = now
            left = pace.left(now)
            _say(
                f"  {job}: {100 * pace.share:.0f} %, {'' if left is None else f'about {clock(left)} left, '}{note}"
            )

    def finish(self, job: str, line: str | Text, kept: bool = False) -> None:
        """Job `job` is done: say so, letter by letter, and drop its bar. kept: it was there already."""
        said = literal(line) if isinstance(line, str) else line
        if job in self._tasks:
            self._bars.remove_task(self._tasks.pop(job))
        self._done, self._kept = self._done + 1, self._kept + kept
        if self._all is not None:
            self._bars.update(self._all, completed=self._done, note=self.overall())
        elif self._jobs:
            said = said + Text(f" ({self.overall()})", "dim")
        if self._quiet:
            return
        with suppress(OSError):
            (self._bars.console if self._live else self._console).print(said, highlight=False, soft_wrap=True)

    def made(self, job: str, artifact: Artifact, existed: bool) -> None:
        """Job `job` has this artifact."""
        mark = Text("kept", "dim") if existed else Text("made", "green")
        self.finish(job, mark + literal(f" {job:<34} {artifact.path}"), existed)
        warn(artifact.path)
        self.keep(job, artifact, existed)

    def keep(self, job: str, artifact: Artifact, existed: bool) -> None:
        """For the answer."""
        self.finished.append({"job": job, "folder": str(artifact.path.absolute()), "made": not existed})

    def failed(self, job: str, why: str) -> None:
        """Job `job` ended without one."""
        self.finish(job, Text("failed", "red") + literal(f" {job:<34} {why}"))
        warned(f"{job}: {why}")

    def overall(self) -> str:
        """How many jobs are done and, once one was made, about how long the rest takes at that pace."""
        said, made, left = (
            f"{self._done} of {self._jobs} jobs",
            self._done - self._kept,
            self._jobs - self._done,
        )
        if not made or not left:
            return said
        minutes = (time.monotonic() - self._began) / made * left / 60.0
        return f"{said}, about {minutes:.0f} min left" if minutes >= 1.0 else f"{said}, under a minute left"


def note(line: str) -> None:
    """A line on stderr that nobody needs in order to read the result."""
    if not QUIET.get():
        _say(line)


def warn(folder: Path) -> None:
    """What went wrong beside the result when an artifact was made, a line each: also where `--quiet` was given."""
    from gpsim.artifacts import read_warnings  # it takes a moment that `--help` has no use for

    for line in read_warnings(folder):
        caution(line)


def caution(line: str) -> None:
    """A line on stderr that a reader of the result has to know: also where `--quiet` was given."""
    warned(printable(line))
    _say(f"warning: {line}")


def _say(line: str) -> None:
    """A log on a full disk is no reason to stop what is under way."""
    with suppress(OSError):
        print(printable(line), file=sys.stderr, flush=True)


def saying_once(report: Report, line: str) -> Report:
    """The same report; the line is said when something is done, to who watches: an error is one line in a log."""
    said = [] if sys.stderr.isatty() else [True]

    def told(done: int, total: int, text: str) -> None:
        if not said and done > 0:
            said.append(True)
            note(line)
        report(done, total, text)

    return told


@contextmanager
def single_progress(job: str, shares: Shares = EVEN) -> Iterator[Report]:
    """The progress of one job."""
    with Board(shares=shares) as board:
        yield lambda done, total, note: board.update(job, done, total, note)
