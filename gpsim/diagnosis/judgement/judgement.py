"""Judgement: the leading fit, its rivals, and whether it leaves anything that chance would not."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from gpsim.channels import FloatArray
from gpsim.diagnosis.attribution import supported
from gpsim.diagnosis.fitting import Fit, Problem, whiteness
from gpsim.diagnosis.judgement.ranking import Ranked, ranked
from gpsim.diagnosis.judgement.rivals import Rivalry, behind_its_gates, overtaking, rivals_of
from gpsim.diagnosis.selection import (
    Contenders,
    Found,
    LackOfFit,
    lack_of_fit,
    lack_of_memory,
    null_of,
    simplest,
    whole_robot,
)
from gpsim.diagnosis.setup import Question

UNNAMED_P_VALUE = 1e-4
"""P-value of whiteness below which something is there even where nothing that is known pays."""


@dataclass(frozen=True)
class Judgement:
    """The leading fit, its rivals, the null and tied alternatives on all training windows."""

    leader: Fit
    null: Fit
    rivals: list[Fit]
    probabilities: list[float]  # of the leader, then of the rivals
    ranking: list[Ranked]
    p_value: float
    lack: LackOfFit | None
    noise: FloatArray  # (S,) standard deviation that the judgement takes for noise
    structured: bool  # whether something is left over that chance would not make


def judge(question: Question, contenders: Contenders, found: Found, settled: bool = False) -> Judgement:
    """What is to be said of the leader: its rivals, and what is left over. Nothing is added to it.

    A rival may lead in its place: one that is simpler, unless that is `settled`, or, once held-out windows count, far
    likelier; where it is settled every part of the recording must support that one, else it is no rival.
    """
    problem, leader, fits = question.everything, contenders.leader, list(contenders.tried)
    twins = behind_its_gates(problem, leader, fits)
    fits += [leader, *twins]
    leader = leader if settled else simplest(problem, [leader, *twins])
    size, aside = len(leader.hypothesis.terms), []
    if settled:  # what was taken out of the leader makes no rival of an explanation that still has as much
        aside = [f for f in fits if len(f.hypothesis.terms) > size]
    rivalry, leader = _led(question, leader, fits, aside, settled)
    null = contenders.null
    if null.hypothesis.scheme != leader.hypothesis.scheme:
        null = null_of(problem, leader.hypothesis.scheme)
    p_value, lack, structured = _left_over(problem, leader)
    return Judgement(
        leader,
        null,
        rivalry.rivals,
        rivalry.probabilities,
        ranked((problem, [leader, null, *fits]), (question.searched, found.fits), rivalry),
        p_value,
        lack,
        _noise(problem, leader),
        structured,
    )


def _led(
    question: Question, leader: Fit, fits: list[Fit], aside: list[Fit], settled: bool
) -> tuple[Rivalry, Fit]:
    """The rivals of whoever leads, and the leader. aside: fits that may not lead, and are no rivals.

    Once it is settled, so are those that only a part of the recording supports.
    """
    problem, have_led = question.everything, [leader]
    while True:
        every = {id(fit): fit for fit in [*fits, *have_led]}
        asked = [fit for fit in every.values() if not any(fit is other for other in aside)]
        found = rivals_of(question, leader, asked)
        ahead = overtaking(problem, leader, found.rivals, found.probabilities)
        if ahead is None or any(ahead is fit for fit in have_led):
            return found._replace(idle=[*found.idle, *aside]), leader
        if settled and not _supported(question, ahead):
            names = ahead.hypothesis.names, leader.hypothesis.names
            problem.run.trace.note(*names, False, "a part of the recording alone supports it")
            aside = [*aside, *(f for f in asked if f.hypothesis.claims == ahead.hypothesis.claims)]
        else:
            leader = ahead
            have_led.append(ahead)


def _supported(question: Question, ahead: Fit) -> bool:
    """Whether every part of the recording supports all of an explanation."""
    problem = question.everything
    structured = _left_over(problem, ahead)[2]
    null = null_of(problem, ahead.hypothesis.scheme)
    return supported(question, ahead, null, structured) is ahead


def withheld(question: Question, judgement: Judgement) -> Judgement:
    """The judgement of the base simulator alone, where the leader is not worth telling."""
    problem, null = question.everything, judgement.null
    p_value, lack, structured = _left_over(problem, null)
    return replace(
        judgement,
        leader=null,
        rivals=[],
        probabilities=[1.0],
        p_value=p_value,
        lack=lack,
        noise=_noise(problem, null),
        structured=structured,
    )


def led_by(question: Question, judgement: Judgement, leader: Fit, ranking: list[Ranked]) -> Judgement:
    """The judgement of an explanation that stands by itself: measured curves have no rivals, but nearest laws."""
    problem, null = question.everything, judgement.null
    if null.hypothesis.scheme != leader.hypothesis.scheme:
        null = null_of(problem, leader.hypothesis.scheme)
    p_value, lack, structured = _left_over(problem, leader)
    return Judgement(leader, null, [], [1.0], ranking, p_value, lack, _noise(problem, leader), structured)


def _left_over(problem: Problem, leader: Fit) -> tuple[float, LackOfFit | None, bool]:
    """The p-value of whiteness, the smooth law that would explain most of the rest, whether there is anything.

    A residual that is not quite white is nothing by itself where nothing pays.
    """
    p_value, _ = whiteness(problem, leader)
    if whole_robot(problem, leader.hypothesis) and p_value >= problem.run.settings.acceptance.structured:
        return p_value, None, False  # of noise alone no law is asked: thousands of pushes are dear
    lack = lack_of_fit(problem, leader)
    if lack is None or not lack.significant:
        remembered = lack_of_memory(problem, leader)
        lack = remembered if remembered is not None and remembered.significant else lack
    settings = problem.run.settings
    least = settings.acceptance.structured if leader.hypothesis.terms else UNNAMED_P_VALUE
    return p_value, lack, p_value < least or (lack is not None and lack.significant)


def _noise(problem: Problem, leader: Fit) -> FloatArray:
    """(S,) the known noise, or what differences of neighbouring residuals show where that is more."""
    counted = problem.counted
    valid = counted[:, 2:] & counted[:, 1:-1] & counted[:, :-2]
    second = leader.residuals[:, 2:] - 2 * leader.residuals[:, 1:-1] + leader.residuals[:, :-2]
    jumps = (second**2 * valid).sum(axis=(0, 1)) / np.maximum(valid.sum(axis=(0, 1)), 1.0) / 6.0
    floor = problem.floor**2
    if leader.hypothesis.scheme != "fine":  # no numerical error: nothing but what is left over
        floor = np.minimum(floor, np.mean(leader.residuals**2, axis=(0, 1)))
    return np.asarray(np.sqrt(np.maximum(floor, np.where(problem.stated, floor, jumps))))
