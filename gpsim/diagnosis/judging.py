"""The verdict: named, ambiguous, unknown or none, and the fits it rests on."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from gpsim.channels import FloatArray
from gpsim.diagnosis.evidence import (
    autocorrelation,
    gain,
    scores,
    whiteness,
)
from gpsim.diagnosis.hypothesis import Candidate, Hypothesis
from gpsim.diagnosis.improving import improved
from gpsim.diagnosis.lack_of_fit import LackOfFit, lack_of_fit, lack_of_memory
from gpsim.diagnosis.leaning import simplest, without_a_term
from gpsim.diagnosis.orders import Order, fit_near
from gpsim.diagnosis.pool import side_by_side
from gpsim.diagnosis.preparing import Question
from gpsim.diagnosis.problem import Problem
from gpsim.diagnosis.ranking import Ranked, ranked
from gpsim.diagnosis.rivals import behind_its_gates, held_out_objective, overtaking, rivals_of
from gpsim.diagnosis.search import STRUCTURED, Found, on_its_grid, pays
from gpsim.diagnosis.shooting import Fit, fit
from gpsim.effects.chain import Scheme

Verdict = Literal["named", "unknown", "none", "ambiguous"]
REFITTED, WITHIN = (
    8,
    12.0,
)  # hypotheses refitted on all windows: at most so many, so many nats behind the leader
UNEXPLAINED = {
    1e-2: 0.15,
    1e-3: 0.03,
}  # whiteness: share of the excess over noise that makes a partial account
LACKING = (
    0.003  # of the squares that the named effects take off, that a smooth law would take off beside them
)
FAR_FROM_WHITE, TRACE = 1e-6, 1e-5  # whiteness: or so little of them where the residual is so far from it
PATTERN, PATTERNED = (
    1e-15,
    0.003,
)  # whiteness, and the share of the mismatch in the pattern of a residual so far from it
CONTRADICTS = 0.05  # of what a term gains on training windows: more that it loses on held-out ones
UNNAMED = 1e-4  # whiteness: below, something is there even where nothing that is known pays


@dataclass(frozen=True)
class Judgement:
    """The verdict with the leading fit, its rivals, the null and tied alternatives on all training windows."""

    verdict: Verdict
    leader: Fit
    null: Fit
    rivals: list[Fit]
    probabilities: list[float]  # of the leader, then of the rivals
    ranking: list[Ranked]
    p_value: float
    lack: LackOfFit | None
    noise: FloatArray  # (S,) standard deviation that the judgement takes for noise

    @property
    def structured(self) -> bool:
        """Whether something is left over; where nothing was named, the verdict has said so already."""
        if not self.leader.hypothesis.terms:
            return self.verdict == "unknown"
        return self.p_value < STRUCTURED or (self.lack is not None and self.lack.significant)


def judge(
    question: Question, found: Found, offers: Sequence[Candidate], tell: Callable[[str], None]
) -> Judgement:
    """Refit the best on all training windows, go on from there with all data, and decide."""
    problem = question.everything
    near = _near(question.searched, found)
    null = _null_of(problem, found.scheme)
    fits = _again(problem, _working([f.hypothesis for f in near]))
    leader = _leader(question, [null, *fits], null)
    leader, tried = improved(problem, leader, offers, tell)
    leader = _pruned(question, leader)
    fits += tried
    if leader.hypothesis.scheme != null.hypothesis.scheme:
        null = _null_of(problem, leader.hypothesis.scheme)
    twins = behind_its_gates(problem, leader, fits)
    fits += [leader, *twins]
    leader = simplest(problem, [leader, *twins])
    rivals, probabilities, mending = rivals_of(question, leader, fits)
    ahead = overtaking(rivals, probabilities)
    if ahead is not None:
        fits, leader = [*fits, leader], ahead
        rivals, probabilities, mending = rivals_of(question, leader, fits)
    noise, unexplained = _unexplained(problem, leader, null)
    p_value, _ = whiteness(problem, leader)
    lack = lack_of_fit(problem, leader)
    missing = _lacking(problem, leader, null, lack, p_value) or _patterned(problem, leader, null, p_value)
    if not missing:
        remembered = lack_of_memory(problem, leader)
        missing = _lacking(problem, leader, null, remembered, p_value)
        lack = remembered if missing else lack
    return Judgement(
        _verdict(leader, rivals, p_value, unexplained, missing),
        leader,
        null,
        rivals,
        probabilities,
        ranked((problem, [leader, null, *fits]), (question.searched, found.fits), mending),
        p_value,
        lack,
        noise,
    )


def _lacking(problem: Problem, leader: Fit, null: Fit, lack: LackOfFit | None, p_value: float) -> bool:
    """Whether some smooth law of a rate is missing that explains a share of what the named effects do.

    A trace, where the residual is far from white: two tests that say so are not the work of chance. With clean sensors
    the last digits are.
    """
    if lack is None or not lack.significant:
        return False
    named = problem.counts * np.maximum(null.variance - leader.variance, 0.0) / leader.variance
    share = TRACE if p_value < FAR_FROM_WHITE else LACKING
    return bool(2.0 * lack.nats > share * float(named[problem.observed].sum()))


def _patterned(problem: Problem, leader: Fit, null: Fit, p_value: float) -> bool:
    """Whether what is left, nowhere near white, repeats itself, and that is a share of the mismatch.

    Its quick changes pass for noise (a sensor that is seldom read), its memory does not.
    """
    if p_value >= PATTERN:
        return False
    rho = autocorrelation(problem, leader.residuals).max(axis=1)
    return bool((rho * leader.variance > PATTERNED * null.variance)[problem.observed].any())


def _verdict(
    leader: Fit, rivals: Sequence[Fit], p_value: float, unexplained: FloatArray, missing: bool
) -> Verdict:
    left = float(np.max(unexplained))
    if not leader.hypothesis.terms:
        return "unknown" if p_value < UNNAMED or missing else "none"
    if any(p_value < p and left > share for p, share in UNEXPLAINED.items()):
        return "unknown"
    if missing or leader.hypothesis.patchwork:
        return "unknown"
    return "ambiguous" if rivals else "named"


def _near(problem: Problem, found: Found) -> list[Fit]:
    nats = scores(problem, found.fits)
    order = [i for i in np.argsort(-nats) if nats.max() - nats[i] < WITHIN]
    return [found.fits[i] for i in order[:REFITTED]]


def _working(hypotheses: Sequence[Hypothesis]) -> list[Hypothesis]:
    """Without terms that do nothing: what they stood in for was found later, and nothing that holds one can lead."""
    out: list[Hypothesis] = []
    for hypothesis in (h.working for h in hypotheses):
        if hypothesis.terms and not any(hypothesis.says_the_same_as(other) for other in out):
            out.append(hypothesis)
    return out


def _again(problem: Problem, hypotheses: Sequence[Hypothesis]) -> list[Fit]:
    """All fitted a little, those that are not far behind the best to the end."""
    starts = problem.windows.measured[:, 0]
    return fit_near(problem, [Order(hypothesis, starts, 6) for hypothesis in hypotheses], 17, 0.02)


def _null_of(problem: Problem, scheme: Scheme) -> Fit:
    return fit(problem, Hypothesis(scheme=scheme), problem.windows.measured[:, 0], iterations=12)


def _leader(question: Question, fits: Sequence[Fit], null: Fit) -> Fit:
    """The best by evidence that also does better than nothing on held-out windows, or a simpler one as good."""
    problem, held_out = question.everything, question.held_out
    before: float | None = None
    nats = scores(problem, list(fits))
    order = [fits[int(i)] for i in np.argsort(-nats)]
    for place, chosen in enumerate(order):
        if chosen is null or not chosen.hypothesis.terms:
            return null
        if not pays(problem, chosen, null):
            continue
        if before is None:
            before = held_out_objective(held_out, Hypothesis(scheme=null.hypothesis.scheme))
        if not len(held_out.windows) or held_out_objective(held_out, chosen.hypothesis) < before:
            behind = [f for f in order[place + 1 :] if f.hypothesis.terms and pays(problem, f, null)]
            return simplest(problem, [chosen, *behind])
    return null


def _pruned(question: Question, leader: Fit) -> Fit:
    """Terms that do not pay, or do not help on held-out windows, are taken out."""
    problem = question.everything
    while leader.hypothesis.terms:
        parts = without_a_term(problem, leader)
        less = [f for f, needed in zip(parts, _needed(question, leader, parts), strict=True) if not needed]
        if not less:
            break
        leader = min(less, key=lambda f: f.objective)
    return leader


def _needed(question: Question, leader: Fit, parts: Sequence[Fit]) -> list[bool]:
    """Whether the term that each part lacks pays, and held-out windows do not contradict it.

    A few of them may say nothing of it.
    """
    problem, held_out = question.everything, question.held_out
    paying = [pays(problem, leader, part) for part in parts]
    if not len(held_out.windows) or not any(paying):
        return paying
    asked = [part for part, pay in zip(parts, paying, strict=True) if pay]
    grids = [held_out.as_finely(part.hypothesis, leader.hypothesis) for part in asked]
    calls = [(grid, part.hypothesis) for grid, part in zip(grids, asked, strict=True)]
    own, *others = side_by_side(held_out_objective, [(held_out, leader.hypothesis), *calls])
    won = [gain(problem, leader, on_its_grid(problem, part, leader)) for part in asked]
    kept = iter([own - other < CONTRADICTS * by for other, by in zip(others, won, strict=True)])
    return [pay and next(kept) for pay in paying]


def _unexplained(problem: Problem, leader: Fit, null: Fit) -> tuple[FloatArray, FloatArray]:
    """(noise standard deviation (S,), share of the excess over it that is left (S,)).

    Noise is the known one, or what differences of neighbouring residuals show where that is more.
    """

    def jumps(f: Fit) -> FloatArray:
        valid = problem.windows.valid[:, 2:, None]
        second = f.residuals[:, 2:] - 2 * f.residuals[:, 1:-1] + f.residuals[:, :-2]
        return np.asarray((second**2 * valid).sum(axis=(0, 1)) / max(float(valid.sum()), 1.0) / 6.0)

    floor = problem.floor**2
    if leader.hypothesis.scheme != "fine":  # no numerical error: nothing but what is left over
        floor = np.minimum(floor, np.mean(leader.residuals**2, axis=(0, 1)))
    noise = np.maximum(floor, np.where(problem.stated, floor, jumps(leader)))
    excess = np.maximum(null.variance - noise, 0.0)
    left = np.maximum(leader.variance - 1.1 * noise, 0.0)
    worth = problem.observed & (null.variance > 1.2 * noise)
    share = np.divide(left, np.maximum(excess, 1e-300), out=np.zeros_like(left), where=worth)
    if not leader.hypothesis.terms:
        share = np.where(worth, 1.0, 0.0)
    return np.sqrt(noise), np.asarray(share)
