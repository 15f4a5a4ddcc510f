"""Where a measured curve is tried: in the place of laws that do not hold, where lack of fit points, and alone."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from gpsim.diagnosis.fitting import Fit, Hypothesis
from gpsim.diagnosis.form import (
    NOTICED,
    FreeCurve,
    Group,
    every_group,
    free_curve,
    free_curve_again,
    groups_missing,
    measurable,
    smooth_start,
)
from gpsim.diagnosis.judgement.judgement import Judgement
from gpsim.diagnosis.judgement.laws import Laws
from gpsim.diagnosis.report import Share
from gpsim.diagnosis.selection import whole_robot
from gpsim.diagnosis.setup import Question
from gpsim.effects import closed

SIMPLER = 2
"""Pieces that a curve must save to stand wherever it explains more, however little (a drag and a bumper of no family,
seed 2060 after it was opened: six and four laws left 0.03 and 0.2 %, all but nothing of which a curve leaves)."""

Asked = tuple[FreeCurve, Fit]
"""A free curve, and the fit beside whose explanation it was fitted."""


def in_place(question: Question, judgement: Judgement, laws: Laws, left: float) -> list[Asked]:
    """A free curve of every group whose laws do not hold, and of what lack of fit says is missing.

    left: what the account does not explain of the mismatch.
    """
    problem, leader, lack = question.everything, judgement.leader, judgement.lack
    broken, missing = [], None
    for free in laws.free:
        if free.group is None:
            missing = free
        elif surely(question, left, free.curve.gain, True):
            broken.append(free)
    out = [free for free in broken if free.further is None]
    groups = [free.group for free in broken if free.further is not None and free.group is not None]
    if lack is not None and missing is not None and surely(question, left, missing.curve.gain, True):
        groups += [g for g in groups_missing(problem, leader.hypothesis, lack) if _new(g, broken)]
    calls = [(problem, leader, group) for group in groups if measurable(group)]
    out += [free for free in problem.run.side_by_side(free_curve, calls) if free is not None]
    dry = [free.group for free in out if free.group is not None and free.group.dry and free.group.terms]
    smooth = [_smooth(question, leader, group) for group in dry]
    return [(free, leader) for free in out] + [one for one in smooth if one is not None]


def alone(question: Question, judgement: Judgement, laws: Laws) -> list[Asked]:
    """A curve of every input beside the base simulator, where the laws that are named do not hold, or are many.

    Whoever searches law by law goes on from the law that is nearest to a curve, and two or three may then stand for it.
    """
    problem, null = question.everything, judgement.null
    doubtful = judgement.structured or "approximate" in laws.forms or many(question, judgement)
    if not doubtful or problem.run.known.require or whole_robot(problem, judgement.leader.hypothesis):
        return []  # beside a curve alone nothing that is required would stand
    calls = [(problem, null, group) for group in every_group(problem)]
    return [(free, null) for free in problem.run.side_by_side(free_curve, calls) if free is not None]


def many(question: Question, judgement: Judgement) -> bool:
    """Whether one curve in the place of all laws would be so much simpler that this speaks for it.

    Nobody asks where the simulator owns its steps, which are dear.
    """
    return closed(question.everything.simulator) is None and pieces(judgement.leader.hypothesis) > SIMPLER


def simpler(leader: Hypothesis, other: Hypothesis, more: Share) -> bool:
    """Whether another explanation, which surely explains more, does so with so many pieces less."""
    return more.low is not None and more.low > 0.0 and pieces(leader) - pieces(other) >= SIMPLER


def pieces(hypothesis: Hypothesis) -> int:
    """How many laws there are, each that is kept to a region once more."""
    return len(hypothesis.terms) + sum(bool(term.gate) for term in hypothesis.terms)


def surely(question: Question, left: float, more: Share | None, laws: bool) -> bool:
    """Whether a curve surely explains more: so much of the mismatch, or, of laws, a good part of what is left."""
    part = question.run.settings.black_box.more * max(left, 0.0)
    least = min(NOTICED, part) if laws else NOTICED
    return more is not None and more.low is not None and more.low > least


def _smooth(question: Question, leader: Fit, group: Group) -> Asked | None:
    """A curve that lets go at rest in the place of laws with dry friction, which may have stood for one."""
    problem = question.everything
    begun = smooth_start(problem, leader.hypothesis, group)
    if begun is None:
        return None
    free = free_curve_again(problem, leader, replace(group, terms=(), dry=False), group.terms, begun)
    rest = replace(leader, hypothesis=leader.hypothesis.without_all(group.terms))
    return None if free is None else (free, rest)


def _new(group: Group, broken: Sequence[FreeCurve]) -> bool:
    return all(group != free.group for free in broken)
