"""Independent trials side by side, one core each.

A process that is killed ends the run with one line; the trials that were finished are kept, and the same command
carries on.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import as_completed
from typing import TypeVar

from gpsim.workers import begin_worker, worker_pool

Result = TypeVar("Result")
Progress = Callable[[int, int, str], None]


def run_trials(
    work: Callable[[int], Result], numbers: Sequence[int], workers: int, progress: Progress
) -> Iterator[tuple[int, Result]]:
    """(number, work(number)) as they finish; `work` must be picklable and keep what it finishes."""
    with worker_pool(workers, begin_worker, os.getpid()) as pool:
        futures = {pool.submit(work, number): number for number in numbers}
        for done, future in enumerate(as_completed(futures), start=1):
            yield futures[future], future.result()
            progress(done, len(futures), f"trial {futures[future]}")
