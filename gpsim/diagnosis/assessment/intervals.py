"""Intervals: how well the data know each parameter.

Windows are the blocks, and so are longer runs of neighbouring ones: the covariance is the largest of the Gauss-Newton
one and the sandwiches of their gradients (White 1982; over runs as Newey and West 1987), so that correlated or
heavy-tailed residuals widen it, and what drifts slowly does; what halving the substep moves is added; and where the
likelihood is flat around the estimate (a dead zone between two command levels) a profile walks to its edges.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.special import chdtri, ndtri, stdtrit

from gpsim.channels import FloatArray
from gpsim.diagnosis.fitting import Curvature, Fit, Problem, correlation_time, curvature
from gpsim.diagnosis.fitting import fit as shoot

CHANCE_CORRELATION = 1.5  # up to which a residual's correlation time is white noise's [samples]
UNDETERMINED = 1e-13  # of the largest eigenvalue: the windows know as much at least of any direction
RUNS_OF_WINDOWS = 20  # runs of neighbouring windows whose gradients scatter, too: what drifts shows there
FIRST_PACE = 0.0625  # of a jumping parameter's own step: how far the profile's first place lies
PACE_GROWS = 1.5  # multiplies the pace until a place is too far
FALLS_BACK = 0.25  # of a first place that was too far, which is asked next
PROFILE_PLACES = 14  # that a profile asks at most
CLOSE_ENOUGH = 0.1  # of the half width, how exactly it is narrowed down
PROFILE_ITERATIONS = 3  # of the fit of all else at each place

LEAST_INFORMATION = 1e-100  # guards a division: what the windows know of a parameter that moves nothing


def intervals(problem: Problem, fit: Fit, level: float | None = None) -> FloatArray:
    """(P, 2): the interval of each parameter that holds it with a probability `level`, the usual one without it."""
    level = level or problem.run.settings.intervals.level
    theta = fit.hypothesis.theta
    if not theta.size:
        return np.empty((0, 2))
    bounds = np.array([[p.low, p.high] for p in fit.hypothesis.parameters])
    if fit.covariance is not None:
        half = ndtri(0.5 + level / 2) * np.sqrt(np.diag(fit.covariance))
        edges = np.stack([theta - half, theta + half], axis=1)
        return np.asarray(np.clip(edges, bounds[:, :1], bounds[:, 1:]))
    around = curvature(problem, fit)
    covariance = _covariance(problem, fit, around)
    shift = _numerical_shift(problem, fit, around)
    freedom = max(len(problem.windows) - len(theta), 2)
    half = stdtrit(freedom, 0.5 + level / 2) * np.sqrt(np.diag(covariance)) + np.abs(shift)
    low, high = theta - half, theta + half
    jumping = [(j, p.step) for j, p in enumerate(fit.hypothesis.parameters) if p.step is not None]
    calls = [(problem, fit, j, side * step, level) for j, step in jumping for side in (-1.0, 1.0)]
    edges = np.array(problem.run.side_by_side(_profile, calls)).reshape(-1, 2)
    for (j, _), (first, last) in zip(jumping, edges, strict=True):
        low[j], high[j] = first, last
    return np.stack([np.maximum(low, bounds[:, 0]), np.minimum(high, bounds[:, 1])], axis=1)


def covariance(problem: Problem, fit: Fit) -> FloatArray:
    """(P, P): how uncertain the parameters are together, widened as the intervals are."""
    if not fit.hypothesis.theta.size:
        return np.empty((0, 0))
    return _covariance(problem, fit, curvature(problem, fit))


def correlations(problem: Problem, fit: Fit) -> FloatArray:
    """(P, P): how the parameters of a fit vary together where the data leave them open; ones on the diagonal."""
    every = _covariance(problem, fit, curvature(problem, fit))
    deviation = np.sqrt(np.maximum(np.diag(every), LEAST_INFORMATION))
    found = every / np.outer(deviation, deviation)
    np.fill_diagonal(found, 1.0)
    return np.asarray(np.clip(found, -1.0, 1.0))


def _covariance(problem: Problem, fit: Fit, around: Curvature) -> FloatArray:
    """(P, P): the larger of the model's own covariance and that of the windows' scatter, inflated by correlation.

    Of values that forces say it is theirs.
    """
    if fit.covariance is not None:
        return fit.covariance
    inverse = _inverse(around.information, UNDETERMINED)
    model, ratio = inverse * _correlated(problem, fit), np.ones(len(inverse))
    for gradients in (around.gradients, _by_runs(problem, around.gradients)):
        sandwich = inverse @ _scatter(gradients) @ inverse
        ratio = np.maximum(ratio, np.diag(sandwich) / np.maximum(np.diag(model), 1e-300))
    return np.asarray(model * np.sqrt(np.outer(ratio, ratio)))


def _scatter(gradients: FloatArray) -> FloatArray:
    """(P, P) of a sum of independent gradients (B, P) that vanishes."""
    count, size = gradients.shape
    centred = gradients - gradients.mean(axis=0)
    return np.asarray(centred.T @ centred * count / max(count - size, 1))


def _by_runs(problem: Problem, gradients: FloatArray) -> FloatArray:
    """(B, P) sums of the windows' gradients (W, P) over runs of neighbours in the order of episodes and time."""
    order = np.lexsort((problem.windows.t[:, 0], problem.windows.episode))
    runs = min(RUNS_OF_WINDOWS, len(gradients))
    return np.array([part.sum(axis=0) for part in np.array_split(gradients[order], runs)])


