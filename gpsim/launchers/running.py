"""Every task as soon as what it waits for is done, in the order of the plan, on whichever executor."""

from __future__ import annotations

import queue
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import Executor, Future
from contextlib import suppress
from dataclasses import dataclass
from graphlib import TopologicalSorter
from heapq import heappop, heappush
from pathlib import Path
from typing import Any, Protocol

from gpsim.errors import UsageError

MOMENT = 0.2  # s that one look for what has ended waits
Progress = Callable[[int, int, str], None]
"""progress(done, total, note) of one task"""
Update = Callable[[str, int, int, str], None]
"""update(label, done, total, note) of any task"""


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
    needs: Callable[[], Iterable[Path]] = tuple
    writes: tuple[Path, ...] = ()
    keep: Callable[[Path, Any], Any] = lambda folder, result: result


@dataclass(frozen=True)
class Outcome:
    """How a task ended: its result, or its error; node: the machine, empty where it is this one."""

    label: str
    result: Any = None
    error: Exception | None = None
    node: str = ""


class Place(Protocol):
    """Where tasks run: an executor, and what is particular about it."""

    @property
    def executor(self) -> Executor:
        """What runs them."""

    def room(self) -> int:
        """How many tasks may be handed out at a time, as things stand."""

    def sent(self, task: Task) -> Callable[[], Any]:
        """What the executor runs for a task."""

    def outcome(self, task: Task, done: Future[Any]) -> Outcome:
        """How it ended."""

    def look(self, unfinished: int) -> None:
        """Called every moment: pass on what running tasks tell; raises where nothing can go on."""


class JobFailedError(RuntimeError):
    """A mistake of the program, on another machine: its traceback is the message."""


class LostSchedulerError(UsageError):
    """The Dask scheduler is gone in the middle of the work."""


def run_in(place: Place, tasks: Sequence[Task], keep_going: bool) -> Iterator[Outcome]:
    """How each task ended, as they end.

    The first failure stops the rest and is raised; with `keep_going` it is an outcome like others, and those that wait
    for it fail with it.
    """
    rank = {task.label: i for i, task in enumerate(tasks)}
    order = TopologicalSorter({task.label: [a for a in task.after if a in rank] for task in tasks})
    order.prepare()
    ready: list[int] = []
    running: dict[Future[Any], Task] = {}
    ended: queue.SimpleQueue[Future[Any]] = queue.SimpleQueue()
    failed: list[str] = []
    unfinished = len(tasks)
    while order.is_active():
        for label in order.get_ready():
            cause = next((before for before in failed if before in tasks[rank[label]].after), None)
            if cause is None:
                heappush(ready, rank[label])
                continue
            failed.append(label)
            unfinished -= 1
            order.done(label)
            yield Outcome(label, error=UsageError(f"not made, as {cause} failed"))
        while ready and len(running) < place.room():
            task = tasks[heappop(ready)]
            future = place.executor.submit(place.sent(task))
            running[future] = task
            future.add_done_callback(ended.put)
        done = list(_waited_for(ended)) if running else []
        place.look(unfinished)
        outcomes = [place.outcome(running.pop(future), future) for future in done]
        for outcome in outcomes:  # a failure comes first, and nothing is begun behind it
            if outcome.error is not None and not keep_going:
                raise outcome.error
        failed += [outcome.label for outcome in outcomes if outcome.error is not None]
        for outcome in outcomes:
            unfinished -= 1
            order.done(outcome.label)
            yield outcome


def _waited_for(ended: queue.SimpleQueue[Future[Any]]) -> Iterator[Future[Any]]:
    """All that have ended, after a moment if none has yet."""
    with suppress(queue.Empty):
        yield ended.get(timeout=MOMENT)
        while True:
            yield ended.get_nowait()
