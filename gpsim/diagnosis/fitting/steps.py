"""A step of a fit: theta's if it is better than where the fit stands; each window begins where suits it best."""

from __future__ import annotations

import numpy as np

from gpsim.channels import BoolArray, FloatArray
from gpsim.diagnosis.fitting.gauss_newton import Step
from gpsim.diagnosis.fitting.hypothesis import Hypothesis
from gpsim.diagnosis.fitting.point import Point, point_at
from gpsim.diagnosis.fitting.problem import Problem, variance_of, window_costs


def stepped(
    problem: Problem,
    hypothesis: Hypothesis,
    at: Point,
    step: Step,
    low: FloatArray,
    high: FloatArray,
    *,
    alone: bool,
) -> tuple[Point, bool, BoolArray, FloatArray]:
    """The step of theta if it is better than where the fit stands, else theta standing still.

    Every window keeps the start state that suits it best. alone: try its own step while theta stands, too.

    Returns the point, whether theta moved, (W,) whose start state took its own step, and the residual `anchored` of the
    theta that it began with.
    """
    thetas = [at.theta]
    if at.theta.size and np.isfinite(step.theta).all():  # a window that flies off may leave no direction
        thetas.insert(0, np.clip(at.theta + step.theta, low, high))
    # What was measured is always worth a try: a start state that a worse theta led astray may be stuck there.
    anchor = problem.windows.measured[:, 0]
    follows = [at.starts + step.starts_by_theta @ (theta - at.theta) for theta in thetas[:-1]] + [at.starts]
    copies = np.stack([c for follow in follows for c in (follow + step.starts_alone, follow, anchor)])
    got = np.empty((len(copies), *at.residual.shape))
    new = np.ones(len(copies), dtype=np.bool_)
    new[-2], got[-2] = False, at.residual  # where it stands is known,
    if at.anchored is not None:
        new[-1], got[-1] = False, at.anchored  # and what was measured, since theta was tried
    if len(thetas) > 1 and not alone:
        new[-3], got[-3] = False, np.inf
    got[new] = problem.residuals(hypothesis, np.repeat(np.stack(thetas), 3, axis=0)[new], copies[new])
    costs = window_costs(problem, got, variance_of(problem, at.residual))
    every, options = np.arange(len(at.starts)), []
    for i, theta in enumerate(thetas):
        pick = 3 * i + np.argmin(costs[3 * i : 3 * i + 3], axis=0)
        point = point_at(problem, theta, copies[pick, every], got[pick, every], got[3 * i + 2])
        options.append((point, pick == 3 * i))
    # Start states alone often gain more at first, and would hold theta where it stands.
    moves = len(thetas) > 1 and options[0][0].value < at.value
    best = options[0] if moves else options[-1]
    return best[0], moves, best[1], got[-1]


def stepped_dearly(
    problem: Problem, hypothesis: Hypothesis, at: Point, step: Step, low: FloatArray, high: FloatArray
) -> tuple[Point, bool, BoolArray, None]:
    """The same where simulating is dear: what nearly always is best is tried first, the rest where it was not.

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
