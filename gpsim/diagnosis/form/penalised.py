"""Fitting a curve: Gauss-Newton with start states projected out, and a price for bends and for leaving the law.

P-splines (Eilers and Marx 1996). How dear bends are is chosen by leaving out blocks of neighbouring windows, because
what is left over is correlated within one: a curve that follows one block's chance errs in another.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product

import numpy as np

from gpsim.channels import FloatArray
from gpsim.diagnosis.fitting import Fit, Problem, damped_step, jacobians, projected, window_costs
from gpsim.diagnosis.form.widened import Widened
from gpsim.diagnosis.settings import FormSettings

STEPS = (1.0, 0.5, 0.25, 0.1)  # of a Gauss-Newton step: the best of them is taken
SINGULAR = 1e-9  # of the diagonal: directions that nothing determines stand still


@dataclass(frozen=True)
class Curved:
    """A curve's fit. theta: (P,); covariance: (F, F) of its coefficients, inflated by how much blocks scatter."""

    theta: FloatArray
    covariance: FloatArray


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
        penalty = _chosen(around, curve, settings)
        goal = np.clip(_solved(around.information.sum(0), around.gradient.sum(0), penalty, theta), *bounds)
        follows = damped_step(
            problem, residual, by_state, by_theta, variance, 0.0, none, theta, bounds[0], bounds[1]
        )
        thetas = np.array([theta + share * (goal - theta) for share in STEPS])
        moved = np.stack(
            [starts + follows.starts_alone + follows.starts_by_theta @ (new - theta) for new in thetas]
        )
        got = problem.residuals(hypothesis, thetas, moved)
        costs = window_costs(problem, got, variance).sum(axis=1) + [_price(penalty, new) for new in thetas]
        best = int(np.argmin(costs))
        before = window_costs(problem, residual[None], variance).sum() + _price(penalty, theta)
        if not costs[best] < before:
            break
        theta, starts, residual = thetas[best], moved[best], got[best]
    return Curved(theta, _covariance(around, penalty, curve))


def _in_blocks(
    problem: Problem,
    residual: FloatArray,
    by_state: FloatArray,
    by_theta: FloatArray,
    variance: FloatArray,
    theta: FloatArray,
) -> _Quadratic:
    windows = projected(problem, residual, by_state, by_theta, variance, np.zeros(len(residual)))
    blocks = np.array_split(np.arange(len(residual)), problem.run.settings.form.blocks)
    information, gradient = (np.stack([part[b].sum(axis=0) for b in blocks]) for part in windows)
    return _Quadratic(information, gradient, theta)


def _chosen(around: _Quadratic, curve: Widened, settings: FormSettings) -> FloatArray:
    """(P, P): the penalty with which the other blocks tell most of what a block left out says."""
    best, chosen = np.inf, np.array(around.information[0])
    for penalty in _penalties(around, curve, settings):
        loss = 0.0
        for held in range(len(around.gradient)):
            rest = np.arange(len(around.gradient)) != held
            goal = _solved(
                around.information[rest].sum(0), around.gradient[rest].sum(0), penalty, around.theta
            )
            step = goal - around.theta
            loss += float(0.5 * step @ around.information[held] @ step - around.gradient[held] @ step)
        if loss < best:
            best, chosen = loss, penalty
    return chosen


def _penalties(around: _Quadratic, curve: Widened, settings: FormSettings) -> list[FloatArray]:
    """All of the grid, the heaviest first: of equals it is taken. Weights are parts of the data's own information."""
    told = float(np.trace(around.information.sum(0)[curve.free, curve.free]))
    own = curve.penalties()
    sizes = [told / max(float(np.trace(p)), 1e-300) for p in own]
    grids = [settings.smoothness, settings.shrinkage, settings.smoothness][: len(own)]
    out = []
    for powers in product(*(sorted(grid, reverse=True) for grid in grids)):
        whole = np.zeros_like(around.information[0])
        for power, size, part in zip(powers, sizes, own, strict=True):
            whole[curve.free, curve.free] += 10.0**power * size * part
        out.append(whole)
    return out


def _solved(
    information: FloatArray, gradient: FloatArray, penalty: FloatArray, theta: FloatArray
) -> FloatArray:
    """(P,): theta at the least of the quadratic and half theta' penalty theta."""
    normal = information + penalty
    size = np.sqrt(np.maximum(np.diag(normal), 1e-300))
    scaled = normal / np.outer(size, size) + SINGULAR * np.eye(len(size))
    return np.asarray(theta + np.linalg.solve(scaled, (gradient - penalty @ theta) / size) / size)


def _price(penalty: FloatArray, theta: FloatArray) -> float:
    return float(0.5 * theta @ penalty @ theta)


def _covariance(around: _Quadratic, penalty: FloatArray, curve: Widened) -> FloatArray:
    """The posterior's of the coefficients, times how much more blocks scatter than white noise would make them."""
    total = around.information.sum(0)
    normal = total + penalty
    size = np.sqrt(np.maximum(np.diag(normal), 1e-300))
    inverse = np.linalg.inv(normal / np.outer(size, size) + SINGULAR * np.eye(len(size)))
    inverse /= np.outer(size, size)
    apart = around.gradient - around.gradient.mean(axis=0)
    more = len(apart) / (len(apart) - 1) * float(np.einsum("ki,ij,kj->", apart, inverse, apart))
    inflation = max(1.0, more / max(float(np.trace(inverse @ total)), 1e-300))
    return np.asarray(inflation * inverse[curve.free, curve.free])
