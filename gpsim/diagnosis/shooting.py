"""Multiple shooting: fit a hypothesis to windows, each window's start state estimated along with the parameters.

Bock (1981), "Numerical treatment of inverse problems in chemical reaction kinetics"; the start states are eliminated
by projection (Golub and Pereyra 1973, variable projection for separable least squares), with Levenberg-Marquardt
damping and acceptance per window, because one window near a discontinuity must not hold up all others.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from gpsim.channels import BoolArray, FloatArray, difference
from gpsim.diagnosis.hypothesis import Hypothesis
from gpsim.diagnosis.simulate import simulate
from gpsim.diagnosis.windows import Windows
from gpsim.simulators import Simulator

STEP_OF_STATE, STEP_OF_PARAMETER = 1e-5, 1e-4  # finite differences, in units of the typical size
TRIALS = (1.0,)  # shares of a Gauss-Newton step that are tried beside none of it
PATIENCE = 4  # rejected steps in a row, each more cautious, before a fit is taken to stand still
PATTERN_ROUNDS = (1, 3, 5, 8)
PATTERN = (
    12.0,
    8.0,
    4.0,
    2.0,
    1.0,
    0.5,
    0.25,
    0.1,
    0.04,
)  # finite-difference steps that a pattern search reaches


@dataclass(frozen=True)
class Problem:
    """Windows to explain.

    observed: (S,) which channels were measured; floor: (S,) the least standard deviation of what a perfect hypothesis
    leaves over (known noise, numerical error); scale: (S,) typical size of each channel.
    """

    simulator: Simulator
    parameters: Mapping[str, float]
    dt: float
    windows: Windows
    observed: BoolArray
    floor: FloatArray
    scale: FloatArray
    substeps: int

    @cached_property
    def counts(self) -> FloatArray:
        """(S,) degrees of freedom of each observed channel's residual, the start states taken off."""
        samples = float(self.windows.valid.sum())
        spent = len(self.windows) * len(self.simulator.state) / max(int(self.observed.sum()), 1)
        return np.where(self.observed, max(samples - spent, 1.0), 0.0)

    def on(self, windows: Windows) -> Problem:
        """The same question to other windows."""
        return replace(self, windows=windows)

    def residuals(self, hypothesis: Hypothesis, thetas: FloatArray, starts: FloatArray) -> FloatArray:
        """(C, W, L + 1, S) measured minus simulated for thetas (C, P), starts (C, W, S); 0 where nothing was seen."""
        chain = hypothesis.chain(self.simulator, self.parameters, self.dt)
        said = simulate(chain, self.windows, starts, hypothesis.spread, thetas, self.substeps)
        residual = difference(self.windows.measured[None], said, self.simulator.state)
        residual *= self.windows.valid[None, :, :, None] & self.observed
        return residual


@dataclass(frozen=True)
class Fit:
    """A fitted hypothesis.

    residuals: (W, L + 1, S); starts: (W, S); variance: (S,) of the residual, floor included; objective: negative log
    likelihood in nats, up to a constant of the data. informations (W, P, P) and gradients (W, P) of each window, start
    states projected out; information: (P, P) their sum; converged: whether it stood still.
    """

    hypothesis: Hypothesis
    starts: FloatArray
    residuals: FloatArray
    variance: FloatArray
    objective: float
    information: FloatArray
    gradients: FloatArray
    informations: FloatArray
    converged: bool


def fit(
    problem: Problem,
    hypothesis: Hypothesis,
    starts: FloatArray,
    *,
    iterations: int = 25,
    tolerance: float = 0.02,
) -> Fit:
    """Minimise the profile likelihood over theta (from the hypothesis's values) and the start states (W, S)."""
    low, high = _bounds(hypothesis)
    theta, starts = np.clip(hypothesis.theta, low, high), np.array(starts)
    residual = problem.residuals(hypothesis, theta[None], starts[None])[0]
    variance = variance_of(problem, residual)
    value = objective(problem, residual)
    damping, per_window = 1e-3, np.full(len(starts), 1e-3)
    converged, still = False, 0
    for round_ in range(iterations):
        if round_ in PATTERN_ROUNDS and any(p.step for p in hypothesis.parameters):
            theta, starts, residual = _searched_pattern(
                problem, hypothesis, theta, starts, residual, low, high
            )
            value, variance = objective(problem, residual), variance_of(problem, residual)
        by_state, by_theta = _jacobians(problem, hypothesis, theta, starts, residual)
        step = _steps(problem, residual, by_state, by_theta, variance, damping, per_window, theta, low, high)
        tried = _try_steps(problem, hypothesis, theta, starts, residual, variance, step, low, high)
        gain = value - tried.value
        moved = tried.theta is not None
        per_window = np.clip(np.where(tried.stepped, per_window / 5, per_window * 8), 1e-9, 1e6)
        damping = float(np.clip(damping / 5 if moved else damping * 8, 1e-9, 1e6))
        if gain > 0:
            theta = tried.theta if tried.theta is not None else theta
            starts, residual, value = tried.starts, tried.residual, tried.value
            variance = variance_of(problem, residual)
        still = 0 if gain >= tolerance else still + 1
        if (moved and still >= 1) or still >= (PATIENCE if theta.size else 2):
            converged = True
            break
    by_state, by_theta = _jacobians(problem, hypothesis, theta, starts, residual)
    informations, gradients = _projected(
        problem, residual, by_state, by_theta, variance, np.full(len(starts), 1e-9)
    )
    chosen, information = hypothesis.having(theta), informations.sum(axis=0)
    return Fit(chosen, starts, residual, variance, value, information, gradients, informations, converged)


