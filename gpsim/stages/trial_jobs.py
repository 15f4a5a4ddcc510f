"""Independent trials side by side, one core each; a process that dies takes only its own trial with it."""

from __future__ import annotations

import multiprocessing
import os
import signal
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from typing import TypeVar

from gpsim.errors import UsageError

Result = TypeVar("Result")
Progress = Callable[[int, int, str], None]


def run_trials(
    work: Callable[[int], Result], numbers: Sequence[int], workers: int, progress: Progress
) -> Iterator[tuple[int, Result]]:
    """(number, work(number)) as they finish; `work` must be picklable and keep what it finishes."""
    context = multiprocessing.get_context("spawn")
    pool = ProcessPoolExecutor(workers, context, initializer=_start, initargs=(os.getpid(),))
    try:
        futures = {pool.submit(work, number): number for number in numbers}
        for done, future in enumerate(as_completed(futures), start=1):
            yield futures[future], future.result()
            progress(done, len(futures), f"trial {futures[future]}")
        pool.shutdown()
    except BrokenProcessPool as error:
        raise UsageError(
            "a worker process was killed (out of memory?); run the same command to carry on"
        ) from error
    finally:
        pool.shutdown(wait=False, cancel_futures=True)
        for process in multiprocessing.active_children():
            process.terminate()


def _start(parent: int) -> None:
    """One thread a worker; Ctrl-C reaches the whole group, the parent ends its workers."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_die_with, args=(parent,), daemon=True).start()


def _die_with(parent: int) -> None:
    while os.getppid() == parent:
        time.sleep(1.0)
    os._exit(1)
