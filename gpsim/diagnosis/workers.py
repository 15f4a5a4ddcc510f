"""Independent fits side by side in worker processes; the results do not depend on how many there are."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass
from typing import Any, TypeVar

from gpsim.channels import FloatArray
from gpsim.diagnosis.effort import add, spent
from gpsim.diagnosis.hypothesis import Hypothesis
from gpsim.diagnosis.problem import Problem
from gpsim.diagnosis.shooting import Fit, fit
from gpsim.workers import begin_worker, worker_pool

Result = TypeVar("Result")
_POOL: ContextVar[ProcessPoolExecutor | None] = ContextVar("pool", default=None)


@dataclass(frozen=True)
class Order:
    """A fit to make: the hypothesis, where its windows start (W, S), how long and how closely."""

    hypothesis: Hypothesis
    starts: FloatArray
    iterations: int
    tolerance: float = 0.5


@contextmanager
def cores(count: int) -> Iterator[None]:
    """Within it, what goes `side_by_side` does so in `count` processes."""
    if count < 2:
        yield
        return
    with worker_pool(count, begin_worker, os.getpid()) as pool:
        token = _POOL.set(pool)
        try:
            yield
        finally:
            _POOL.reset(token)


def fit_all(problem: Problem, orders: Sequence[Order]) -> list[Fit]:
    """The fits of all orders, in their order; raises what a fit raises."""
    return side_by_side(fit_order, [(problem, order) for order in orders])


def side_by_side(function: Callable[..., Result], calls: Sequence[tuple[Any, ...]]) -> list[Result]:
    """What a module's `function` makes of the arguments of every call, in their order; raises what it raises."""
    pool = _POOL.get()
    if pool is None or len(calls) < 2:
        return [function(*call) for call in calls]
    results = [f.result() for f in [pool.submit(_counted, function, call) for call in calls]]
    add(sum(effort for _, effort in results))
    return [result for result, _ in results]


def _counted(function: Callable[..., Result], call: tuple[Any, ...]) -> tuple[Result, float]:
    """What a function makes of its arguments, and the effort that it took in this process."""
    before = spent()
    return function(*call), spent() - before


def fit_order(problem: Problem, order: Order) -> Fit:
    """The fit of one order."""
    return fit(
        problem, order.hypothesis, order.starts, iterations=order.iterations, tolerance=order.tolerance
    )