def state_jacobian(
    problem: Problem, hypothesis: Hypothesis, starts: FloatArray, residual: FloatArray
) -> FloatArray:
    """(W, L + 1, S, S): d residual / d start state."""
    return _jacobians(problem, hypothesis, hypothesis.theta, starts, residual, states_only=True)[0]


def gradient_at(problem: Problem, fit: Fit) -> FloatArray:
    """(P,) the log likelihood's gradient at a fit made on another grid, the noise model standing."""
    theta = fit.hypothesis.theta
    residual = problem.residuals(fit.hypothesis, theta[None], fit.starts[None])[0]
    by_state, by_theta = _jacobians(problem, fit.hypothesis, theta, fit.starts, residual)
    small = np.full(len(fit.starts), 1e-9)
    return np.asarray(_projected(problem, residual, by_state, by_theta, fit.variance, small)[1].sum(axis=0))


def variance_of(problem: Problem, residual: FloatArray) -> FloatArray:
    """(S,) mean square of the residual per degree of freedom, at least the floor's."""
    square = (residual**2).sum(axis=(0, 1)) / np.maximum(problem.counts, 1.0)
    return np.asarray(np.maximum(square, problem.floor**2))


def objective(problem: Problem, residual: FloatArray) -> float:
    """Negative log likelihood in nats with each channel's variance profiled out (floored)."""
    square = (residual**2).sum(axis=(0, 1)) / np.maximum(problem.counts, 1.0)
    variance = np.maximum(square, problem.floor**2)
    terms = problem.counts / 2 * (np.log(variance) + square / variance)
    return float(terms[problem.observed].sum())


@dataclass(frozen=True)
class _Step:
    theta: FloatArray  # (P,)
    starts: FloatArray  # (W, S) with theta moving along
    starts_by_theta: FloatArray  # (W, S, P) how starts follow theta
    starts_alone: FloatArray  # (W, S) with theta standing


@dataclass(frozen=True)
class _Tried:
    theta: FloatArray | None
    starts: FloatArray
    residual: FloatArray
    value: float
    stepped: BoolArray


def _bounds(hypothesis: Hypothesis) -> tuple[FloatArray, FloatArray]:
    parameters = hypothesis.parameters
    return np.array([p.low for p in parameters], dtype=float), np.array(
        [p.high for p in parameters], dtype=float
    )


def _jacobians(
    problem: Problem,
    hypothesis: Hypothesis,
    theta: FloatArray,
    starts: FloatArray,
    residual: FloatArray,
    *,
    states_only: bool = False,
) -> tuple[FloatArray, FloatArray]:
    """D residual / d start (W, L + 1, S, S) and d residual / d theta (W, L + 1, S, P), by forward differences."""
    dimension = starts.shape[1]
    size = 0 if states_only else theta.size
    thetas = np.tile(theta, (dimension + size, 1))
    copies = np.tile(starts, (dimension + size, 1, 1))
    steps = np.empty(dimension + size)
    for i in range(dimension):
        steps[i] = STEP_OF_STATE * problem.scale[i]
        copies[i, :, i] += steps[i]
    for j, parameter in enumerate(hypothesis.parameters[:size]):
        step = parameter.step or STEP_OF_PARAMETER * parameter.scale
        steps[dimension + j] = step if theta[j] + step <= parameter.high else -step
        thetas[dimension + j, j] += steps[dimension + j]
    moved = problem.residuals(hypothesis, thetas, copies)
    slopes = np.moveaxis((moved - residual[None]) / steps[:, None, None, None], 0, -1)
    return slopes[..., :dimension], slopes[..., dimension:]


def _projected(
    problem: Problem,
    residual: FloatArray,
    by_state: FloatArray,
    by_theta: FloatArray,
    variance: FloatArray,
    damping: FloatArray,
) -> tuple[FloatArray, FloatArray]:
    """Information (W, P, P) on theta and gradient (W, P) of each window with its start state projected out."""
    r, js, jt = _whitened(problem, residual, by_state, by_theta, variance)
    gram, cross = _gram(js, damping), js.transpose(0, 2, 1) @ jt
    solved = np.linalg.solve(gram, np.concatenate([cross, js.transpose(0, 2, 1) @ r[..., None]], axis=2))
    information = jt.transpose(0, 2, 1) @ jt - cross.transpose(0, 2, 1) @ solved[..., :-1]
    gradient = -(jt.transpose(0, 2, 1) @ r[..., None] - cross.transpose(0, 2, 1) @ solved[..., -1:])[..., 0]
    return information, gradient


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


