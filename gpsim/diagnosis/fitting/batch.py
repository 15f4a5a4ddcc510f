"""Independent fits, ordered together and made side by side."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from gpsim.channels import FloatArray
from gpsim.diagnosis.fitting.hypothesis import Hypothesis
from gpsim.diagnosis.fitting.multiple_shooting import Fit, fit
from gpsim.diagnosis.fitting.problem import Problem

HOPELESS = 60.0
"""Behind the best of several fits after a few iterations, that no further ones make good [nats]."""


@dataclass(frozen=True)
class Order:
    """A fit to make: the hypothesis, and where its windows start (W, S).

    iterations: at most; tolerance: a step that gains fewer nats is the last; near: its values are known to be good.
    """

    hypothesis: Hypothesis
    starts: FloatArray
    iterations: int
    tolerance: float
    near: bool = False


def fit_all(problem: Problem, orders: Sequence[Order]) -> list[Fit]:
    """The fits of all orders, in their order; raises what a fit raises."""
    return problem.run.side_by_side(fit_order, [(problem, order) for order in orders])


def fit_near(problem: Problem, begun: Sequence[Order], iterations: int, tolerance: float) -> list[Fit]:
    """All fitted as ordered, and those that are not far behind the best then, nor at their end, a while longer."""
    fits = fit_all(problem, begun)
    least = min((f.objective for f in fits), default=0.0) + HOPELESS
    near = [f for f in fits if f.objective < least and not f.converged]
    more = [Order(f.hypothesis, f.starts, iterations, tolerance, near=True) for f in near]
    return [*fit_all(problem, more), *(f for f in fits if not any(f is g for g in near))]


def fit_order(problem: Problem, order: Order) -> Fit:
    """The fit of one order."""
    iterations, tolerance = order.iterations, order.tolerance
    return fit(
        problem, order.hypothesis, order.starts, iterations=iterations, tolerance=tolerance, near=order.near
    )
