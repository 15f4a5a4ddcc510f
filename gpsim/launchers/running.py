"""Which executor, as the settings `launcher.*` say; every task on it as soon as what it waits for is done."""

from __future__ import annotations

import importlib.util
import queue
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import BrokenExecutor, Executor, Future
from contextlib import suppress
from dataclasses import dataclass, field, replace
from graphlib import TopologicalSorter
from heapq import heappop, heappush
from typing import Any, Protocol

from gpsim.errors import UsageError
from gpsim.settings import build, choice

MOMENT = 0.2  # s that one look for what has ended waits
Progress = Callable[[int, int, str], None]
"""progress(done, total, note) of one task"""
Update = Callable[[str, int, int, str], None]
"""update(label, done, total, note) of any task"""
Announce = Callable[[str], None]
"""announce(line): of where it runs, as the dashboard's link"""


@dataclass(frozen=True)
class Local:
    """Processes of this machine; 0: this one, a task after the other."""

    processes: int


@dataclass(frozen=True)
class Dask:
    """A Dask scheduler.

    address: of one that runs, as tcp://HOST:8786; None: one is started here. workers: how many processes then; None: as
    many as `--jobs` says; dashboard: the address that its dashboard listens on. Its workers see this folder under the
    same path.
    """

    address: str | None = None
    workers: int | None = None
    dashboard: str = "127.0.0.1"
    announce: Announce = field(default=lambda line: None, compare=False)

    def __post_init__(self) -> None:
        if self.workers is not None and self.workers < 1:
            raise ValueError("workers: expected at least 1")


@dataclass(frozen=True)
class Slurm:
    """Workers as SLURM jobs: as many as there is work for, from `minimum` to `maximum`.

    conf/launcher/slurm.yaml says what each setting is.
    """

    queue: str | None
    account: str | None
    walltime: str
    memory: str
    cores: int
    setup: tuple[str, ...]
    directives: tuple[str, ...]
    skip: tuple[str, ...]
    minimum: int
    maximum: int
    interface: str | None
    python: str | None
    logs: str
    dashboard: str = "127.0.0.1"
    announce: Announce = field(default=lambda line: None, compare=False)

    def __post_init__(self) -> None:
        if self.cores < 1:
            raise ValueError("cores: expected at least 1")
        if not 0 <= self.minimum <= self.maximum or self.maximum < 1:
            raise ValueError("expected 0 <= minimum <= maximum, and a maximum of at least 1")


Launcher = Local | Dask | Slurm
NAMES = ("local", "dask", "slurm")


def launcher_from(section: Mapping[str, Any], processes: int, announce: Announce) -> Launcher:
    """The launcher that a configuration's `launcher` describes; raises UsageError.

    processes: of this machine, where it is that.
    """
    name = choice(section.get("name"), NAMES, "launcher.name")
    if name == "local":
        return build(Local, section, "launcher", processes=processes)
    needed = ("distributed", "dask_jobqueue", "cryptography")
    if missing := [package for package in needed if importlib.util.find_spec(package) is None]:
        raise UsageError(
            f"launcher={name} needs {' and '.join(missing)}; install with: pip install 'gpsim[cluster]'"
        )
    if name == "slurm":
        return build(Slurm, section, "launcher", announce=announce)
    found = build(Dask, section, "launcher", announce=announce)
    return found if found.workers is not None else replace(found, workers=max(processes, 1))


@dataclass(frozen=True)
class Task:
    """One independent piece of work, after the tasks labelled `after`.

    work(progress) runs elsewhere, so it is a module's function or a `partial` of one with plain arguments. It keeps
    what it finishes, and finds what is finished: a task whose worker is lost runs again.
    """

    label: str
    work: Callable[[Progress], Any]
    after: tuple[str, ...] = ()


@dataclass(frozen=True)
class Outcome:
    """How a task ended: its result, or its error; node: the machine, empty where it is this one."""

    label: str
    result: Any = None
    error: Exception | None = None
    node: str = ""


class Messages(Protocol):
    """A queue of what running tasks tell: label, done, total, note."""

    def get_nowait(self) -> tuple[str, int, int, str]:
        """The next one; raises queue.Empty."""


class Place:
    """Where tasks run: an executor, and how many it is given at a time; others say what is particular about theirs."""

    def __init__(self, executor: Executor, count: int, update: Update, messages: Messages) -> None:
        self.executor, self.count, self.update, self.messages = executor, count, update, messages

    def room(self) -> int:
        """How many tasks may be handed out at a time, as things stand."""
        return self.count

    def sent(self, task: Task) -> Callable[[], Any]:
        """What the executor runs for a task."""
        raise NotImplementedError

    def result(self, task: Task, done: Future[Any]) -> tuple[Any, str]:
        """What the task gave, and the machine, empty where it is this one; raises what it failed of."""
        return done.result(), ""

    def look(self, unfinished: int) -> None:
        """Called every moment: pass on what running tasks tell; raises where nothing can go on."""
        with suppress(queue.Empty):
            while True:
                self.update(*self.messages.get_nowait())


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
        outcomes = [_outcome(place, running.pop(future), future) for future in done]
        for outcome in outcomes:  # a failure comes first, and nothing is begun behind it
            if outcome.error is not None:
                if not keep_going:
                    raise outcome.error
                failed.append(outcome.label)
        for outcome in outcomes:
            unfinished -= 1
            order.done(outcome.label)
            yield outcome


def _outcome(place: Place, task: Task, done: Future[Any]) -> Outcome:
    try:
        result, node = place.result(task, done)
    except BrokenExecutor:  # a process that died is no outcome: its pool says what became of it
        raise
    except Exception as error:  # whatever it is, it is this task's
        return Outcome(task.label, error=error)
    return Outcome(task.label, result, node=node)


def _waited_for(ended: queue.SimpleQueue[Future[Any]]) -> Iterator[Future[Any]]:
    """All that have ended, after a moment if none has yet."""
    with suppress(queue.Empty):
        yield ended.get(timeout=MOMENT)
        while True:
            yield ended.get_nowait()
