"""Which numbers of a geometry are off: the evidence of a linear model, in nats, with usual sizes as its prior.

theta ~ N(0, usual^2), y = J theta + noise: ln p(y) = 1/2 b' M^-1 b - 1/2 ln |M usual^2|, M = J'J / sigma^2 + usual^-2
and b = J'y / sigma^2 (MacKay 1992). Errors of neighbouring samples are alike, so that fewer of them count.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from gpsim.channels import FloatArray
from gpsim.diagnosis.kinematics.least_squares import Fit, Problem, weighed

PRICES = {"joint zero": 3.0, "body place": 5.0, "body turn": 6.0, "site place": 5.0, "site turn": 6.0}
"""Nats that a number must gain: there are tens of them (ln 45 = 3.8), and of two that do the same a zero, which people
set, is more usual than a length, which a machine tool made."""
NUISANCE = 3.0  # nats for a number of the laboratory to be told
OPEN = 2.3  # nats, odds of ten: what is no further behind does as well
SAME = 1e-5  # that a squared correlation is below 1 by rounding
WEAK = (
    0.05  # autocorrelation below which errors are taken as independent: two errors of its own in 2000 samples
)


@dataclass(frozen=True)
class Linear:
    """normal: (P, P) J'J / sigma^2 of the samples that count, pull: (P,) J'y / sigma^2, usual: (P,) sizes.

    nuisance: the numbers of the laboratory, always fitted; prices: (P,) nats; independent: how many samples count.
    """

    normal: FloatArray
    pull: FloatArray
    usual: FloatArray
    nuisance: tuple[int, ...]
    prices: FloatArray
    independent: float

    @classmethod
    def of(cls, problem: Problem, fit: Fit, share: float) -> Linear:
        """Around a fit; share: of the samples, which count."""
        rows = fit.kept & problem.samples.training
        slopes, residual = problem.slopes(fit.theta)[rows], fit.residual[rows]
        weights = share * np.isfinite(residual) / fit.sigma**2
        target = np.nan_to_num(residual) + slopes @ fit.theta
        kinds = [place.kind for place in problem.kinematics.places]
        own = tuple(i for i, kind in enumerate(kinds) if kind.startswith("frame"))
        return cls(
            *weighed(slopes, weights, target),
            problem.usual,
            (*own, len(kinds)),
            np.array([*(PRICES.get(kind, NUISANCE) for kind in kinds), NUISANCE]),
            share * float(rows.sum()),
        )

    def likely(self, numbers: Sequence[int]) -> float:
        """Nats over none of them, prices left out."""
        if not len(numbers):
            return 0.0
        root, solved = self._solved(numbers)
        volume = float(np.log(np.diag(root)).sum() + np.log(self.usual[list(numbers)]).sum())
        return 0.5 * float(solved @ solved) - volume

    def evidence(self, numbers: Sequence[int]) -> float:
        """The same with the prices of what is not always fitted."""
        return self.likely(numbers) - float(sum(self.prices[i] for i in numbers if i not in self.nuisance))

    def estimates(self, numbers: Sequence[int]) -> tuple[FloatArray, FloatArray]:
        """Values and standard deviations."""
        root, solved = self._solved(numbers)
        inverse = np.linalg.inv(root)
        return np.asarray(inverse.T @ solved), np.sqrt((inverse**2).sum(axis=0))

    def _solved(self, numbers: Sequence[int]) -> tuple[FloatArray, FloatArray]:
        at = list(numbers)
        matrix = self.normal[np.ix_(at, at)] + np.diag(self.usual[at] ** -2)
        root = np.linalg.cholesky(matrix)
        return np.asarray(root), np.asarray(np.linalg.solve(root, self.pull[at]))

    @cached_property
    def candidates(self) -> tuple[int, ...]:
        """What is not always fitted."""
        return tuple(i for i in range(len(self.usual)) if i not in self.nuisance)

    def selected(self) -> tuple[int, ...]:
        """The numbers of the robot with the largest evidence: one more, one less, or one in another's place."""
        chosen: tuple[int, ...] = ()
        best = self.evidence(self.nuisance)
        while True:
            tried = [tuple(sorted({*chosen, c})) for c in self.candidates if c not in chosen]
            tried += [tuple(c for c in chosen if c != gone) for gone in chosen]
            tried += [
                tuple(sorted({*chosen, c} - {gone}))
                for gone in chosen
                for c in self.candidates
                if c not in chosen
            ]
            found = max(tried, key=lambda s: self.evidence((*self.nuisance, *s)), default=chosen)
            reached = self.evidence((*self.nuisance, *found))
            if not reached > best + SAME:
                return chosen
            chosen, best = found, reached

    def told(self, chosen: Sequence[int]) -> tuple[int, ...]:
        """The numbers of the laboratory that are not 0, beside those of the robot."""
        left = list(self.nuisance)
        while left:
            least = max(left, key=lambda gone: self.likely([*(i for i in left if i != gone), *chosen]))
            without = [i for i in left if i != least]
            if self.likely([*left, *chosen]) - self.likely([*without, *chosen]) > NUISANCE:
                break
            left = without
        return tuple(left)

    def instead(self, number: int, fitted: Sequence[int]) -> list[tuple[int, bool]]:
        """What does as well in a number's place, all others fitted anew, and whether no sample tells them apart."""
        rest = [i for i in fitted if i != number]
        reached = self.likely(fitted)
        out = []
        for c in self.candidates:
            if c in fitted or self.likely([*rest, c]) < reached - OPEN:
                continue
            own, other, both = self._apart(number, c, rest)
            out.append((c, both**2 > (1.0 - SAME) * own * other))
        return sorted(out, key=lambda found: not found[1])

    def _apart(self, one: int, other: int, rest: Sequence[int]) -> tuple[float, float, float]:
        """The products of two slopes, what others do already left out."""
        at = [one, other]
        block = self.normal[np.ix_(at, at)]
        if rest:
            between = self.normal[np.ix_(list(rest), at)]
            matrix = self.normal[np.ix_(list(rest), list(rest))] + np.diag(self.usual[list(rest)] ** -2)
            block = block - between.T @ np.linalg.solve(matrix, between)
        return float(block[0, 0]), float(block[1, 1]), float(block[0, 1])

    def inseparable(self) -> list[tuple[int, tuple[int, ...], FloatArray]]:
        """Numbers that a usual size of does not show beside those before them, and how large it is in each of these."""
        basis: list[int] = []
        out = []
        for i in (*self.nuisance, *self.candidates):
            weights, left = self._in_terms(i, basis)
            if left * self.usual[i] ** 2 > 1.0:
                basis.append(i)
                continue
            share = np.abs(weights) * self.usual[i] / self.usual[basis] if basis else np.zeros(0)
            heavy = np.flatnonzero(share > SEEN * share.max(initial=0.0))
            out.append((i, tuple(basis[k] for k in heavy), weights[heavy]))
        return out

    def _in_terms(self, number: int, basis: Sequence[int]) -> tuple[FloatArray, float]:
        """A slope as a sum of others, and the square of what is left of it."""
        own = float(self.normal[number, number])
        if not basis:
            return np.zeros(0), own
        at, scale = list(basis), self.usual[list(basis)]
        between = self.normal[at, number] * scale
        matrix = self.normal[np.ix_(at, at)] * np.outer(scale, scale)
        weights = np.linalg.solve(matrix + SAME * np.eye(len(at)), between)
        return np.asarray(weights * scale), max(own - float(between @ weights), 0.0)


SEEN = 0.05  # of the largest part: less is not told


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