def informed(problem: Problem, fit: Fit) -> FloatArray:
    """(P, P): the information on each parameter, as much less as correlation and scatter make of it."""
    around = curvature(problem, fit)
    own = np.diag(_inverse(around.information, UNDETERMINED))
    widened = np.diag(_covariance(problem, fit, around)) / np.maximum(own, LEAST_INFORMATION)
    return np.asarray(around.information / np.median(widened))


def _correlated(problem: Problem, fit: Fit) -> float:
    """By how much correlation makes samples count for less; 1 where it may be chance."""
    tau = float(np.max(correlation_time(problem, fit.residuals)[problem.observed]))
    return tau if tau > CHANCE_CORRELATION else 1.0


def _inverse(information: FloatArray, least: float) -> FloatArray:
    """Of parameters in whatever units: scaled to a unit diagonal before.

    A direction of which the windows say nothing keeps a little information: a pseudo-inverse would call it certain.
    """
    scale = np.sqrt(np.maximum(np.diag(information), LEAST_INFORMATION))
    values, vectors = np.linalg.eigh(information / np.outer(scale, scale))
    values = np.maximum(values, least * max(float(values[-1]), 1.0))
    return np.asarray((vectors / values) @ vectors.T / np.outer(scale, scale))


def _numerical_shift(problem: Problem, fit: Fit, around: Curvature) -> FloatArray:
    """(P,) how far one Gauss-Newton step moves on a grid twice as fine."""
    if fit.hypothesis.scheme != "fine":
        return np.zeros(len(fit.hypothesis.theta))
    finer = replace(problem, substeps=2 * problem.substeps)
    moved = curvature(finer, fit).gradients.sum(axis=0) - around.gradients.sum(axis=0)
    return np.asarray(_inverse(around.information, UNDETERMINED) @ moved)


def _profile(problem: Problem, fit: Fit, index: int, step: float, level: float) -> float:
    """Walk from the estimate until the likelihood has dropped by the interval's share, as far as its samples count.

    At every place start states and all other parameters are fitted anew: one that gives way widens the interval. Steps
    grow until one goes too far; then the place is narrowed down to a share of its distance.
    """
    theta, parameter = fit.hypothesis.theta, fit.hypothesis.parameters[index]
    drop = 0.5 * float(chdtri(1, 1.0 - level)) * _correlated(problem, fit)
    bound = parameter.high if step > 0 else parameter.low

    def holds(distance: float) -> bool:
        at = theta.copy()
        at[index] += distance
        held = fit.hypothesis.having(at).holding(index)
        again = shoot(problem, held, fit.starts, iterations=PROFILE_ITERATIONS)
        return again.objective - fit.objective < drop

    inside, beyond, pace, last = 0.0, None, FIRST_PACE * step, float(bound - theta[index])
    for _ in range(PROFILE_PLACES):
        if beyond is None:
            asked = float(np.clip(inside + pace, min(last, 0.0), max(last, 0.0)))
            pace *= PACE_GROWS
        else:
            asked = 0.5 * (inside + beyond) if inside else FALLS_BACK * beyond
        if holds(asked):
            inside = asked
            if asked == last:
                return float(bound)
        else:
            beyond = asked
        if beyond is not None and abs(beyond - inside) < CLOSE_ENOUGH * abs(beyond):
            break
    return float(theta[index]) + (inside if beyond is None else 0.5 * (inside + beyond))
