"""Screening: what a term could gain at best, from one simulation of it each, without fitting."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product

import numpy as np

from gpsim.channels import FloatArray
from gpsim.diagnosis.hypothesis import Candidate, Hypothesis
from gpsim.diagnosis.linearised import state_jacobian
from gpsim.diagnosis.problem import Problem
from gpsim.diagnosis.shooting import Fit


def screened(
    problem: Problem, parent: Fit, offers: Sequence[Candidate]
) -> list[tuple[float, Candidate, tuple[float, ...]]]:
    """(nats, candidate, start values) of each offer's best start, best first.

    The change that a term makes to the residual is a direction; the gain is what the best multiple of it, with the
    start states following, takes off the parent's sum of squares (a score test along a secant).
    """
    seen = problem.observed
    sd = np.sqrt(parent.variance[seen])
    count = len(parent.starts)
    slopes = state_jacobian(problem, parent.hypothesis, parent.starts, parent.residuals)
    js = (slopes[:, :, seen] / sd[:, None]).reshape(count, -1, slopes.shape[-1])
    residual = (parent.residuals[..., seen] / sd).reshape(count, -1)
    basis = np.linalg.qr(js + 1e-12)[0]
    rest = _without(basis, residual)
    out = []
    for candidate in offers:
        best = -1.0
        at: tuple[float, ...] = ()
        for start in starts_of(candidate):
            child = parent.hypothesis.plus(candidate.term(start), candidate.declared)
            moved = problem.residuals(child, child.theta[None], parent.starts[None])[0]
            change = (moved - parent.residuals)[..., seen] / sd
            change = _without(basis, np.clip(change, -1e4, 1e4).reshape(count, -1))
            size = float((change**2).sum())
            worth = 0.5 * float((change * rest).sum()) ** 2 / size if size > 1e-12 else 0.0
            if worth > best:
                best, at = worth, start
        out.append((best, candidate, at))
    return sorted(out, key=lambda item: -item[0])


def starts_of(candidate: Candidate) -> list[tuple[float, ...]]:
    """Every combination of the parameters' starting values."""
    return list(product(*(p.starts for p in candidate.declared)))


def child_of(parent: Hypothesis, candidate: Candidate, start: Sequence[float]) -> Hypothesis:
    """The parent with one term more."""
    return parent.plus(candidate.term(start), candidate.declared)


def _without(basis: FloatArray, vectors: FloatArray) -> FloatArray:
    """(W, M) vectors with what the start states can explain taken off."""
    return np.asarray(vectors - (basis @ (basis.transpose(0, 2, 1) @ vectors[..., None]))[..., 0])
