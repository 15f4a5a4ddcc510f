"""Fitting a curve: Gauss-Newton with start states projected out, and a price for bends and for leaving the law.

P-splines (Eilers and Marx 1996). How dear bends are is chosen by leaving out blocks of neighbouring windows, because
what is left over is correlated within one: a curve that follows one block's chance errs in another.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np
from scipy.special import ndtri

from gpsim.channels import FloatArray
from gpsim.diagnosis.fitting import Fit, Problem, Step, damped_step, jacobians, projected, window_costs
from gpsim.diagnosis.form.widened import Widened
from gpsim.diagnosis.settings import schedules

BLOCKS = 8  # blocks of neighbouring windows, each left out once to choose how smooth a curve is
SMOOTHNESS_WEIGHTS = (-8.0, -6.0, -4.5, -3.0, -1.5, 0.0, 2.0)
"""Logarithms to base 10 of the weights of a curve's bends, in parts of what the data say."""
SHRINKAGE_WEIGHTS = (-6.0, -4.0, -2.0, 0.0, 3.0)
"""Logarithms to base 10 of the weights of a curve's distance from the law, in parts of what the data say."""

BAND = float(ndtri(0.95))  # standard deviations: a 90 % interval
STEPS = (1.0, 0.5, 0.25, 0.1)  # of a Gauss-Newton step: the best of them is taken
SINGULAR = 1e-9  # of the diagonal: directions that nothing determines stand still


@dataclass(frozen=True)
class Curved:
    """A curve's fit.

    theta: (P,); covariance: (F, F) of its coefficients, inflated by how much blocks scatter; freedom: its effective
    parameters (Hastie and Tibshirani 1990), those of the laws that it deviates from not among them.
    """

    theta: FloatArray
    covariance: FloatArray
    freedom: float


@dataclass(frozen=True)
class Departure:
    """How far a curve is from the laws, over what was visited, in parts of what they do; with its 90 % interval."""

    size: float
    low: float
    high: float


def departure(curve: Widened, fitted: Curved) -> Departure:
    """Root mean square of the curve's difference; its interval is a quadratic form's, the bias off the lower end."""
    c, gram = fitted.theta[curve.free], curve.design.T @ curve.design / len(curve.design)
    square, slope = float(c @ gram @ c), gram @ c
    bias = float(np.trace(gram @ fitted.covariance))
    reach = BAND * 2.0 * float(np.sqrt(max(float(slope @ fitted.covariance @ slope), 0.0)))
    ends = (square, square - bias - reach, square + reach)
    return Departure(*(float(np.sqrt(max(end, 0.0))) / curve.scale for end in ends))


@dataclass(frozen=True)
class _Quadratic:
    """The log likelihood around theta, block by block: information (K, P, P) and gradient (K, P)."""

    information: FloatArray
    gradient: FloatArray
    theta: FloatArray


def penalised(problem: Problem, start: Fit, curve: Widened) -> Curved:
    """Fit all parameters of a widened hypothesis around the fit `start` of the laws to the problem's windows."""
    settings, hypothesis = problem.run.settings.form, curve.hypothesis
    theta, starts = hypothesis.theta, start.starts
    bounds = np.array([(p.low, p.high) for p in hypothesis.parameters]).T
    residual = problem.residuals(hypothesis, theta[None], starts[None])[0]
    none, variance = np.zeros(len(starts)), start.variance
    for _ in range(settings.rounds):
        by_state, by_theta = jacobians(problem, hypothesis, theta, starts, residual)
        around = _in_blocks(problem, residual, by_state, by_theta, variance, theta)
        penalty, freest = _chosen(around, curve)
        goal = np.clip(_solved(around.information.sum(0), around.gradient.sum(0), penalty, theta), *bounds)
        step = damped_step(problem, residual, by_state, by_theta, variance, 0.0, none, theta, *bounds)
        thetas = np.array([theta + share * (goal - theta) for share in STEPS])
        moved, got = _with_starts(problem, curve, thetas, starts, step, theta, variance)
        prices = np.array([_price(penalty, new) for new in (*thetas, theta)])
        costs = window_costs(problem, np.concatenate([got, residual[None]]), variance).sum(axis=1) + prices
        best = int(np.argmin(costs[:-1]))
        if not costs[best] < costs[-1]:
            break
        theta, starts, residual = thetas[best], moved[best], got[best]
        if costs[-1] - costs[best] < schedules.CLOSE:
            break
    return Curved(theta, _covariance(around, freest, curve), _freedom(around, penalty, curve))


def _with_starts(
    problem: Problem,
    curve: Widened,
    thetas: FloatArray,
    starts: FloatArray,
    step: Step,
    theta: FloatArray,
    variance: FloatArray,
) -> tuple[FloatArray, FloatArray]:
    """(C, W, S) the start states that suit each of thetas (C, P) best, and the residuals (C, W, L + 1, S) from there.

    Every window has its own: as it follows theta, with its own step too, or where it stood. Where friction holds a body
    what a start state changes is no line.
    """
    follows = np.stack([starts + step.starts_by_theta @ (new - theta) for new in thetas])
    tried = np.concatenate([follows, follows + step.starts_alone, np.broadcast_to(starts, follows.shape)])
    got = problem.residuals(curve.hypothesis, np.tile(thetas, (3, 1)), tried)
    costs = window_costs(problem, got, variance).reshape(3, len(thetas), -1)
    pick = len(thetas) * np.argmin(costs, axis=0) + np.arange(len(thetas))[:, None]
    windows = np.arange(len(starts))
    return tried[pick, windows], got[pick, windows]


