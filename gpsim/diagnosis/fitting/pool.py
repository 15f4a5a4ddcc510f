"""Worker processes of a diagnosis; what they make does not depend on how many there are."""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager
from contextvars import ContextVar
from typing import Any, TypeVar

from gpsim.diagnosis.fitting.budget import add, spent
from gpsim.workers import begin_worker, worker_pool

Result = TypeVar("Result")
_POOL: ContextVar[tuple[ProcessPoolExecutor, int] | None] = ContextVar("pool", default=None)


@contextmanager
def cores(count: int) -> Iterator[None]:
    """Within it, what goes `side_by_side` or `at_once` does so in `count` processes."""
    if count < 2:
        yield
        return
    with worker_pool(count, begin_worker, os.getpid()) as pool:
        token = _POOL.set((pool, count))
        try:
            yield
        finally:
            _POOL.reset(token)


def available() -> int:
    """How many processes may work on one thing: 1 in a worker, which is one of several already."""
    pool = _POOL.get()
    return 1 if pool is None else pool[1]


def side_by_side(
    function: Callable[..., Result], calls: Sequence[tuple[Any, ...]], until: float = math.inf
) -> list[Result]:
    """What a module's `function` makes of the arguments of every call, in their order; raises what it raises.

    until: effort after which no further call counts, whether or not another process has begun it already.
    """
    pool, results = _POOL.get(), []
    begun = [pool[0].submit(_counted, function, call) for call in calls] if pool and len(calls) > 1 else None
    for i, call in enumerate(calls):
        if spent() >= until:
            break
        if begun is None:
            results.append(function(*call))
            continue
        result, effort = begun[i].result()
        add(effort)
        results.append(result)
    for late in (begun or [])[len(results) :]:
        late.cancel()
    return results


def at_once(function: Callable[..., Result], calls: Sequence[tuple[Any, ...]]) -> list[Result]:
    """The same of a few parts of one thing, the last of them here; their effort is not counted."""
    pool = _POOL.get()
    *others, own = calls
    if pool is None:
        return [function(*call) for call in calls]
    begun = [pool[0].submit(function, *call) for call in others]
    here = function(*own)
    return [*(f.result() for f in begun), here]


def _counted(function: Callable[..., Result], call: tuple[Any, ...]) -> tuple[Result, float]:
    """What a function makes of its arguments, and the effort that it took in this process."""
    before = spent()
    return function(*call), spent() - before
