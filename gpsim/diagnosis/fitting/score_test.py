"""Screening: what a term could gain at best, from one simulation of it each, without fitting."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import cached_property
from itertools import chain, product

import numpy as np

from gpsim.channels import FloatArray
from gpsim.diagnosis.fitting.gauss_newton import jacobians
from gpsim.diagnosis.fitting.hypothesis import Candidate, Hypothesis
from gpsim.diagnosis.fitting.multiple_shooting import Fit
from gpsim.diagnosis.fitting.problem import Problem
from gpsim.effects import EffectParameter, Gate, own_name

SCREENED_IN_A_ROW = 8  # candidates that one process screens in a row
SMALL_START = 0.05
"""Of what a starting value changes: so much of a law that grows with its only parameter is screened, too (where
motion is sensitive, what a large change does is no line)."""
SCAN_REACHES = (0.5, 0.05, 0.005)
"""Of a law's only parameter, to either side: scans that narrow (dry friction in coarse steps has many local
optima)."""
SCAN_PLACES = 25  # that each scan looks at
CLIPPED_AT = 1e4  # of the residual, to which the change of a sample is clipped [standard deviations]

NO_GATE = Gate()
LEAST_TIMES = 1e-9  # guards a division: a law that falls with its parameter would do nothing at all


class Directions:
    """How hypotheses around a fitted parent change its residual, start states and its own parameters projected out.

    In standard deviations of the parent's residual, observed channels only: a vector has shape (W, M). pushed: what is
    known already of pushes on a rate (see `impulses`).
    """

    def __init__(self, problem: Problem, parent: Fit) -> None:
        self.problem, self.parent = problem, parent
        self.pushed: dict[int, FloatArray] = {}
        self._sd = np.sqrt(parent.variance[problem.observed])
        hypothesis = parent.hypothesis
        # What differs is looked at in the same steps on both sides.
        self._rough, self._from = problem.slopes, parent.residuals
        if self._rough is not problem:
            self._from = self._rough.residuals(hypothesis, hypothesis.theta[None], parent.starts[None])[0]
        by_state, by_theta = jacobians(problem, hypothesis, hypothesis.theta, parent.starts, parent.residuals)
        self._basis = np.linalg.qr(self._columns(by_state) + 1e-12)[0]
        self._own: FloatArray | None = None
        if by_theta.shape[-1]:
            own = self._columns(by_theta)
            own = own - self._basis @ (self._basis.transpose(0, 2, 1) @ own)
            own = own.reshape(-1, own.shape[-1])
            size = np.linalg.norm(own, axis=0)  # parameters may have any unit
            self._own = np.linalg.qr(own / np.where(size > 0.0, size, 1.0) + 1e-12)[0]

    @cached_property
    def rest(self) -> FloatArray:
        """(W, M): the parent's residual, what start states can explain taken off."""
        return self._without(self._flat(self.parent.residuals))

    def of(self, hypothesis: Hypothesis, thetas: FloatArray) -> FloatArray:
        """(C, W, M): what each of thetas (C, P) takes off the residual."""
        starts = np.broadcast_to(self.parent.starts, (len(thetas), *self.parent.starts.shape))
        return self._changes(self._from, self._rough.residuals(hypothesis, thetas, starts))

    def raw(self, residuals: FloatArray) -> FloatArray:
        """(C, W, M): what residuals (C, W, L + 1, S) in the steps of slopes take off, with nothing projected out."""
        most = CLIPPED_AT
        return np.stack([np.clip(self._flat(self._from - r), -most, most) for r in residuals])

    def projected(self, changes: FloatArray) -> FloatArray:
        """(C, W, M): such changes with what start states and the parent's parameters can explain taken off."""
        return np.stack([self._without(change) for change in changes])

    def changes(self, residuals: FloatArray) -> FloatArray:
        """(C, W, M): the same for other residuals (C, W, L + 1, S)."""
        return self._changes(self.parent.residuals, residuals)

    def _changes(self, before: FloatArray, residuals: FloatArray) -> FloatArray:
        most = CLIPPED_AT
        changes = [np.clip(self._flat(before - r), -most, most) for r in residuals]
        return np.stack([self._without(change) for change in changes])

    def gains(self, hypothesis: Hypothesis, thetas: FloatArray) -> FloatArray:
        """(C,) nats: what the best multiple of each direction takes off half the parent's sum of squares."""
        changes = self.of(hypothesis, thetas).reshape(len(thetas), -1)
        size = (changes**2).sum(axis=1)
        pull = changes @ self.rest.ravel()
        return np.asarray(np.divide(0.5 * pull**2, size, out=np.zeros_like(size), where=size > 1e-12))

    def objectives(self, hypothesis: Hypothesis, thetas: FloatArray) -> FloatArray:
        """(C,) nats: the objective of each of thetas (C, P), start states adapted linearly."""
        problem = self.problem
        rest = self.rest - self.of(hypothesis, thetas)
        seen = int(problem.observed.sum())
        square = (rest.reshape(len(thetas), -1, seen) ** 2).sum(axis=1) / problem.counts[problem.observed]
        variance = np.maximum(square, (problem.floor[problem.observed] / self._sd) ** 2)
        terms = problem.counts[problem.observed] / 2 * (np.log(variance) + square / variance)
        return np.asarray(terms.sum(axis=1))

    def _columns(self, slopes: FloatArray) -> FloatArray:
        """(W, L + 1, S, P) -> (W, M, P) in standard deviations."""
        scaled = slopes[:, :, self.problem.observed] / self._sd[:, None]
        return np.asarray(scaled.reshape(len(slopes), -1, slopes.shape[-1]))

    def _flat(self, residual: FloatArray) -> FloatArray:
        scaled = residual[..., self.problem.observed] / self._sd
        return np.asarray(scaled.reshape(len(residual), -1))

    def _without(self, vectors: FloatArray) -> FloatArray:
        """(W, M) vectors with what the start states (and the parameters) can explain taken off."""
        explained = self._basis @ (self._basis.transpose(0, 2, 1) @ vectors[..., None])
        rest = np.asarray(vectors - explained[..., 0])
        if self._own is None:
            return rest
        return np.asarray(rest - (self._own @ (self._own.T @ rest.ravel())).reshape(rest.shape))


