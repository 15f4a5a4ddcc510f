"""Every task as soon as what it waits for is done, in the order of the plan, on whichever executor.

Tasks in processes of this machine.
"""

from __future__ import annotations

import heapq
import multiprocessing
import os
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from multiprocessing.queues import Queue
from queue import Empty
from typing import Any

from gpsim.errors import UsageError
from gpsim.launchers.launcher import Launcher, opened
from gpsim.launchers.tasks import Executor, Outcome, Progress, Task, Update
from gpsim.workers import WorkerPool, begin_worker, worker_pool


def run_tasks(
    launcher: Launcher, tasks: Sequence[Task], update: Update, *, keep_going: bool = False
) -> Iterator[Outcome]:
    """How each task ended, as they end.

    The first failure stops the rest and is raised; with `keep_going` it is an outcome like others, and those that wait
    for it fail with it. Nothing is started where there is nothing to do.
    """
    if tasks:
        with opened(launcher) as executor:
            yield from _run(executor, tasks, update, keep_going)


def _run(executor: Executor, tasks: Sequence[Task], update: Update, keep_going: bool) -> Iterator[Outcome]:
    plan = _Plan(tasks)
    while plan.unfinished:
        executor.expect(plan.unfinished)
        for _ in range(executor.free()):
            if (task := plan.next()) is None:
                break
            executor.start(task)
        outcomes = executor.ended(update)
        if not keep_going:  # a failure comes first, and nothing is begun behind it
            for outcome in outcomes:
                if outcome.error is not None:
                    raise outcome.error
        for outcome in outcomes:
            yield outcome
            yield from plan.ended(outcome)


class _Plan:
    """Which task may begin. Each is looked at once a dependency, however many there are."""

    def __init__(self, tasks: Sequence[Task]) -> None:
        self._tasks = tasks
        places = {task.label: i for i, task in enumerate(tasks)}
        self._blocked = [{label for label in task.after if label in places} for task in tasks]
        self._behind: dict[str, list[int]] = {}
        for i, labels in enumerate(self._blocked):
            for label in labels:
                self._behind.setdefault(label, []).append(i)
        self._ready = [i for i, labels in enumerate(self._blocked) if not labels]
        self._done: set[str] = set()

    @property
    def unfinished(self) -> int:
        return len(self._tasks) - len(self._done)

    def next(self) -> Task | None:
        """The first of those that may begin; it is handed out once."""
        return self._tasks[heapq.heappop(self._ready)] if self._ready else None

    def ended(self, outcome: Outcome) -> Iterator[Outcome]:
        """Free those that waited for it; where it failed, they fail too."""
        self._done.add(outcome.label)
        for i in self._behind.get(outcome.label, ()):
            task = self._tasks[i]
            if outcome.error is not None and task.label not in self._done:
                lost = Outcome(task.label, error=UsageError(f"not made, as {outcome.label} failed"))
                yield lost
                yield from self.ended(lost)
            self._blocked[i].discard(outcome.label)
            if not self._blocked[i] and task.label not in self._done:
                heapq.heappush(self._ready, i)


Message = tuple[str, int, int, str]
MOMENT = 0.2  # s that one look for what has ended waits


class PoolExecutor:
    """No more tasks are handed out than there are processes.

    One that fails ends the run, and its process would begin the next one that it holds.
    """

    def __init__(self, pool: WorkerPool, count: int, messages: Queue[Message]) -> None:
        self._pool, self._count, self._messages = pool, count, messages
        self._running: dict[Future[Any], str] = {}

    def free(self) -> int:
        """Processes without a task."""
        return self._count - len(self._running)

    def start(self, task: Task) -> None:
        """To the pool."""
        self._running[self._pool.submit(_work, task.label, task.work)] = task.label

    def ended(self, update: Update) -> list[Outcome]:
        """A process that died is no outcome: it breaks the pool, which says so."""
        ready, _ = wait(self._running, timeout=MOMENT, return_when=FIRST_COMPLETED)
        for message in _drain(self._messages):
            update(*message)
        return [_outcome(self._running.pop(future), future) for future in ready]

    def expect(self, unfinished: int) -> None:
        """The pool has its size."""


@contextmanager
def pool_executor(count: int) -> Iterator[PoolExecutor]:
    """So many processes, none of which outlives the block; raises WorkerDiedError where one did not live so long."""
    context = multiprocessing.get_context("spawn")
    messages: Queue[Message] = context.Queue()
    with worker_pool(count, _start_worker, messages, os.getpid()) as pool:
        yield PoolExecutor(pool, count, messages)


_messages: Queue[Message]


def _start_worker(messages: Queue[Message], parent: int) -> None:
    global _messages
    _messages = messages
    begin_worker(parent)


def _work(label: str, work: Callable[[Progress], Any]) -> Any:
    return work(lambda done, total, note: _messages.put((label, done, total, note)))


def _outcome(label: str, future: Future[Any]) -> Outcome:
    try:
        return Outcome(label, future.result())
    except BrokenProcessPool:
        raise
    except Exception as error:  # whatever it is, it is this task's
        return Outcome(label, error=error)


def _drain(messages: Queue[Message]) -> Iterator[Message]:
    while True:
        try:
            yield messages.get_nowait()
        except Empty:
            return
