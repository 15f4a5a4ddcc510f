"""Independent trials side by side, one core each.

A process that is killed ends the run with one line; the trials that were finished are kept, and the same command
carries on.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, wait
from itertools import islice
from typing import TypeVar

from gpsim.workers import begin_worker, worker_pool

Result = TypeVar("Result")
Progress = Callable[[int, int, str], None]


def run_trials(
    work: Callable[[int], Result], numbers: Sequence[int], workers: int, progress: Progress
) -> Iterator[tuple[int, Result]]:
    """(number, work(number)) as they finish; `work` must be picklable and keep what it finishes.

    No more trials are handed out than there are workers: one that fails ends the run, and its worker would begin the
    next one that it holds.
    """
    waiting, done = iter(numbers), 0
    with worker_pool(workers, begin_worker, os.getpid()) as pool:
        running = {pool.submit(work, number): number for number in islice(waiting, workers)}
        while running:
            ready, _ = wait(running, return_when=FIRST_COMPLETED)
            results = [(running.pop(future), future.result()) for future in ready]  # a failure comes first
            running |= {pool.submit(work, number): number for number in islice(waiting, len(ready))}
            for number, result in results:
                done += 1
                yield number, result
                progress(done, len(numbers), f"trial {number}")