def _in_blocks(
    problem: Problem,
    residual: FloatArray,
    by_state: FloatArray,
    by_theta: FloatArray,
    variance: FloatArray,
    theta: FloatArray,
) -> _Quadratic:
    windows = projected(problem, residual, by_state, by_theta, variance, np.zeros(len(residual)))
    blocks = np.array_split(np.arange(len(residual)), BLOCKS)
    information, gradient = (np.stack([part[b].sum(axis=0) for b in blocks]) for part in windows)
    return _Quadratic(information, gradient, theta)


def _chosen(around: _Quadratic, curve: Widened) -> tuple[FloatArray, FloatArray]:
    """(P, P) the penalty with which the other blocks tell most of what a block left out says.

    And the best of those that shrink a curve to the law least: how well the data know it is seen with that.
    """
    rest = around.information.sum(0) - around.information, around.gradient.sum(0) - around.gradient
    free = min(SHRINKAGE_WEIGHTS)
    found = []
    for shrinkage, penalty in _penalties(around, curve):
        steps = _solved(*rest, penalty, around.theta) - around.theta
        said = np.einsum("kp,kpq,kq->", steps, around.information, steps)
        found.append((float(0.5 * said - (around.gradient * steps).sum()), shrinkage == free, penalty))
    chosen = min(found, key=lambda one: one[0])  # of equals the first, which is the heaviest
    return chosen[2], min((one for one in found if one[1]), key=lambda one: one[0])[2]


def _penalties(around: _Quadratic, curve: Widened) -> list[tuple[float, FloatArray]]:
    """All of the grid, (P, P) each after its power of shrinkage, the heaviest first.

    Weights are parts of what the data say of the curve.
    """
    told = float(np.trace(around.information.sum(0)[curve.free, curve.free]))
    own = curve.penalties()
    sizes = np.array([told / max(float(np.trace(p)), 1e-300) for p in own])
    grids = [SMOOTHNESS_WEIGHTS, SHRINKAGE_WEIGHTS, SMOOTHNESS_WEIGHTS][: len(own)]
    every = product(*(sorted(grid, reverse=True) for grid in grids))
    return [(powers[1], _weighed(around, curve, own, 10.0 ** np.array(powers) * sizes)) for powers in every]


def _weighed(
    around: _Quadratic, curve: Widened, parts: Sequence[FloatArray], weights: FloatArray
) -> FloatArray:
    whole: FloatArray = np.zeros(around.information[0].shape)
    for weight, part in zip(weights, parts, strict=True):
        whole[curve.free, curve.free] += weight * part
    return whole


def _solved(
    information: FloatArray, gradient: FloatArray, penalty: FloatArray, theta: FloatArray
) -> FloatArray:
    """(..., P): theta at the least of the quadratic and half theta' penalty theta; (..., P, P) and (..., P) of it."""
    normal = information + penalty
    size = _sizes(normal)
    scaled = normal / (size[..., :, None] * size[..., None, :]) + SINGULAR * np.eye(size.shape[-1])
    step = np.linalg.solve(scaled, ((gradient - penalty @ theta) / size)[..., None])[..., 0] / size
    return np.asarray(theta + step)


def _sizes(normal: FloatArray) -> FloatArray:
    """(..., P) with which (..., P, P) has a unit diagonal; 1 for what nothing is known of."""
    diagonal = np.einsum("...ii->...i", normal)
    return np.asarray(np.sqrt(np.where(diagonal > 0.0, diagonal, 1.0)))


def _price(penalty: FloatArray, theta: FloatArray) -> float:
    return float(0.5 * theta @ penalty @ theta)


def _freedom(around: _Quadratic, penalty: FloatArray, curve: Widened) -> float:
    """The trace of what the penalty leaves of the curve's part of the information, all else fitted along."""
    total = around.information.sum(0)
    normal = total + penalty
    size = _sizes(normal)
    scaled = normal / np.outer(size, size) + SINGULAR * np.eye(len(size))
    taken = np.linalg.solve(scaled, (penalty / np.outer(size, size))[:, curve.free])
    return float(curve.basis.size - np.trace(taken[curve.free]))


def _covariance(around: _Quadratic, penalty: FloatArray, curve: Widened) -> FloatArray:
    """The posterior's of the coefficients, times how much more blocks scatter than white noise would make them."""
    total = around.information.sum(0)
    normal = total + penalty
    size = _sizes(normal)
    inverse = np.linalg.inv(normal / np.outer(size, size) + SINGULAR * np.eye(len(size)))
    inverse /= np.outer(size, size)
    step = _solved(total, around.gradient.sum(0), penalty, around.theta) - around.theta
    there = around.gradient - around.information @ step
    apart = there - there.mean(axis=0)
    more = len(apart) / (len(apart) - 1) * float(np.einsum("ki,ij,kj->", apart, inverse, apart))
    inflation = max(1.0, more / max(float(np.trace(inverse @ total)), 1e-300))
    return np.asarray(inflation * inverse[curve.free, curve.free])
