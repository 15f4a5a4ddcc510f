"""Of a robot's account: values by forces, or those that a simulation was fitted with, whatever simulates further.

Least squares of forces and a fit of simulations to windows err in different ways: the former where speeds are read off
coarse encoders, the latter where commands are torques that were measured, and noisy. Rollouts are longer than the
windows of the fit, and tell them apart.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from gpsim.channels import FloatArray
from gpsim.diagnosis.attribution.attribution import SEED
from gpsim.diagnosis.attribution.judges import rollout_judge
from gpsim.diagnosis.fitting import (
    Candidate,
    Fit,
    Hypothesis,
    Problem,
    correlation_time,
    curvature,
    fit,
    is_row,
)
from gpsim.diagnosis.selection import null_of, whole_robot
from gpsim.diagnosis.settings import schedules
from gpsim.diagnosis.setup import LATE, Question, Sizes, by_forces, is_law
from gpsim.effects import RISE

UNSURE = 3.0  # standard errors from what is believed, within which a body or a motor may be as believed
NEARER = 0.05  # by which channels must end nearer to the recording, in the mean of logarithms: else all stays


def forces_lead(question: Question, leader: Fit, offers: Sequence[Candidate]) -> bool:
    """Whether a robot simulates further with the sizes that forces say than with those of the fit to windows.

    There the fit follows the noise of torques, and would have bodies and motors for it that are as believed.
    """
    if not whole_robot(question.everything, leader.hypothesis):
        return False
    null = null_of(question.everything, leader.hypothesis.scheme)
    return with_values_of_forces(question, leader, null, offers) is not leader


def with_values_of_forces(question: Question, leader: Fit, null: Fit, offers: Sequence[Candidate]) -> Fit:
    """The leader, or the same effects with the sizes that forces say, where rollouts end nearer with these."""
    problem = question.everything
    if not whole_robot(problem, leader.hypothesis):
        return leader
    said = _said(question, leader.hypothesis, offers)
    judge, _ = rollout_judge(question, leader, null, np.random.default_rng(SEED))
    counts = judge.mismatch.counts
    if not said or not counts.any():
        return leader
    squares = judge.squares([[leader.hypothesis], *([sizes.account] for sizes in said)])
    fitted, *others = [_size(one, judge.mismatch.floor)[counts].mean() for one in squares]
    best = _best(np.array(others), [len(sizes.account.terms) for sizes in said])
    names, taken = said[best].account.names, bool(others[best] < fitted - NEARER)
    problem.run.trace.note(
        names, leader.hypothesis.names, taken, "sizes by forces", gain=float(fitted - others[best])
    )
    if not taken:
        return leader
    account = said[best].account
    found = fit(problem, account.frozen(), leader.starts, iterations=schedules.SETTLE)
    found = replace(found, hypothesis=account)
    return replace(found, covariance=_covariance(problem, found, said[best].covariance))


def _best(off: FloatArray, terms: Sequence[int]) -> int:
    """The nearest, or one of fewer terms that is hardly further off."""
    near = [i for i in np.argsort(off) if off[i] < off.min() + NEARER]
    return int(min(near, key=lambda i: terms[i]))


def _said(question: Question, account: Hypothesis, offers: Sequence[Candidate]) -> list[Sizes]:
    """What forces say of an account, with and without the laws that are no rows: those take from their joint's rows.

    Where torques are noisy, windows ask for more than there is.
    """
    laws = {i for i, term in enumerate(account.terms) if is_law(term) and not is_row(term.effect)}
    accounts = [account, account.without_all(laws)] if laws else [account]
    return [sizes for one in accounts for sizes in _sure(question, one, offers)]


def _sure(question: Question, account: Hypothesis, offers: Sequence[Candidate]) -> list[Sizes]:
    """What forces say of an account without the bodies and motors that most bands are not sure of, band by band."""
    while True:
        said = by_forces(question.everything, question.recording, account, offers)
        doubts = Counter(i for sizes in said for i in _unsure(sizes))
        unsure = {i for i, bands in doubts.items() if 2 * bands > len(said)}
        if not unsure:
            return said
        account = account.without_all(unsure)


def _unsure(sizes: Sizes) -> set[int]:
    """Which bodies and motors may be as they are believed; how friction grows one band shows better than others."""
    deviation, at, unsure = np.sqrt(np.diag(sizes.covariance)), 0, set[int]()
    for i, (term, declared) in enumerate(zip(sizes.account.terms, sizes.account.declared, strict=True)):
        off = abs(term.values[declared[0].name] - declared[0].none)
        stays = is_row(term.effect) or term.family == LATE or term.variant == RISE
        if not stays and off < UNSURE * deviation[at]:
            unsure.add(i)
        at += len(declared)
    return unsure


def _covariance(problem: Problem, found: Fit, said: FloatArray) -> FloatArray:
    """(P, P) as forces say it; of laws whose values stayed as windows do."""
    tau = float(np.maximum(correlation_time(problem, found.residuals)[problem.observed], 1.0).max())
    stayed = np.where(np.diag(said) > 0.0, 0.0, tau * curvature(problem, found).variance)
    return np.asarray(said + np.diag(stayed))


def _size(squares: FloatArray, floor: FloatArray) -> FloatArray:
    """(S,) logarithm of a channel's squares (B, S), of which noise makes so many at least."""
    least = np.maximum(floor.sum(axis=0), np.finfo(float).tiny)
    return np.asarray(np.log(np.maximum(squares.sum(axis=0), least)))
