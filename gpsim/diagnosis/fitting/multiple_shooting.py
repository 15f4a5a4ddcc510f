"""Multiple shooting: fit a hypothesis to windows, each window's start state estimated along with the parameters.

Bock (1981), "Numerical treatment of inverse problems in chemical reaction kinetics"; the start states are eliminated
by projection, with Levenberg-Marquardt damping and acceptance per window, because one window near a discontinuity
must not hold up all others.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from gpsim.channels import BoolArray, FloatArray, IntArray
from gpsim.diagnosis.fitting.dear_steps import stepped_dearly
from gpsim.diagnosis.fitting.gauss_newton import (
    Step,
    damped_step,
    jacobians,
    projected,
    promised_gain,
    state_jacobian,
)
from gpsim.diagnosis.fitting.hypothesis import Hypothesis
from gpsim.diagnosis.fitting.point import Point, point_at
from gpsim.diagnosis.fitting.problem import Problem, objective, variance_of, window_costs
from gpsim.effects import closed
from gpsim.recordings import evenly


@dataclass(frozen=True)
class Fit:
    """A fitted hypothesis.

    residuals: (W, L + 1, S); starts: (W, S); variance: (S,) of the residual, floor included; objective: negative log
    likelihood in nats, up to a constant of the data; converged: whether it stood still.
    """

    hypothesis: Hypothesis
    starts: FloatArray
    residuals: FloatArray
    variance: FloatArray
    objective: float
    converged: bool


@dataclass(frozen=True)
class Curvature:
    """The log likelihood around a fit, start states projected out: information (P, P), gradients (W, P) by window."""

    information: FloatArray
    gradients: FloatArray


def fit(
    problem: Problem,
    hypothesis: Hypothesis,
    starts: FloatArray,
    *,
    iterations: int | None = None,
    tolerance: float | None = None,
    near: bool = False,
    known: FloatArray | None = None,
) -> Fit:
    """Minimise the profile likelihood over theta (from the hypothesis's values) and the start states (W, S).

    iterations, tolerance [nats]: None of a fit that is made to its end; near: the values are known to be good,
    thresholds of jumping laws need not be looked for far away; known: (W, L + 1, S, S) slopes by start states, where
    others have been found well enough.
    """
    settings = problem.run.settings.shooting
    iterations = settings.iterations if iterations is None else iterations
    tolerance = settings.tolerance if tolerance is None else tolerance
    low, high = _bounds(hypothesis)
    theta = np.clip(hypothesis.theta, low, high)
    at = point_at(
        problem, theta, np.array(starts), problem.residuals(hypothesis, theta[None], starts[None])[0]
    )
    damping, least, most = settings.first_damping, settings.least_damping, settings.most_damping
    shrinks, grows = settings.damping_shrinks, settings.damping_grows
    patience = settings.patience if theta.size else settings.patience_of_starts
    per_window = np.full(len(starts), damping)
    converged, still, seen_from, moved = False, 0, None, True
    by_state, by_theta = np.empty(0) if known is None else known, np.empty(0)
    dear = closed(problem.simulator) is not None
    for round_ in range(iterations):
        if not near and round_ in settings.pattern_rounds and any(p.step for p in hypothesis.parameters):
            first = round_ == settings.pattern_rounds[0]
            pattern = np.array(settings.first_pattern if first else settings.pattern)
            slopes = by_state if dear and by_state.size else None
            at = _searched_pattern(problem, hypothesis, at, pattern, low, high, per_window, slopes)
        if seen_from is not at.residual:  # after a rejected step it stands where it stood
            serves = moved and (known is not None if round_ == 0 else bool(round_ % problem.every_slope))
            if not (serves and by_theta.size and theta.size >= problem.run.settings.closed_step.many):
                by_state, by_theta = jacobians(
                    problem,
                    hypothesis,
                    at.theta,
                    at.starts,
                    at.residual,
                    by_state=by_state if serves else None,
                )
            seen_from = at.residual
        variance = variance_of(problem, at.residual)
        step = damped_step(
            problem, at.residual, by_state, by_theta, variance, damping, per_window, at.theta, low, high
        )
        # After a rejected step of theta, and where there is none, the start states may have to go alone.
        alone = not (moved and theta.size)
        if dear:
            new, moved, stepped, anchored = stepped_dearly(problem, hypothesis, at, step, low, high)
        else:
            new, moved, stepped, anchored = _stepped(problem, hypothesis, at, step, low, high, alone=alone)
        gain = at.value - new.value
        per_window = np.clip(np.where(stepped, per_window / shrinks, per_window * grows), least, most)
        damping = float(np.clip(damping / shrinks if moved else damping * grows, least, most))
        at = new if gain > 0 else replace(at, anchored=anchored)
        still = 0 if gain >= tolerance else still + 1
        if (moved and still >= 1) or still >= patience:
            # Where one channel is known far better than another, a little damping may be all that holds it.
            promised = promised_gain(problem, at.residual, by_state, by_theta, at.theta, low, high)
            if least < settings.least_damping or promised < tolerance:
                converged = True
                break
            least, still = settings.no_damping, 0
            damping, per_window = least, np.full(len(starts), least)
    variance = variance_of(problem, at.residual)
    return Fit(hypothesis.having(at.theta), at.starts, at.residual, variance, at.value, converged)


def curvature(problem: Problem, fit: Fit) -> Curvature:
    """Around a fit to the problem's windows, or to the same windows on another grid; the noise model stands."""
    theta = fit.hypothesis.theta
    residual = problem.residuals(fit.hypothesis, theta[None], fit.starts[None])[0]
    by_state, by_theta = jacobians(problem, fit.hypothesis, theta, fit.starts, residual)
    informations, gradients = projected(
        problem, residual, by_state, by_theta, fit.variance, np.zeros(len(fit.starts))
    )
    return Curvature(informations.sum(axis=0), gradients)


def _bounds(hypothesis: Hypothesis) -> tuple[FloatArray, FloatArray]:
    bounds = np.array([(p.low, p.high) for p in hypothesis.parameters], dtype=float).reshape(-1, 2)
    return bounds[:, 0], bounds[:, 1]


def _stepped(
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


def _searched_pattern(
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
    settings = problem.run.settings
    if closed(problem.simulator) is None:
        return settings.shooting.pattern_windows
    return settings.closed_step.pattern_windows


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
    damping = problem.run.settings.shooting.first_damping
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
