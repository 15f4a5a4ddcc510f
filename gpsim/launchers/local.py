"""Tasks in this process or in others of this machine, and the launcher's place for them."""

from __future__ import annotations

import multiprocessing
import os
import queue
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Executor, Future
from contextlib import AbstractContextManager, contextmanager, nullcontext
from functools import partial
from multiprocessing.queues import Queue
from typing import Any

from gpsim.launchers.running import Launcher, Local, Outcome, Place, Progress, Task, Update, run_in
from gpsim.workers import begin_worker, worker_pool

_messages: Queue[tuple[str, int, int, str]]


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


class _AtOnce(Executor):
    """One call after the other, in this process."""

    def submit(self, job: Callable[..., Any], /, *args: Any, **kwargs: Any) -> Future[Any]:
        done: Future[Any] = Future()
        try:
            done.set_result(job(*args, **kwargs))
        except Exception as error:
            done.set_exception(error)
        return done


class _Here(Place):
    """One task after the other; what they tell is passed on at once."""

    def __init__(self, update: Update) -> None:
        super().__init__(_AtOnce(), 1, update, queue.SimpleQueue())

    def sent(self, task: Task) -> Callable[[], Any]:
        return partial(task.work, partial(self.update, task.label))


class _Processes(Place):
    """No more tasks are handed out than there are processes.

    One that fails ends the run, and its process would begin the next one that it holds.
    """

    def sent(self, task: Task) -> Callable[[], Any]:
        return partial(_work, task.label, task.work)


@contextmanager
def _processes(count: int, update: Update) -> Iterator[Place]:
    """So many processes; raises WorkerDiedError where one did not live as long as the block."""
    messages: Queue[tuple[str, int, int, str]] = multiprocessing.get_context("spawn").Queue()
    with worker_pool(count, _start_worker, messages, os.getpid()) as pool:
        yield _Processes(pool, count, update, messages)


def _start_worker(messages: Queue[tuple[str, int, int, str]], parent: int) -> None:
    global _messages
    _messages = messages
    begin_worker(parent)


def _work(label: str, work: Callable[[Progress], Any]) -> Any:
    return work(lambda done, total, note: _messages.put((label, done, total, note)))
