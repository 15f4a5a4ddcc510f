"""Tasks in processes of this machine."""

from __future__ import annotations

import multiprocessing
import os
from collections.abc import Callable, Iterator
from concurrent.futures import FIRST_COMPLETED, Future, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from multiprocessing.queues import Queue
from queue import Empty
from typing import Any

from gpsim.launchers.tasks import Outcome, Progress, Task, Update
from gpsim.workers import WorkerPool, begin_worker, worker_pool

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
