"""Independent fits side by side in worker processes; the results do not depend on how many there are."""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass

from gpsim.channels import FloatArray
from gpsim.diagnosis.effort import add, spent
from gpsim.diagnosis.hypothesis import Hypothesis
from gpsim.diagnosis.problem import Problem
from gpsim.diagnosis.shooting import Fit, fit
from gpsim.workers import begin_worker, worker_pool

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
    """Within it, `fit_all` uses `count` processes."""
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
    pool = _POOL.get()
    if pool is None or len(orders) < 2:
        return [_fit(problem, order) for order in orders]
    results = [f.result() for f in [pool.submit(_counted, problem, order) for order in orders]]
    add(sum(effort for _, effort in results))
    return [found for found, _ in results]


def _counted(problem: Problem, order: Order) -> tuple[Fit, float]:
    """The fit, and the effort that it took in this process."""
    before = spent()
    return _fit(problem, order), spent() - before


def _fit(problem: Problem, order: Order) -> Fit:
    return fit(
        problem, order.hypothesis, order.starts, iterations=order.iterations, tolerance=order.tolerance
    )
