"""Worker processes: a pool that leaves nobody behind, whatever ends the parent."""

from __future__ import annotations

import multiprocessing
import os
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterator
from concurrent.futures import Future, ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from typing import Any

from gpsim.errors import UsageError


class WorkerPool(ProcessPoolExecutor):
    """Its workers leave when the parent ends them, though another job be at hand."""

    def submit(self, job: Callable[..., Any], /, *args: Any, **kwargs: Any) -> Future[Any]:
        """As the executor's own."""
        return super().submit(_run, job, *args, **kwargs)


def _run(job: Callable[..., Any], *args: Any, **kwargs: Any) -> Any:
    """The executor would take SystemExit for the job's result, begin the next job, or wait for one for ever."""
    try:
        return job(*args, **kwargs)
    except SystemExit:
        os._exit(1)


@contextmanager
def worker_pool(count: int, begin: Callable[..., None], *arguments: Any) -> Iterator[WorkerPool]:
    """A pool of `count` spawned processes, each begun by `begin(*arguments)`; none outlives the block.

    Spawned, not forked: torch does not survive a fork, nor does a parent that shows its progress from a thread. A
    worker that was killed raises UsageError.
    """
    context = multiprocessing.get_context("spawn")
    pool = WorkerPool(count, context, initializer=begin, initargs=arguments)
    try:
        yield pool
        pool.shutdown()
    except BrokenProcessPool as error:
        raise UsageError(
            "a worker process was killed (out of memory?); run the same command to carry on"
        ) from error
    finally:
        pool.shutdown(wait=False, cancel_futures=True)
        for process in multiprocessing.active_children():
            process.terminate()


def begin_worker(parent: int) -> None:
    """Ctrl-C reaches the whole group and the parent ends its workers; without the parent (kill -9) they leave.

    Who is ended by the parent leaves as after an exception, so that temporary folders go with it.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, lambda number, frame: sys.exit(1))
    threading.Thread(target=_leave_with, args=(parent,), daemon=True).start()


def _leave_with(parent: int) -> None:
    """Nobody waits for the result; the next run sweeps what is half-made."""
    while os.getppid() == parent:
        time.sleep(1.0)
    os._exit(1)
