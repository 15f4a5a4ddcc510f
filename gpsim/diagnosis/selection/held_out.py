"""What held-out windows say of a hypothesis that was fitted on others."""

from __future__ import annotations

import numpy as np
from scipy.special import stdtr

from gpsim.channels import FloatArray
from gpsim.diagnosis.fitting import Fit, Hypothesis, Problem, fit, window_costs
from gpsim.diagnosis.run import kept
from gpsim.diagnosis.settings import schedules

PLAIN_GAIN = 50.0
"""Nats of gain on training windows, from which on only a sure loss on held-out ones speaks against a term.

A pendulum's friction, 100 nats, was lost for one push by hand.
"""
SURE_LOSS = 0.05  # chance of such a loss where nothing is lost, below which it is sure


def held_out_objective(problem: Problem, hypothesis: Hypothesis) -> float:
    """Negative log likelihood of windows whose start states alone are fitted; 0 where there are none."""
    if not len(problem.windows):
        return 0.0
    return held_out_fit(problem, hypothesis).objective


@kept
def held_out_fit(problem: Problem, hypothesis: Hypothesis, known: FloatArray | None = None) -> Fit:
    """The hypothesis as it is on windows whose start states alone are fitted. known: see `fit`."""
    starts = problem.windows.measured[:, 0]
    return fit(problem, hypothesis.frozen(), starts, iterations=schedules.SETTLE, known=known)


def contradicted(held_out: Problem, richer: Fit, poorer: Fit, won: float, pardoned: float) -> bool:
    """Whether held-out windows speak against what the richer of two fits to them adds.

    It loses `pardoned` nats or more there. Where it `won` many nats on training windows the loss must also be sure: one
    moment in which somebody pushed the machine contradicts no law.
    """
    if richer.objective - poorer.objective < pardoned:
        return False
    return won < PLAIN_GAIN or chance_of(_losses(held_out, richer, poorer)) < SURE_LOSS


def _losses(held_out: Problem, richer: Fit, poorer: Fit) -> FloatArray:
    """(W,) nats that the richer fit loses in each window, by the noise of the poorer one."""
    lost, kept = (window_costs(held_out, f.residuals[None], poorer.variance)[0] for f in (richer, poorer))
    return np.asarray(lost - kept)


def chance_of(losses: FloatArray) -> float:
    """How probable losses as these (W,) are where nothing is lost on average: a one-sided test of Student (1908).

    Neighbouring windows show the same motion. So their sums are compared, over blocks of the cube root of their number
    (Kuensch 1989). 1 of fewer than two.
    """
    block = max(1, round(len(losses) ** (1 / 3)))
    sums = np.array([losses[first : first + block].sum() for first in range(0, len(losses), block)])
    if len(sums) < 2:
        return 1.0
    scatter = float(sums.std(ddof=1)) / np.sqrt(len(sums))
    return float(stdtr(len(sums) - 1, -float(sums.mean()) / max(scatter, 1e-300)))
