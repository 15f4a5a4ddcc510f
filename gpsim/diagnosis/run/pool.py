"""Worker processes of a diagnosis; what they make does not depend on how many there are."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future, ProcessPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any, TypeVar

from gpsim.effects import sources, stand
from gpsim.workers import begin_worker, worker_pool

Result = TypeVar("Result")


@dataclass
class Workers:
    """Processes to share work with; count: with this one, 1 where nobody else is there."""

    count: int = 1
    pool: ProcessPoolExecutor | None = None

    def submit(
        self, function: Callable[..., Result], calls: Sequence[tuple[Any, ...]]
    ) -> list[Future[Result]]:
        """All calls begun elsewhere; empty where nobody is there, or a single call is not worth sending."""
        if self.pool is None or len(calls) < 2:
            return []
        return [self.pool.submit(function, *call) for call in calls]

    def at_once(self, function: Callable[..., Result], calls: Sequence[tuple[Any, ...]]) -> list[Result]:
        """What a function makes of a few parts of one thing, the last of them here."""
        *others, own = calls
        if self.pool is None:
            return [function(*call) for call in calls]
        begun = [self.pool.submit(function, *call) for call in others]
        here = function(*own)
        return [*(f.result() for f in begun), here]


def _begun(parent: int, brought: Sequence[tuple[str, str]]) -> None:
    """In a new worker: it ends with its parent, and has the effects that its user brought."""
    begin_worker(parent)
    stand(brought)


@contextmanager
def cores(count: int) -> Iterator[Workers]:
    """`count` processes, gone after the block."""
    if count < 2:
        yield Workers()
        return
    with worker_pool(count, _begun, os.getpid(), sources()) as pool:
        workers = Workers(count, pool)
        try:
            yield workers
        finally:  # what was diagnosed may be asked for more later, alone
            workers.count, workers.pool = 1, None
