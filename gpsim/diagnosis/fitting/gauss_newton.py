"""The linearised problem: finite-difference Jacobians, start states projected out, the damped Gauss-Newton step.

Golub and Pereyra (1973), variable projection for separable least squares; damping after Marquardt (1963), for each
window's start state by itself.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gpsim.channels import FloatArray
from gpsim.diagnosis.fitting.hypothesis import Hypothesis
from gpsim.diagnosis.fitting.problem import Problem, variance_of

STATE_STEP = 1e-5  # finite difference of a start state, in parts of the channel's typical size
PARAMETER_STEP = 1e-4  # finite difference of a smooth parameter, in parts of its typical size


@dataclass(frozen=True)
class Step:
    """A Gauss-Newton step of theta, and how the start states go with it."""

    theta: FloatArray  # (P,)
    starts_by_theta: FloatArray  # (W, S, P) how starts follow theta
    starts_alone: FloatArray  # (W, S) with theta standing


def jacobians(
    problem: Problem,
    hypothesis: Hypothesis,
    theta: FloatArray,
    starts: FloatArray,
    residual: FloatArray,
    *,
    states_only: bool = False,
    by_state: FloatArray | None = None,
) -> tuple[FloatArray, FloatArray]:
    """D residual / d start (W, L + 1, S, S) and d residual / d theta (W, L + 1, S, P), by forward differences.

    by_state: the former, where it is known well enough.
    """
    dimension = starts.shape[1] if by_state is None else 0
    size = 0 if states_only else theta.size
    if by_state is not None and not size:
        return by_state, np.empty((*residual.shape, 0))
    if (rough := problem.slopes) is not problem:
        problem, residual = rough, rough.residuals(hypothesis, theta[None], starts[None])[0]
    thetas = np.tile(theta, (dimension + size, 1))
    copies = np.tile(starts, (dimension + size, 1, 1))
    steps = np.empty(dimension + size)
    for i in range(dimension):
        steps[i] = STATE_STEP * problem.scale[i]
        copies[i, :, i] += steps[i]
    for j, parameter in enumerate(hypothesis.parameters[:size]):
        step = parameter.step or PARAMETER_STEP * parameter.scale
        steps[dimension + j] = step if theta[j] + step <= parameter.high else -step
        thetas[dimension + j, j] += steps[dimension + j]
    moved = problem.residuals(hypothesis, thetas, copies)
    slopes = np.moveaxis((moved - residual[None]) / steps[:, None, None, None], 0, -1)
    return slopes[..., :dimension] if by_state is None else by_state, slopes[..., dimension:]


def state_jacobian(
    problem: Problem, hypothesis: Hypothesis, starts: FloatArray, residual: FloatArray
) -> FloatArray:
    """(W, L + 1, S, S): D residual / d start state."""
    return jacobians(problem, hypothesis, hypothesis.theta, starts, residual, states_only=True)[0]


def projected(
    problem: Problem,
    residual: FloatArray,
    by_state: FloatArray,
    by_theta: FloatArray,
    variance: FloatArray,
    damping: FloatArray,
) -> tuple[FloatArray, FloatArray]:
    """Information (W, P, P) on theta and gradient (W, P) of each window with its start state projected out."""
    r, js, jt = _whitened(problem, residual, by_state, by_theta, variance)
    cross = js.transpose(0, 2, 1) @ jt
    solved = _inverse_gram(js, damping) @ np.concatenate(
        [cross, js.transpose(0, 2, 1) @ r[..., None]], axis=2
    )
    information = jt.transpose(0, 2, 1) @ jt - cross.transpose(0, 2, 1) @ solved[..., :-1]
    gradient = -(jt.transpose(0, 2, 1) @ r[..., None] - cross.transpose(0, 2, 1) @ solved[..., -1:])[..., 0]
    return information, gradient


def damped_step(
    problem: Problem,
    residual: FloatArray,
    by_state: FloatArray,
    by_theta: FloatArray,
    variance: FloatArray,
    damping: float,
    per_window: FloatArray,
    theta: FloatArray,
    low: FloatArray,
    high: FloatArray,
) -> Step:
    """The damped Gauss-Newton step; parameters that a bound holds stand still."""
    r, js, jt = _whitened(problem, residual, by_state, by_theta, variance)
    inverse = _inverse_gram(js, per_window)
    alone = -(inverse @ (js.transpose(0, 2, 1) @ r[..., None]))[..., 0]
    follow = -inverse @ (js.transpose(0, 2, 1) @ jt)
    if not theta.size:
        return Step(theta, follow, alone)
    information, gradients = projected(problem, residual, by_state, by_theta, variance, per_window)
    step = _damped(information.sum(axis=0), gradients.sum(axis=0), damping, theta, low, high)
    return Step(step, follow, alone)


def promised_gain(
    problem: Problem,
    residual: FloatArray,
    by_state: FloatArray,
    by_theta: FloatArray,
    theta: FloatArray,
    low: FloatArray,
    high: FloatArray,
) -> float:
    """What a step of theta without any damping would gain if all were linear [nats]."""
    if not theta.size:
        return 0.0
    none = np.zeros(len(residual))
    variance = variance_of(problem, residual)
    information, gradients = projected(problem, residual, by_state, by_theta, variance, none)
    b = gradients.sum(axis=0)
    return float(0.5 * b @ _damped(information.sum(axis=0), b, 0.0, theta, low, high))


def _damped(
    a: FloatArray, b: FloatArray, damping: float, theta: FloatArray, low: FloatArray, high: FloatArray
) -> FloatArray:
    """(P,): the step that solves a step = b, scaled to a unit diagonal; what a bound holds stands still."""
    free = ~(((theta <= low) & (b < 0)) | ((theta >= high) & (b > 0)))
    step = np.zeros_like(theta)
    if free.any():
        sub = a[np.ix_(free, free)]
        scale = np.sqrt(np.maximum(np.diag(sub), 1e-300))
        normal = sub / np.outer(scale, scale) + (damping + 1e-12) * np.eye(int(free.sum()))
        step[free] = np.linalg.solve(normal, b[free] / scale) / scale
    return step


def _whitened(
    problem: Problem, residual: FloatArray, by_state: FloatArray, by_theta: FloatArray, variance: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Residual (W, M) and Jacobians (W, M, .) in standard deviations, only observed channels."""
    seen = problem.observed
    sd = np.sqrt(variance[seen])
    count = len(residual)
    r = (residual[..., seen] / sd).reshape(count, -1)
    js = (by_state[:, :, seen] / sd[:, None]).reshape(count, r.shape[1], -1)
    jt = (by_theta[:, :, seen] / sd[:, None]).reshape(count, r.shape[1], -1)
    return r, js, jt


def _inverse_gram(js: FloatArray, damping: FloatArray) -> FloatArray:
    """(W, S, S): the damped inverse of the start states' normal matrix, which is scaled to a unit diagonal first.

    Channels may differ by twelve orders of magnitude in how well they are known.
    """
    gram = js.transpose(0, 2, 1) @ js
    size = np.sqrt(np.einsum("wii->wi", gram))
    size = np.where(size > 0, size, 1.0)
    scaled = gram / (size[:, :, None] * size[:, None, :])
    diagonal = np.einsum("wii->wi", scaled)
    diagonal[:] = np.maximum(diagonal, 1e-12) * (1.0 + damping[:, None] + 1e-12)
    return np.asarray(np.linalg.inv(scaled) / (size[:, :, None] * size[:, None, :]))
