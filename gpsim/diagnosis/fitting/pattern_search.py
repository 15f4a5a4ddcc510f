"""The search for thresholds of laws that jump: places on both sides of where a fit stands, far and near."""

from __future__ import annotations

import numpy as np

from gpsim.channels import FloatArray, IntArray
from gpsim.diagnosis.fitting.gauss_newton import Step, damped_step, jacobians, state_jacobian
from gpsim.diagnosis.fitting.hypothesis import Hypothesis
from gpsim.diagnosis.fitting.point import Point, point_at
from gpsim.diagnosis.fitting.problem import Problem, objective, variance_of, window_costs
from gpsim.effects import closed
from gpsim.recordings import evenly

PATTERN_WINDOWS_OF_A_ROBOT = 24  # windows on which the places of a pattern are judged
FIRST_DAMPING = 1e-3
"""Damping that a fit begins with, of a normal matrix with a unit diagonal (Marquardt (1963))."""
PATTERN_WINDOWS = 80  # windows on which the places of a pattern are judged


def searched_pattern(
    problem: Problem,
    hypothesis: Hypothesis,
    at: Point,
    pattern: FloatArray,
    low: FloatArray,
    high: FloatArray,
    per_window: FloatArray,
    known: FloatArray | None,
) -> Point:
    """Try parameters whose law jumps on both sides, far and near: derivatives do not lead out of a local minimum.

    All places of a parameter are judged with start states that follow them linearly, and once more with the other
    parameters following, too; the best of either is taken if it holds. known: slopes by start states, if well enough.
    """
    rows = evenly(len(at.starts), _windows_of_patterns(problem))
    there_known = None if known is None else known[rows]
    own, damped = problem.on(problem.windows.take(rows)), per_window[rows]
    some = own.slopes
    for j, parameter in enumerate(hypothesis.parameters):
        if parameter.step is None:
            continue
        there = at.residual[rows]
        if some is not own:
            there = some.residuals(hypothesis, at.theta[None], at.starts[None, rows])[0]
        here = point_at(some, at.theta, at.starts[rows], there)
        reaches = parameter.step * np.concatenate([-pattern, pattern])
        thetas = np.tile(at.theta, (len(reaches), 1))
        thetas[:, j] = np.clip(thetas[:, j] + reaches, low[j], high[j])
        got = some.residuals(hypothesis, thetas, np.tile(here.starts, (len(thetas), 1, 1)))
        by_state, by_theta = jacobians(
            some, hypothesis, here.theta, here.starts, here.residual, by_state=there_known
        )
        others = np.flatnonzero(np.arange(at.theta.size) != j)
        for free in dict.fromkeys(((), tuple(others))):
            following = np.array(free, dtype=np.int64)
            moved = _followed(some, here, got, by_state, by_theta, following, low, high, damped)
            best = int(np.argmin([objective(some, r) for _, r in moved]))
            theta = np.array(thetas[best])
            theta[following] += moved[best][0].theta
            theta = np.clip(theta, low, high)
            tried = _best_starts(problem, hypothesis, theta, at, per_window, known)
            at = min(at, tried, key=lambda p: p.value)
    return at


def _windows_of_patterns(problem: Problem) -> int:
    if closed(problem.simulator) is None:
        return PATTERN_WINDOWS
    return PATTERN_WINDOWS_OF_A_ROBOT


def _followed(
    problem: Problem,
    at: Point,
    got: FloatArray,
    by_state: FloatArray,
    by_theta: FloatArray,
    following: IntArray,
    low: FloatArray,
    high: FloatArray,
    per_window: FloatArray,
) -> list[tuple[Step, FloatArray]]:
    """For each of the residuals got (C, W, L + 1, S): how start states and some parameters adapt, and what is left."""
    variance, slopes = variance_of(problem, at.residual), by_theta[..., following]
    damping = FIRST_DAMPING
    theta, low, high = at.theta[following], low[following], high[following]
    out = []
    for r in got:
        step = damped_step(problem, r, by_state, slopes, variance, damping, per_window, theta, low, high)
        start = step.starts_alone + step.starts_by_theta @ step.theta
        out.append((step, r + (by_state @ start[:, None, :, None])[..., 0] + slopes @ step.theta))
    return out


def _best_starts(
    problem: Problem,
    hypothesis: Hypothesis,
    theta: FloatArray,
    at: Point,
    per_window: FloatArray,
    known: FloatArray | None,
) -> Point:
    """Theta with the start state that suits each window best: where it stood, as it follows, or as measured."""
    residual = problem.residuals(hypothesis, theta[None], at.starts[None])[0]
    by_state = (
        state_jacobian(problem, hypothesis.having(theta), at.starts, residual) if known is None else known
    )
    variance, none = variance_of(problem, at.residual), np.empty((*residual.shape, 0))
    bounds = theta[:0]
    step = damped_step(problem, residual, by_state, none, variance, 0.0, per_window, bounds, bounds, bounds)
    copies = np.stack([at.starts, at.starts + step.starts_alone, problem.windows.measured[:, 0]])
    others = problem.residuals(hypothesis, np.tile(theta, (2, 1)), copies[1:])
    tried = np.concatenate([residual[None], others])
    pick = np.argmin(window_costs(problem, tried, variance), axis=0)
    every = np.arange(len(at.starts))
    return point_at(problem, theta, copies[pick, every], tried[pick, every], tried[-1])
