"""Multiple shooting: fit a hypothesis to windows, each window's start state estimated along with the parameters.

Bock (1981), "Numerical treatment of inverse problems in chemical reaction kinetics"; the start states are eliminated
by projection, with Levenberg-Marquardt damping and acceptance per window, because one window near a discontinuity
must not hold up all others.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gpsim.channels import FloatArray
from gpsim.diagnosis.fitting.descent import Descent
from gpsim.diagnosis.fitting.gauss_newton import jacobians, projected, state_jacobian
from gpsim.diagnosis.fitting.hypothesis import Hypothesis
from gpsim.diagnosis.fitting.problem import Problem, variance_of
from gpsim.effects import closed

MOST_ITERATIONS = 25  # most steps of a fit that is made to its end
TOLERANCE = 0.02  # a step that gains less ends such a fit [nats]


@dataclass(frozen=True)
class Fit:
    """A fitted hypothesis.

    residuals: (W, L + 1, S); starts: (W, S); variance: (S,) of the residual, floor included; objective: negative log
    likelihood in nats, up to a constant of the data; converged: whether it stood still; covariance: (P, P) of theta,
    where something else than these windows says it.
    """

    hypothesis: Hypothesis
    starts: FloatArray
    residuals: FloatArray
    variance: FloatArray
    objective: float
    converged: bool
    covariance: FloatArray | None = None


@dataclass(frozen=True)
class Curvature:
    """The log likelihood around a fit, start states projected out: information (P, P), gradients (W, P) by window."""

    information: FloatArray
    gradients: FloatArray

    @property
    def variance(self) -> FloatArray:
        """(P,) of the estimate: the windows' scatter where that is more than the model says (White 1982)."""
        inverse = np.linalg.pinv(self.information)
        sandwich = inverse @ self.gradients.T @ self.gradients @ inverse
        return np.asarray(np.maximum(np.diag(inverse), np.diag(sandwich)))


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
    descent = Descent(problem, hypothesis, starts, near=near, known=known)
    converged = False
    for round_ in range(MOST_ITERATIONS if iterations is None else iterations):
        descent.search(round_)
        descent.look(round_)
        gain = descent.step()
        if descent.stands(gain, TOLERANCE if tolerance is None else tolerance):
            converged = True
            break
    at = descent.at
    variance = variance_of(problem, at.residual)
    return Fit(hypothesis.having(at.theta), at.starts, at.residual, variance, at.value, converged)


def start_slopes(
    problem: Problem, hypothesis: Hypothesis, starts: FloatArray | None = None
) -> FloatArray | None:
    """Slopes of residuals by start states (W, L + 1, S, S), for all that differ in a term; None where that is cheap.

    starts: (W, S), as measured where none are given.
    """
    if closed(problem.simulator) is None:
        return None
    starts = problem.windows.measured[:, 0] if starts is None else starts
    residuals = problem.residuals(hypothesis, hypothesis.theta[None], starts[None])[0]
    return state_jacobian(problem, hypothesis, starts, residuals)


def curvature(problem: Problem, fit: Fit) -> Curvature:
    """Around a fit to the problem's windows, or to the same windows on another grid; the noise model stands."""
    theta = fit.hypothesis.theta
    residual = problem.residuals(fit.hypothesis, theta[None], fit.starts[None])[0]
    by_state, by_theta = jacobians(problem, fit.hypothesis, theta, fit.starts, residual)
    informations, gradients = projected(
        problem, residual, by_state, by_theta, fit.variance, np.zeros(len(fit.starts))
    )
    return Curvature(informations.sum(axis=0), gradients)
