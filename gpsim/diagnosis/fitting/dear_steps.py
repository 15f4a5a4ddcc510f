"""The step of a fit where simulating is dear: what nearly always is best is tried first, the rest where it was not."""

from __future__ import annotations

import numpy as np

from gpsim.channels import BoolArray, FloatArray
from gpsim.diagnosis.fitting.gauss_newton import Step
from gpsim.diagnosis.fitting.hypothesis import Hypothesis
from gpsim.diagnosis.fitting.point import Point, point_at
from gpsim.diagnosis.fitting.problem import Problem, variance_of, window_costs


def stepped_dearly(
    problem: Problem, hypothesis: Hypothesis, at: Point, step: Step, low: FloatArray, high: FloatArray
) -> tuple[Point, bool, BoolArray, None]:
    """The step of theta if it is better than where the fit stands, else theta standing still.

    Every window takes its own start state's step; where that is worse than where it stood it is asked how it does with
    the start state that follows theta, or the measured one. Returns the point, whether theta moved, (W,) whose start
    state took its own step, and nothing that is known of the measured start states.
    """
    if at.theta.size and np.isfinite(step.theta).all():
        theta = np.clip(at.theta + step.theta, low, high)
        follow = at.starts + step.starts_by_theta @ (theta - at.theta)
        moved, own = _tried(problem, hypothesis, at, theta, follow + step.starts_alone, follow)
        if moved.value < at.value:
            return moved, True, own, None
    alone, own = _tried(problem, hypothesis, at, at.theta, at.starts + step.starts_alone, at.starts)
    return alone, False, own, None


def _tried(
    problem: Problem,
    hypothesis: Hypothesis,
    at: Point,
    theta: FloatArray,
    first: FloatArray,
    second: FloatArray,
) -> tuple[Point, BoolArray]:
    """The point at theta, each window from the best start state tried; and (W,) whose is the first (W, S)."""
    variance = variance_of(problem, at.residual)
    stood = window_costs(problem, at.residual[None], variance)[0]
    starts, residual = np.array(first), problem.residuals(hypothesis, theta[None], first[None])[0]
    costs = window_costs(problem, residual[None], variance)[0]
    (worse,) = np.nonzero(~(costs <= stood))  # also where it is no number
    own = np.ones(len(starts), dtype=np.bool_)
    if len(worse):
        some = problem.on(problem.windows.take(worse))
        others = np.stack([second[worse], problem.windows.measured[worse, 0]])
        got = some.residuals(hypothesis, np.tile(theta, (2, 1)), others)
        tried = np.concatenate([costs[None, worse], window_costs(problem, got, variance)])
        pick = np.argmin(np.where(np.isfinite(tried), tried, np.inf), axis=0)
        for i in (1, 2):
            rows = worse[pick == i]
            starts[rows], residual[rows], own[rows] = others[i - 1, pick == i], got[i - 1, pick == i], False
    return point_at(problem, theta, starts, residual), own
