"""Laws: whether those of the claims hold against free curves of their own inputs, on what the account is judged by."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

from gpsim.diagnosis.attribution import Attribution
from gpsim.diagnosis.fitting import Fit, Hypothesis, Problem
from gpsim.diagnosis.form import FreeCurve, Group, forms, free_curves, groups_of, missing_curve
from gpsim.diagnosis.judgement.judgement import Judgement
from gpsim.diagnosis.judgement.verdict import misses
from gpsim.diagnosis.report import Curve, Form, Share
from gpsim.diagnosis.selection import Varying, varying, whole_robot
from gpsim.diagnosis.setup import Question
from gpsim.effects import Measured, closed

OVER_NAMELESS = 5.0
"""Times what surely has no name, where that is much, that a law must explain to be taken for more than the nearest to
it (laws outside the catalogue (seed 2040 after it was opened): twelve were called by laws that explained at most 4.1
times what was left)."""


@dataclass(frozen=True)
class Laws:
    """forms: whether each of the leader's laws holds, those of slight effects untested; curves: drawn beside them.

    missing: what nothing that is named accounts for, as a curve, where that has a shape; free: all of these curves, to
    be simulated.
    """

    forms: tuple[Form, ...] = ()
    curves: tuple[Curve, ...] = ()
    missing: Curve | None = None
    free: tuple[FreeCurve, ...] = field(default=(), repr=False)


def laws_of(question: Question, judgement: Judgement, attribution: Attribution) -> Laws:
    """Every group of headline laws beside a curve in its place; what is missing beside them all.

    Not of a whole robot: a curve is simulated step by step, and a robot has as many laws as joints several times over.
    """
    problem, leader = question.everything, judgement.leader
    if whole_robot(problem, leader.hypothesis):
        return Laws(tuple("untested" for _ in leader.hypothesis.terms))
    lack = judgement.lack if judgement.lack is not None and judgement.lack.significant else None
    missing = None if lack is None else missing_curve(problem, leader, lack)
    if not leader.hypothesis.terms:
        free = () if missing is None else _worth(judgement, attribution, [missing])
        return Laws(missing=free[0].curve if free else None, free=free)
    claims = [i for i, role in enumerate(attribution.roles) if role == "headline"]
    groups = groups_of(leader.hypothesis, among=claims)
    curves = free_curves(problem, leader, groups, lack)
    known = _worth(judgement, attribution, [curve for curve in [*curves, missing] if curve is not None])
    drawn = iter(known)
    curves = [None if curve is None else next(drawn) for curve in curves]
    missing = next(drawn, None)
    found = forms(
        groups,
        [None if curve is None else curve.curve.gain for curve in curves],
        [None if curve is None else curve.departure for curve in curves],
        {i: part.share for i, part in enumerate(attribution.importance)},
        problem.run.settings.form,
        None if missing is None else missing.curve.gain,
    )
    every = tuple(found.get(i, "untested") for i in range(len(leader.hypothesis.terms)))
    shown = tuple(c.curve for c in curves if c is not None)
    large = problem.run.settings.attribution.headline  # of a smaller claim nobody asks whether it ages
    uneven = _uneven(problem, leader, [i for i in claims if attribution.importance[i].share >= large])
    shown += tuple(_drawn(problem, leader.hypothesis, varies) for varies in uneven.values() if varies.at)
    bent = _stand_ins(question, judgement, attribution, groups) | _measured(leader.hypothesis) | set(uneven)
    told: tuple[Form, ...] = tuple("approximate" if i in bent else form for i, form in enumerate(every))
    return Laws(told, shown, None if missing is None else missing.curve, known)


def _worth(judgement: Judgement, attribution: Attribution, curves: list[FreeCurve]) -> tuple[FreeCurve, ...]:
    """The curves, each with how much more of the mismatch it explains than the laws do."""
    found = gains(judgement, attribution, [curve.hypothesis for curve in curves])
    return tuple(
        replace(curve, curve=replace(curve.curve, gain=gain))
        for curve, gain in zip(curves, found, strict=True)
    )


def gains(judgement: Judgement, attribution: Attribution, others: Sequence[Hypothesis]) -> list[Share]:
    """How much more of the mismatch each explains than the leader does, on the same draws."""
    if not others:
        return []
    judge, leader = attribution.judge, judgement.leader.hypothesis
    own, *rest = judge.squares([[leader], *([other] for other in others)])
    worth = judge.mismatch.overall(own)
    return [judge.mismatch.share(judge.mismatch.overall(other) - worth) for other in rest]


def _uneven(problem: Problem, leader: Fit, claims: Sequence[int]) -> dict[int, Varying]:
    """Claims whose strength surely varies; nothing where the simulator owns its steps, which are dear."""
    return {} if closed(problem.simulator) is not None else varying(problem, leader, claims)


def _drawn(problem: Problem, hypothesis: Hypothesis, varies: Varying) -> Curve:
    """The strength over what it varies with, beside the law's own, which is one."""
    term, channels = hypothesis.terms[varies.of], problem.simulator.state + problem.simulator.action
    known = varies.along in channels.names
    return Curve(
        effects=(term.identity,),
        quantity=f"times {term.family} on {term.on}",
        unit="1",
        input=varies.along,
        input_unit=channels.units[varies.along] if known else "s" if "time" in varies.along else "1",
        at=varies.at,
        law=(1.0,) * len(varies.at),
        free=varies.times,
    )


def _measured(hypothesis: Hypothesis) -> set[int]:
    """Terms that are curves: there is a law, and the catalogue does not have it."""
    return {i for i, term in enumerate(hypothesis.terms) if isinstance(term.effect, Measured)}


def _stand_ins(
    question: Question, judgement: Judgement, attribution: Attribution, groups: list[Group]
) -> set[int]:
    """Claims that can only stand in for what is there, whatever their curves say.

    A claim that is put together of several laws' pieces is one of which none is known. A parameter is one number: one
    that differs in a region stands in for a law of that place. A size that no machine of the kind has is not that law's
    either. And beside much that surely has no name stands in for some of it a parameter, and whatever is not several
    times as much: a law that is not in the catalogue leaves a good part of itself to the nearest one that is.
    """
    found = judgement.leader.hypothesis
    claims, terms = {i for group in groups for i in group.terms}, found.terms
    settings, share = question.run.settings, attribution.share
    if found.is_patchwork():
        return claims
    nameless = misses(judgement, attribution, settings.verdict.nearly_all)
    left = 1.0 - (share.share if share.high is None else share.high)
    small = {i for i in claims if attribution.importance[i].share < OVER_NAMELESS * left}
    numbers = {i for i in claims if terms[i].effect.site == "parameter"}
    patched = {i for i in numbers if terms[i].gate.region}
    strange = {i for i in claims if found.times_beyond(i) >= settings.verdict.implausible}
    return (small | numbers if nameless else set()) | patched | strange
