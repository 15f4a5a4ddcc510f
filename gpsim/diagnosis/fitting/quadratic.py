"""A fit's likelihood as a quadratic: what leaving terms out would cost, and where the others would go.

The Wald statistic (Wald 1943) and the conditional mean of a Gaussian, start states projected out. One set of slopes
answers for every subset of the terms, where each refit would need slopes of its own.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from gpsim.channels import FloatArray, IntArray
from gpsim.diagnosis.fitting.gauss_newton import jacobians, projected
from gpsim.diagnosis.fitting.hypothesis import Hypothesis
from gpsim.diagnosis.fitting.multiple_shooting import Fit, fit
from gpsim.diagnosis.fitting.problem import Problem
from gpsim.diagnosis.run import kept
from gpsim.effects import EffectParameter

OPEN = 1e-9  # of a parameter's information: what no window tells apart stays open, and costs nothing to leave out
RATIO_MOVES = 2.0  # scales, the standard deviation of a ratio where others are left out
TINY = 1e-150  # guards divisions: the root of the least information of a parameter


@dataclass(frozen=True)
class Quadratic:
    """Around a fit: how far each parameter is from doing nothing (P,), its covariance (P, P), and slopes by starts.

    information (W, P, P) and gradients (W, P) of each window, starts projected out; held: (P, P) beside them; rows: of
    each term in theta; smooth: whether no law of a term jumps or limits, so that the quadratic can be trusted.
    """

    fit: Fit
    away: FloatArray
    covariance: FloatArray
    by_state: FloatArray
    information: FloatArray
    gradients: FloatArray
    held: FloatArray
    rows: tuple[slice, ...]
    smooth: tuple[bool, ...]

    def cost(self, gone: Sequence[int]) -> float:
        """Nats that leaving out these terms would cost, all others adapted."""
        at = self._at(gone)
        return float(0.5 * self.away[at] @ np.linalg.solve(self._block(at), self.away[at]))

    def costs(self) -> FloatArray:
        """(T,) nats that leaving out each term alone would cost."""
        return np.array([self.cost([i]) for i in range(len(self.rows))])

    def without(self, gone: Sequence[int]) -> Hypothesis:
        """The hypothesis without these terms, the others where the quadratic is least then, within their bounds."""
        hypothesis, at = self.fit.hypothesis, self._at(gone)
        moved = hypothesis.theta - self.covariance[:, at] @ np.linalg.solve(self._block(at), self.away[at])
        adapted = self._having(moved)
        for index in sorted(gone, reverse=True):
            adapted = adapted.without(index)
        return adapted

    def learnt_from(self, windows: IntArray) -> Hypothesis:
        """The hypothesis as some of the windows alone say: one step from the fit to all of them, as a jackknife takes.

        Where a law jumps or limits stays.
        """
        theta, at = self.fit.hypothesis.theta, self._at([i for i, s in enumerate(self.smooth) if s])
        information = (self.information[windows].sum(axis=0) + self.held)[np.ix_(at, at)]
        step = np.zeros_like(theta)
        step[at] = _inverse(information) @ self.gradients[windows].sum(axis=0)[at]
        return self._having(theta + step)

    def refitted(self, problem: Problem, gone: Sequence[int], iterations: int) -> Fit:
        """The fit without these terms: parameters by the quadratic, start states fitted anew by known slopes."""
        less = self.without(gone)
        found = fit(problem, less.frozen(), self.fit.starts, iterations=iterations, known=self.by_state)
        return Fit(less, found.starts, found.residuals, found.variance, found.objective, found.converged)

    def _having(self, theta: FloatArray) -> Hypothesis:
        low, high = np.array([(p.low, p.high) for p in self.fit.hypothesis.parameters]).T
        return self.fit.hypothesis.having(np.clip(theta, low, high))

    def _at(self, gone: Sequence[int]) -> IntArray:
        every = np.arange(len(self.away))
        return np.concatenate([every[:0], *(every[self.rows[i]] for i in gone)])

    def _block(self, at: IntArray) -> FloatArray:
        return np.asarray(self.covariance[np.ix_(at, at)] + TINY * np.eye(len(at)))


def _held(parameter: EffectParameter) -> float:
    """A little information on a ratio: all forces, the mass and the gain at nothing would move as all of them do."""
    return 0.0 if parameter.none == 0.0 else 1.0 / (RATIO_MOVES * parameter.scale) ** 2


def _inverse(information: FloatArray) -> FloatArray:
    """(P, P), scaled to a unit diagonal, so that what no window shows stays open instead of making all singular."""
    size = np.sqrt(np.maximum(np.diag(information), TINY))
    scale = np.outer(size, size)
    return np.asarray(np.linalg.inv(information / scale + OPEN * np.eye(len(size))) / scale)


@kept
def quadratic(problem: Problem, found: Fit) -> Quadratic:
    """The quadratic around a fit to the problem's windows."""
    hypothesis, count = found.hypothesis, len(found.starts)
    by_state, by_theta = jacobians(problem, hypothesis, hypothesis.theta, found.starts, found.residuals)
    by_window, gradients = projected(
        problem, found.residuals, by_state, by_theta, found.variance, np.zeros(count)
    )
    held = np.diag([_held(p) for p in hypothesis.parameters])
    ends = np.cumsum([0, *(len(group) for group in hypothesis.declared)])
    covariance = _inverse(by_window.sum(axis=0) + held) if found.covariance is None else found.covariance
    return Quadratic(
        found,
        hypothesis.theta - np.array([p.high if p.falls else p.none for p in hypothesis.parameters]),
        covariance,
        by_state,
        by_window,
        gradients,
        held,
        tuple(slice(int(a), int(b)) for a, b in pairwise(ends)),
        tuple(
            not term.gate and not any(p.falls or p.step is not None for p in group)
            for term, group in zip(hypothesis.terms, hypothesis.declared, strict=True)
        ),
    )
