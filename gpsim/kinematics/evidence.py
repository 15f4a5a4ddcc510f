"""Which numbers of a geometry are off: the evidence of a linear model, in nats, with usual sizes as its prior.

theta ~ N(0, usual^2), y = J theta + noise: ln p(y) = 1/2 b' M^-1 b - 1/2 ln |M usual^2|, M = J'J / sigma^2 + usual^-2
and b = J'y / sigma^2 (MacKay 1992). Errors of neighbouring samples are alike, so that fewer of them count.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from gpsim.channels import FloatArray
from gpsim.kinematics.least_squares import Fit, Problem, weighed

PRICES = {"joint zero": 3.0, "body place": 5.0, "body turn": 6.0, "site place": 5.0, "site turn": 6.0}
"""Nats that a number must gain: there are tens of them (ln 45 = 3.8), and of two that do the same a zero, which people
set, is more usual than a length, which a machine tool made."""
NUISANCE = 3.0  # nats for a number of the laboratory to be told
OPEN = 2.3  # nats, odds of ten: what is no further behind does as well
SAME = 1e-5  # that a squared correlation is below 1 by rounding
SEEN = 0.05  # of the largest part of a sum: less is not told
WEAK = 0.05  # autocorrelation below which errors are independent: two errors of its own in 2000 samples


@dataclass(frozen=True)
class Linear:
    """normal: (P, P) J'J / sigma^2 of the samples that count, pull: (P,) J'y / sigma^2, usual: (P,) sizes.

    nuisance: the numbers of the laboratory, always fitted; candidates: all others; prices: (P,) nats, 0 of the
    laboratory's; independent: how many samples count.
    """

    normal: FloatArray
    pull: FloatArray
    usual: FloatArray
    nuisance: tuple[int, ...]
    candidates: tuple[int, ...]
    prices: FloatArray
    independent: float

    @classmethod
    def of(cls, problem: Problem, fit: Fit, share: float) -> Linear:
        """Around a fit; share: of the samples, which count."""
        rows = fit.kept & problem.samples.training
        slopes, residual = problem.slopes(fit.theta)[rows], fit.residual[rows]
        weights = share * np.isfinite(residual) / fit.sigma**2
        target = np.nan_to_num(residual) + slopes @ fit.theta
        prices = np.array([*(PRICES.get(place.kind, 0.0) for place in problem.kinematics.places), 0.0])
        nuisance, candidates = (tuple(np.flatnonzero(of).tolist()) for of in (prices == 0.0, prices > 0.0))
        normal, pull = weighed(slopes, weights, target)
        return cls(
            normal, pull, problem.usual, nuisance, candidates, prices, share * float(np.count_nonzero(rows))
        )

    def likely(self, numbers: Sequence[int]) -> float:
        """Nats over none of them, prices left out."""
        if not len(numbers):
            return 0.0
        root, solved = self._solved(numbers)
        volume = float(np.log(np.diag(root)).sum() + np.log(self.usual[list(numbers)]).sum())
        return 0.5 * float(solved @ solved) - volume

    def estimates(self, numbers: Sequence[int]) -> tuple[FloatArray, FloatArray]:
        """Values and standard deviations."""
        root, solved = self._solved(numbers)
        inverse = np.linalg.inv(root)
        return np.asarray(inverse.T @ solved), np.sqrt((inverse**2).sum(axis=0))

    def _solved(self, numbers: Sequence[int]) -> tuple[FloatArray, FloatArray]:
        """The Cholesky root of M, and b over it."""
        root = np.linalg.cholesky(self._precision(numbers))
        return np.asarray(root), np.asarray(np.linalg.solve(root, self.pull[list(numbers)]))

    def _precision(self, numbers: Sequence[int]) -> FloatArray:
        """M of some numbers."""
        at = list(numbers)
        return np.asarray(self.normal[np.ix_(at, at)] + np.diag(self.usual[at] ** -2))

    def selected(self) -> tuple[int, ...]:
        """The numbers of the robot with the largest evidence: one more, one less, or one in another's place."""

        def evidence(numbers: Sequence[int]) -> float:
            return self.likely((*self.nuisance, *numbers)) - float(self.prices[list(numbers)].sum())

        chosen: tuple[int, ...] = ()
        best = evidence(chosen)
        while True:
            others = [c for c in self.candidates if c not in chosen]
            less = [tuple(c for c in chosen if c != gone) for gone in chosen]
            tried = [tuple(sorted((*left, c))) for left in (chosen, *less) for c in others]
            found = max([*tried, *less], key=evidence, default=chosen)
            reached = evidence(found)
            if not reached > best + SAME:
                return chosen
            chosen, best = found, reached

    def told(self, chosen: Sequence[int]) -> tuple[int, ...]:
        """The numbers of the laboratory that are not 0, beside those of the robot."""
        left = self.nuisance
        while left:
            smaller = [tuple(i for i in left if i != gone) for gone in left]
            without = max(smaller, key=lambda some: self.likely((*some, *chosen)))
            if self.likely((*left, *chosen)) - self.likely((*without, *chosen)) > NUISANCE:
                break
            left = without
        return left

    def instead(self, number: int, fitted: Sequence[int]) -> list[tuple[int, bool]]:
        """What does as well in a number's place, all others fitted anew, and whether no sample tells them apart."""
        rest = [i for i in fitted if i != number]
        reached = self.likely(fitted)
        others = (c for c in self.candidates if c not in fitted)
        found = [
            (c, self._same(number, c, rest)) for c in others if self.likely([*rest, c]) >= reached - OPEN
        ]
        return sorted(found, key=lambda one: not one[1])

    def _same(self, one: int, other: int, rest: Sequence[int]) -> bool:
        """Whether two slopes are one, what others do already left out."""
        at, beside = [one, other], list(rest)
        between = self.normal[np.ix_(beside, at)]
        block = self.normal[np.ix_(at, at)] - between.T @ np.linalg.solve(self._precision(beside), between)
        return bool(block[0, 1] ** 2 > (1.0 - SAME) * block[0, 0] * block[1, 1])

    def inseparable(self) -> list[tuple[int, tuple[int, ...], FloatArray]]:
        """Numbers that a usual size of does not show beside those before them, and how large it is in each of these."""
        basis, out = list[int](), []
        for i in (*self.nuisance, *self.candidates):
            scale = self.usual[basis]
            between = self.normal[basis, i] * scale
            matrix = self.normal[np.ix_(basis, basis)] * np.outer(scale, scale) + SAME * np.eye(len(basis))
            shares = np.linalg.solve(matrix, between)
            left = float(self.normal[i, i] - between @ shares)
            if left * self.usual[i] ** 2 > 1.0:
                basis.append(i)
                continue
            heavy = np.flatnonzero(np.abs(shares) > SEEN * np.abs(shares).max(initial=0.0))
            out.append((i, tuple(basis[k] for k in heavy), (shares * scale)[heavy]))
        return out


def counting(fit: Fit, problem: Problem) -> float:
    """Which share of the samples counts, as errors of neighbours are alike: one over the sum of autocorrelations."""
    rows = np.flatnonzero(problem.samples.training & fit.kept)
    errors = np.nan_to_num(fit.residual[rows] / fit.sigma)
    errors = errors - errors.mean(axis=0)
    whole, total = float((errors**2).sum()), 1.0
    for lag in range(1, len(rows) // 4):
        alike = float((errors[:-lag] * errors[lag:]).sum()) / whole if whole > 0.0 else 0.0
        if alike < WEAK:
            break
        total += 2.0 * alike
    return 1.0 / total
