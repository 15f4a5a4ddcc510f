"""Independent fits side by side in worker processes; the results do not depend on how many there are."""

from __future__ import annotations

import multiprocessing
import os
import signal
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass

from gpsim.channels import FloatArray
from gpsim.diagnosis.hypothesis import Hypothesis
from gpsim.diagnosis.problem import Problem
from gpsim.diagnosis.shooting import Fit, fit
from gpsim.errors import UsageError

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
    # Spawned, not forked: the parent shows its progress from a thread.
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(count, context, initializer=_quiet) as pool:
        token = _POOL.set(pool)
        try:
            yield
        except BaseException:
            pool.shutdown(wait=False, cancel_futures=True)
            raise
        finally:
            _POOL.reset(token)


def fit_all(problem: Problem, orders: Sequence[Order]) -> list[Fit]:
    """The fits of all orders, in their order; raises what a fit raises."""
    pool = _POOL.get()
    if pool is None or len(orders) < 2:
        return [_fit(problem, order) for order in orders]
    try:
        return [f.result() for f in [pool.submit(_fit, problem, order) for order in orders]]
    except BrokenProcessPool as error:
        raise UsageError("diagnose: a worker process was ended; run it again, or with --cores 1") from error


def _fit(problem: Problem, order: Order) -> Fit:
    return fit(
        problem, order.hypothesis, order.starts, iterations=order.iterations, tolerance=order.tolerance
    )


def _quiet() -> None:
    """Ctrl-C reaches the whole group, and the parent ends its workers; one thread each."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    os.environ.setdefault("OMP_NUM_THREADS", "1")
