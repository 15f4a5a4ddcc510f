"""Tasks in this process or in others of this machine, and the launcher's place for them."""

from __future__ import annotations

import multiprocessing
import os
import queue
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Executor, Future
from contextlib import AbstractContextManager, contextmanager, nullcontext, suppress
from dataclasses import dataclass
from functools import partial
from multiprocessing.queues import Queue
from typing import Any

from gpsim.launchers.running import Launcher, Local, Outcome, Place, Progress, Task, Update, run_in
from gpsim.workers import WorkerPool, begin_worker, worker_pool

Message = tuple[str, int, int, str]
_messages: Queue[Message]


def run_tasks(
    launcher: Launcher, tasks: Sequence[Task], update: Update, *, keep_going: bool = False
) -> Iterator[Outcome]:
    """How each task ended, as `run_in` says; nothing is started where there is nothing to do."""
    if tasks:
        with _opened(launcher, update) as place:
            yield from run_in(place, tasks, keep_going)


def _opened(launcher: Launcher, update: Update) -> AbstractContextManager[Place]:
    """The launcher's executor, while it is needed; all that it started ends with the block."""
    if isinstance(launcher, Local):
        return _processes(launcher.processes, update) if launcher.processes else nullcontext(_Here(update))
    from gpsim.launchers.dask_jobs import dask_workers  # Dask is no part of a plain installation

    return dask_workers(launcher, update)


@dataclass
class _Processes:
    """No more tasks are handed out than there are processes.

    One that fails ends the run, and its process would begin the next one that it holds.
    """

    executor: WorkerPool
    count: int
    messages: Queue[Message]
    update: Update

    def room(self) -> int:
        return self.count

    def sent(self, task: Task) -> Callable[[], Any]:
        return partial(_work, task.label, task.work)

    def look(self, unfinished: int) -> None:
        with suppress(queue.Empty):
            while True:
                self.update(*self.messages.get_nowait())

    def result(self, task: Task, done: Future[Any]) -> tuple[Any, str]:
        return done.result(), ""


class _Here(Executor):
    """One task after the other in this process: the place, and its own executor."""

    def __init__(self, update: Update) -> None:
        self._update = update

    @property
    def executor(self) -> Executor:
        return self

    def submit(self, job: Callable[..., Any], /, *args: Any, **kwargs: Any) -> Future[Any]:
        done: Future[Any] = Future()
        try:
            done.set_result(job(*args, **kwargs))
        except Exception as error:
            done.set_exception(error)
        return done

    def room(self) -> int:
        return 1

    def sent(self, task: Task) -> Callable[[], Any]:
        return partial(task.work, partial(self._update, task.label))

    def result(self, task: Task, done: Future[Any]) -> tuple[Any, str]:
        return done.result(), ""

    def look(self, unfinished: int) -> None:
        pass


@contextmanager
def _processes(count: int, update: Update) -> Iterator[_Processes]:
    """So many processes; raises WorkerDiedError where one did not live as long as the block."""
    messages: Queue[Message] = multiprocessing.get_context("spawn").Queue()
    with worker_pool(count, _start_worker, messages, os.getpid()) as pool:
        yield _Processes(pool, count, messages, update)


def _start_worker(messages: Queue[Message], parent: int) -> None:
    global _messages
    _messages = messages
    begin_worker(parent)


def _work(label: str, work: Callable[[Progress], Any]) -> Any:
    return work(lambda done, total, note: _messages.put((label, done, total, note)))
