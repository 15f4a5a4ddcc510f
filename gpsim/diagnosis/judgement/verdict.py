"""The verdict: named, ambiguous, unknown or none, and the fits it rests on."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from gpsim.channels import FloatArray
from gpsim.diagnosis.fitting import (
    Fit,
    Problem,
    autocorrelation,
    whiteness,
)
from gpsim.diagnosis.judgement.ranking import Ranked, ranked
from gpsim.diagnosis.judgement.rivals import behind_its_gates, overtaking, rivals_of
from gpsim.diagnosis.selection import (
    Contenders,
    Found,
    LackOfFit,
    lack_of_fit,
    lack_of_memory,
    simplest,
)
from gpsim.diagnosis.settings import Settings
from gpsim.diagnosis.setup import Question

Verdict = Literal["named", "unknown", "none", "ambiguous"]


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
    unexplained: FloatArray  # (S,) share of each channel's excess over noise that is left
    noise: FloatArray  # (S,) standard deviation that the judgement takes for noise
    structured: bool  # whether something is left over


def judge(question: Question, contenders: Contenders, found: Found) -> Judgement:
    """What is to be said of the leader: its rivals, what is left over, the verdict. Nothing is added to it.

    A rival may lead in its place, though: one that is simpler or, once held-out windows count, far likelier.
    """
    problem, leader, null, fits = (
        question.everything,
        contenders.leader,
        contenders.null,
        list(contenders.tried),
    )
    twins = behind_its_gates(problem, leader, fits)
    fits += [leader, *twins]
    leader = simplest(problem, [leader, *twins])
    rivals, probabilities, mending = rivals_of(question, leader, fits)
    ahead = overtaking(problem, rivals, probabilities)
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
    verdict = _verdict(problem.run.settings, leader, rivals, p_value, unexplained, missing)
    return Judgement(
        verdict,
        leader,
        null,
        rivals,
        probabilities,
        ranked((problem, [leader, null, *fits]), (question.searched, found.fits), mending),
        p_value,
        lack,
        unexplained,
        noise,
        _structured(problem, verdict, leader, p_value, lack),
    )


def _structured(
    problem: Problem, verdict: Verdict, leader: Fit, p_value: float, lack: LackOfFit | None
) -> bool:
    """Whether something is left over; where nothing was named, the verdict has said so already."""
    if not leader.hypothesis.terms:
        return verdict == "unknown"
    least = problem.run.settings.acceptance.structured
    return p_value < least or (lack is not None and lack.significant)


def _lacking(problem: Problem, leader: Fit, null: Fit, lack: LackOfFit | None, p_value: float) -> bool:
    """Whether some smooth law of a rate is missing that explains a share of what the named effects do.

    A trace, where the residual is far from white: two tests that say so are not the work of chance. With clean sensors
    the last digits are.
    """
    if lack is None or not lack.significant:
        return False
    named = problem.counts * np.maximum(null.variance - leader.variance, 0.0) / leader.variance
    settings = problem.run.settings.verdict
    share = settings.trace if p_value < settings.far_from_white else settings.lacking
    return bool(2.0 * lack.nats > share * float(named[problem.observed].sum()))


def _patterned(problem: Problem, leader: Fit, null: Fit, p_value: float) -> bool:
    """Whether what is left, nowhere near white, repeats itself, and that is a share of the mismatch.

    Its quick changes pass for noise (a sensor that is seldom read), its memory does not.
    """
    settings = problem.run.settings.verdict
    if p_value >= settings.pattern:
        return False
    rho = autocorrelation(problem, leader.residuals).max(axis=1)
    return bool((rho * leader.variance > settings.patterned * null.variance)[problem.observed].any())


def _verdict(
    settings: Settings,
    leader: Fit,
    rivals: Sequence[Fit],
    p_value: float,
    unexplained: FloatArray,
    missing: bool,
) -> Verdict:
    left = float(np.max(unexplained))
    if not leader.hypothesis.terms:
        return "unknown" if p_value < settings.verdict.unnamed or missing else "none"
    if p_value < settings.verdict.p_value and left > settings.verdict.unexplained:
        return "unknown"
    if p_value < settings.verdict.low_p_value and left > settings.verdict.little_unexplained:
        return "unknown"
    if missing or leader.hypothesis.is_patchwork(settings.patchwork):
        return "unknown"
    return "ambiguous" if rivals else "named"


def _unexplained(problem: Problem, leader: Fit, null: Fit) -> tuple[FloatArray, FloatArray]:
    """(noise standard deviation (S,), share of the excess over it that is left (S,)).

    Noise is the known one, or what differences of neighbouring residuals show where that is more.
    """
    settings = problem.run.settings.verdict

    def jumps(f: Fit) -> FloatArray:
        counted = problem.counted
        valid = counted[:, 2:] & counted[:, 1:-1] & counted[:, :-2]
        second = f.residuals[:, 2:] - 2 * f.residuals[:, 1:-1] + f.residuals[:, :-2]
        return np.asarray(
            (second**2 * valid).sum(axis=(0, 1)) / np.maximum(valid.sum(axis=(0, 1)), 1.0) / 6.0
        )

    floor = problem.floor**2
    if leader.hypothesis.scheme != "fine":  # no numerical error: nothing but what is left over
        floor = np.minimum(floor, np.mean(leader.residuals**2, axis=(0, 1)))
    noise = np.maximum(floor, np.where(problem.stated, floor, jumps(leader)))
    excess = np.maximum(null.variance - noise, 0.0)
    left = np.maximum(leader.variance - settings.noise_margin * noise, 0.0)
    worth = problem.observed & (null.variance > settings.least_excess * noise)
    share = np.divide(left, np.maximum(excess, 1e-300), out=np.zeros_like(left), where=worth)
    if not leader.hypothesis.terms:
        share = np.where(worth, 1.0, 0.0)
    return np.sqrt(noise), np.asarray(share)