def screened(
    directions: Directions, offers: Sequence[Candidate], gate: Gate = NO_GATE, owner: int | None = None
) -> list[tuple[float, Candidate, tuple[float, ...]]]:
    """(nats, candidate, start values) of each offer's best start behind a gate, best first: a secant's score test.

    owner: the only one of several recordings in which it acts.
    """
    run = directions.problem.run
    size = SCREENED_IN_A_ROW
    chunks = [offers[i : i + size] for i in range(0, len(offers), size)]
    looks = run.side_by_side(_screened, [(directions, chunk, gate, owner) for chunk in chunks])
    return sorted((found for look in looks for found in look), key=lambda item: -item[0])


def _screened(
    directions: Directions, offers: Sequence[Candidate], gate: Gate, owner: int | None
) -> list[tuple[float, Candidate, tuple[float, ...]]]:
    parent, small = directions.parent.hypothesis, SMALL_START
    out = []
    for candidate in offers:
        starts = _looked_at(candidate, small)
        child = child_of(parent, candidate, starts[0], owner).gated(len(parent.terms), gate)
        thetas = np.array([[*parent.theta, *start] for start in starts])
        gains = directions.gains(child, thetas)
        best = int(np.argmax(gains))
        out.append((float(gains[best]), candidate, starts[best]))
    return out


def stretched(
    directions: Directions, candidate: Candidate, start: tuple[float, ...], gate: Gate = NO_GATE
) -> tuple[float, ...]:
    """The start values of a law that grows with its only parameter, at the size that explains most behind a gate.

    First by its linear gain, then by scans around it that narrow: dry friction in coarse steps has many local optima.
    """
    if len(start) != 1:
        return start
    parent, p = directions.parent.hypothesis, candidate.declared[0]
    child = child_of(parent, candidate, start).gated(len(parent.terms), gate)
    change = directions.of(child, np.array([[*parent.theta, *start]]))[0].ravel()
    size = float(change @ change)
    value = stronger(p, start[0], float(change @ directions.rest.ravel()) / size if size > 0 else 1.0)
    for reach in SCAN_REACHES:
        values = np.clip(value * np.linspace(1.0 - reach, 1.0 + reach, SCAN_PLACES), p.low, p.high)
        thetas = np.array([[*parent.theta, v] for v in values])
        value = float(values[np.argmin(directions.objectives(child, thetas))])
    return (value,)


def stronger(p: EffectParameter, value: float, times: float) -> float:
    """The value of a law's only parameter at which it does about so many times as much, within its bounds."""
    stretched = value / max(times, LEAST_TIMES) if p.falls else p.none + times * (value - p.none)
    return float(np.clip(stretched, p.low, p.high))


def starts_of(candidate: Candidate) -> list[tuple[float, ...]]:
    """Every combination of the parameters' starting values; paired ones go together."""
    groups: list[list[tuple[float, ...]]] = []
    for p in candidate.declared:
        if p.paired:
            groups[-1] = [(*one, start) for one, start in zip(groups[-1], p.starts, strict=True)]
        else:
            groups.append([(start,) for start in p.starts])
    return [tuple(chain.from_iterable(one)) for one in product(*groups)]


def _looked_at(candidate: Candidate, small: float) -> list[tuple[float, ...]]:
    """The starting values; of a law that grows with its only parameter values that do so small a part as much, too.

    Where motion is sensitive to it (a pendulum that goes round), what a large change does is no line.
    """
    starts, p = starts_of(candidate), candidate.declared[0]
    if len(candidate.declared) > 1 or p.falls or p.step is not None:
        return starts
    return [*starts, *((stronger(p, start, small),) for (start,) in starts)]


def child_of(
    parent: Hypothesis, candidate: Candidate, start: Sequence[float], owner: int | None = None
) -> Hypothesis:
    """The parent with one term more; owner: the only one of several recordings in which it acts."""
    if owner is None:
        return parent.plus(candidate.term(start), candidate.declared)
    idle = candidate.term([p.none for p in candidate.declared])
    declared = tuple(replace(p, name=own_name(p.name, owner)) for p in candidate.declared)
    own = {p.name: float(value) for p, value in zip(declared, start, strict=True)}
    return parent.plus(replace(idle, values={**idle.values, **own}), declared)