def _gram(js: FloatArray, damping: FloatArray) -> FloatArray:
    gram = js.transpose(0, 2, 1) @ js
    diagonal = np.einsum("wii->wi", gram)
    diagonal += damping[:, None] * diagonal + 1e-12 * diagonal.max(axis=1, keepdims=True) + 1e-300
    return gram


def _steps(
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
) -> _Step:
    """The damped Gauss-Newton step; parameters that a bound holds stand still."""
    r, js, jt = _whitened(problem, residual, by_state, by_theta, variance)
    gram = _gram(js, per_window)
    inverse = np.linalg.inv(gram)
    alone = -(inverse @ (js.transpose(0, 2, 1) @ r[..., None]))[..., 0]
    follow = -inverse @ (js.transpose(0, 2, 1) @ jt)
    if not theta.size:
        return _Step(theta, alone, follow, alone)
    information, gradients = _projected(problem, residual, by_state, by_theta, variance, per_window)
    a, b = information.sum(axis=0), gradients.sum(axis=0)
    free = ~(((theta <= low) & (b < 0)) | ((theta >= high) & (b > 0)))
    step = np.zeros_like(theta)
    if free.any():
        sub = a[np.ix_(free, free)]
        scale = np.sqrt(np.maximum(np.diag(sub), 1e-300))
        normal = sub / np.outer(scale, scale) + (damping + 1e-12) * np.eye(int(free.sum()))
        step[free] = np.linalg.solve(normal, b[free] / scale) / scale
    return _Step(step, alone + follow @ step, follow, alone)


def _try_steps(
    problem: Problem,
    hypothesis: Hypothesis,
    theta: FloatArray,
    starts: FloatArray,
    residual: FloatArray,
    variance: FloatArray,
    step: _Step,
    low: FloatArray,
    high: FloatArray,
) -> _Tried:
    """Try shares of the step and theta standing still; every window keeps the start state that suits it better."""
    shares = (*TRIALS, 0.0) if theta.size else (0.0,)
    anchor = problem.windows.measured[:, 0]
    thetas: list[FloatArray] = []
    copies: list[FloatArray] = []
    groups: list[tuple[FloatArray | None, int]] = []
    for share in shares:
        at = np.clip(theta + share * step.theta, low, high)
        follow = starts + step.starts_by_theta @ (at - theta)
        along = follow + step.starts_alone
        # What was measured is always worth a try: a start state that a worse theta led astray may be stuck there.
        groups.append((at if share else None, len(copies)))
        copies += [along, follow, anchor]
        thetas += [at] * 3
    got = problem.residuals(hypothesis, np.stack(thetas), np.stack(copies))
    costs = _window_costs(problem, got, variance)
    every, states = np.arange(len(starts)), np.stack(copies)
    best: _Tried | None = None
    for moved, first in groups:
        pick = first + np.argmin(costs[first : first + 3], axis=0)
        chosen = got[pick, every]
        tried = _Tried(moved, states[pick, every], chosen, objective(problem, chosen), pick == first)
        if best is None or tried.value < best.value:
            best = tried
    assert best is not None
    return best


def _searched_pattern(
    problem: Problem,
    hypothesis: Hypothesis,
    theta: FloatArray,
    starts: FloatArray,
    residual: FloatArray,
    low: FloatArray,
    high: FloatArray,
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Try parameters whose law jumps on both sides, far and near: derivatives do not lead out of a local minimum."""
    every = np.arange(len(starts))
    for j, parameter in enumerate(hypothesis.parameters):
        if parameter.step is None:
            continue
        for reach in PATTERN:
            options = np.tile(theta, (5, 1))
            options[1:, j] += reach * parameter.step * np.array([-1.0, -0.5, 0.5, 1.0])
            options = np.clip(options, low, high)
            states = np.tile(np.stack([starts, problem.windows.measured[:, 0]]), (5, 1, 1))
            got = problem.residuals(hypothesis, np.repeat(options, 2, axis=0), states)
            costs = _window_costs(problem, got, variance_of(problem, residual)).reshape(5, 2, -1)
            choice = np.argmin(costs, axis=1)
            picked = [got[2 * i + choice[i], every] for i in range(5)]
            best = int(np.argmin([objective(problem, p) for p in picked]))
            theta, residual = options[best], picked[best]
            starts = states[2 * best + choice[best], every]
    return theta, starts, residual


def _window_costs(problem: Problem, residual: FloatArray, variance: FloatArray) -> FloatArray:
    """(C, W) half the sum of squares in standard deviations."""
    cost: FloatArray = (residual[..., problem.observed] ** 2 / variance[problem.observed]).sum(
        axis=(2, 3)
    ) / 2
    return cost
