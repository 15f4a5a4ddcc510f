"""Intervals: how well the data know each parameter.

From the quadratic of the fit in its coordinates, widened by what is left: windows are the blocks, and so are longer
runs of neighbouring ones, and where gradients scatter over them more than the model says, that counts (White 1982; over
runs as Newey and West 1987); what halving the substep moves is added. Ends are carried to the parameters' units one by
one: a ratio's interval is as wide, in logarithms, to either side.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.special import stdtrit

from gpsim.channels import FloatArray
from gpsim.diagnosis.fitting import Fit, Problem, Shooting, coordinates

OPEN = 1e-13  # of the largest curvature: the windows know as much at least of any direction
RUNS_OF_WINDOWS = 20  # runs of neighbouring windows whose gradients scatter, too: what drifts shows there
TINY = 1e-150  # guards a division, squared or not


def intervals(problem: Problem, fit: Fit, level: float | None = None) -> FloatArray:
    """(P, 2): the interval of each parameter that holds it with a probability `level`, the usual one without it."""
    level = level or problem.run.settings.intervals.level
    if not len(fit.z):
        return np.empty((0, 2))
    own = coordinates(fit.hypothesis.parameters)
    freedom = max(len(problem.windows) - len(fit.z), 2)
    half = stdtrit(freedom, 0.5 + level / 2) * np.sqrt(np.diag(_covariance(problem, fit)))
    half = half + np.abs(_numerical_shift(problem, fit))
    ends = np.stack(
        [own.natural(np.clip(fit.z + side * half, own.low, own.high)) for side in (-1.0, 1.0)], axis=1
    )
    return np.sort(ends, axis=1)


def covariance(problem: Problem, fit: Fit) -> FloatArray:
    """(P, P): how uncertain the parameters are together, in their units, widened as the intervals are."""
    slope = coordinates(fit.hypothesis.parameters).slope(fit.z)
    return np.asarray(_covariance(problem, fit) * np.outer(slope, slope))


def correlations(problem: Problem, fit: Fit) -> FloatArray:
    """(P, P): how the parameters of a fit vary together where the data leave them open; ones on the diagonal."""
    every = _covariance(problem, fit)
    deviation = np.sqrt(np.maximum(np.diag(every), TINY))
    found = every / np.outer(deviation, deviation)
    np.fill_diagonal(found, 1.0)
    return np.asarray(np.clip(found, -1.0, 1.0))


def informed(problem: Problem, fit: Fit) -> FloatArray:
    """(P, P): the information on each parameter, in its unit, as much less as correlation and scatter make of it."""
    found = _with_slopes(problem, fit)
    information = found.by_window.sum(axis=0)
    own = np.diag(_inverse(information))
    widened = np.diag(_covariance(problem, found)) / np.maximum(own, TINY)
    slope = coordinates(fit.hypothesis.parameters).slope(found.z)
    return np.asarray(information / max(float(np.median(widened)), 1.0) / np.outer(slope, slope))


def _with_slopes(problem: Problem, fit: Fit) -> Fit:
    """The fit with what its windows say of all parameters of its hypothesis, whatever was fitted."""
    shooting = Shooting(problem, fit.noise)
    point = shooting.at(fit.hypothesis, fit.starts)
    by_window, gradients, _, _ = shooting.slopes(point).projected()
    return replace(point, by_window=by_window, gradients=gradients)


def _covariance(problem: Problem, fit: Fit) -> FloatArray:
    """(P, P) of the coordinates: the larger of the model's own and that of the windows' scatter."""
    inverse = _inverse(fit.information)
    ratio = np.ones(len(inverse))
    for gradients in (fit.gradients, _by_runs(problem, fit.gradients)):
        sandwich = inverse @ _scatter(gradients) @ inverse
        ratio = np.maximum(ratio, np.diag(sandwich) / np.maximum(np.diag(inverse), TINY))
    return np.asarray(inverse * np.sqrt(np.outer(ratio, ratio)))


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


def _inverse(information: FloatArray) -> FloatArray:
    """Of coordinates of whatever size, scaled to a unit diagonal; an open direction keeps a little information."""
    scale = np.sqrt(np.maximum(np.diag(information), TINY))
    values, vectors = np.linalg.eigh(information / np.outer(scale, scale))
    values = np.maximum(values, OPEN * max(float(values[-1]), 1.0))
    return np.asarray((vectors / values) @ vectors.T / np.outer(scale, scale))


def _numerical_shift(problem: Problem, fit: Fit) -> FloatArray:
    """(P,) how far one Gauss-Newton step moves the coordinates on a grid twice as fine."""
    if fit.hypothesis.scheme != "fine":
        return np.zeros(len(fit.z))
    fine = _with_slopes(replace(problem, substeps=2 * problem.substeps), fit)
    here = _with_slopes(problem, fit)
    moved = fine.gradients.sum(axis=0) - here.gradients.sum(axis=0)
    return np.asarray(_inverse(fit.information) @ moved)
