"""Curves in the place of laws that do not hold, and of what no law accounts for where a curve of one input does.

The named search has ended by then. A curve stands only where it is sure to be better: on held-out rollouts it explains
more, and its evidence, all of its effective parameters paid, is ahead. A law of the catalogue that does as well wins.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

from gpsim.diagnosis.attribution import Attribution, attribute
from gpsim.diagnosis.fitting import Candidate, Fit, Hypothesis, fit, gain, scores
from gpsim.diagnosis.form import (
    NOTICED,
    FreeCurve,
    Group,
    Measurement,
    Near,
    closed_form,
    described,
    free_curve,
    free_curve_again,
    groups_missing,
    measurable,
    measurement,
    nearest,
    sampled,
    smooth_start,
    told,
)
from gpsim.diagnosis.judgement.judgement import Judgement, led_by
from gpsim.diagnosis.judgement.laws import Laws, gains, laws_of
from gpsim.diagnosis.judgement.ranking import Ranked
from gpsim.diagnosis.report import MeasuredCurve, Share
from gpsim.diagnosis.selection import lean
from gpsim.diagnosis.settings import schedules
from gpsim.diagnosis.setup import Question
from gpsim.effects import Measured, Shape, Term

STANDS = 0.05
"""Of what a group of laws does, in root mean square, that the low end of a measured curve's difference from it must
exceed to stand in its place (laws that are right: less than 0.02, with what a simulator's own step leaves; tanh under
a viscous name 0.18)."""
FOLLOWS = 0.02
"""Of what a measured curve does, on squares, that laws of the catalogue may miss to be tried in its place (laws that
stand for a curve and miss more have lost to it by what made it stand)."""

Key = tuple[str, str, str]
"""Family, place and variant of a curve."""


@dataclass(frozen=True)
class Curved:
    """The judgement in which curves stand where no law does, what it is worth, and each of its curves as reported."""

    judgement: Judgement
    attribution: Attribution
    laws: Laws
    curves: Mapping[Key, MeasuredCurve] = field(default_factory=dict)


@dataclass(frozen=True)
class _Tried:
    """A curve fitted in the place of laws, and the laws that are nearest to it."""

    fit: Fit
    measured: Measurement
    nearest: list[Near]


def curved(
    question: Question,
    judgement: Judgement,
    attribution: Attribution,
    laws: Laws,
    offers: Sequence[Candidate],
) -> Curved:
    """Put a curve in the place of one group of laws after another, as long as one is surely better."""
    found, refused = Curved(judgement, attribution, laws), set[Key]()
    for _ in range(question.run.settings.form.curves):
        tried = _best(question, found, offers, refused)
        if tried is None:
            break
        named = _named(question, found, tried)
        leader = tried.fit if named is None else named
        moved = _moved(question, found.judgement, leader)
        worth = attribute(question, moved.leader, moved.null)
        if worth.share.share < found.attribution.share.share:
            refused.add(tried.measured.key)
            continue
        curves = dict(found.curves)
        if named is None:
            curves[tried.measured.key] = _reported(question, tried)
        found = Curved(moved, worth, laws_of(question, moved, worth), curves)
        if named is not None:
            refused.add(tried.measured.key)
    return found


def _best(question: Question, found: Curved, offers: Sequence[Candidate], refused: set[Key]) -> _Tried | None:
    """The curve that is furthest ahead of the leader, of those that are surely better."""
    problem, leader = question.everything, found.judgement.leader
    fits = []
    for free, beside in _asked(question, found):
        measured = measurement(problem, beside, free) if _apart(free) else None
        if measured is None or measured.key in refused or _has(leader.hypothesis, measured.key):
            continue
        if not problem.run.known.asks(measured.term.identity):
            continue
        fitted = _fitted(question, leader, measured)
        if _has(fitted.hypothesis, measured.key):
            fits.append(
                (fitted, measured, bool(free.group and free.group.terms) or beside != leader.hypothesis)
            )
    worth = gains(found.judgement, found.attribution, [fitted.hypothesis for fitted, *_ in fits])
    better = [
        (gain(problem, fitted, leader), fitted, measured)
        for (fitted, measured, laws), more in zip(fits, worth, strict=True)
        if _surely(question, found, more, laws)
    ]
    for nats, fitted, _ in better:
        enough = nats > question.run.settings.acceptance.per_term
        names = fitted.hypothesis.names, leader.hypothesis.names
        problem.run.trace.note(*names, enough, "measured curve", gain=nats)
    nats, fitted, measured = max(better, key=lambda one: one[0], default=(0.0, leader, None))
    if measured is None or nats <= question.run.settings.acceptance.per_term:
        return None
    fitted, measured = _refined(question, fitted, measured)
    return _Tried(fitted, measured, nearest(problem, measured, offers))


def _asked(question: Question, found: Curved) -> list[tuple[FreeCurve, Hypothesis]]:
    """A free curve of every group whose laws do not hold, and of what lack of fit says is missing.

    Each with the explanation that it was fitted beside.
    """
    problem, leader = question.everything, found.judgement.leader
    lack, broken, missing = found.judgement.lack, [], None
    for free in found.laws.free:
        if free.group is None:
            missing = free
        elif _surely(question, found, free.curve.gain, True):
            broken.append(free)
    out = [free for free in broken if free.further is None]
    groups = [free.group for free in broken if free.further is not None and free.group is not None]
    if lack is not None and missing is not None and _surely(question, found, missing.curve.gain, True):
        groups += [g for g in groups_missing(problem.simulator, leader.hypothesis, lack) if _new(g, broken)]
    calls = [(problem, leader, group) for group in groups if measurable(group)]
    out += [free for free in problem.run.side_by_side(free_curve, calls) if free is not None]
    dry = [free.group for free in out if free.group is not None and free.group.dry and free.group.terms]
    return [(free, leader.hypothesis) for free in out] + [
        one for group in dry if (one := _smooth(question, leader, group)) is not None
    ]


def _smooth(question: Question, leader: Fit, group: Group) -> tuple[FreeCurve, Hypothesis] | None:
    """A curve that lets go at rest in the place of laws with dry friction, which may have stood for one."""
    problem = question.everything
    begun = smooth_start(problem, leader.hypothesis, group)
    if begun is None:
        return None
    free = free_curve_again(problem, leader, replace(group, terms=(), dry=False), group.terms, begun)
    return None if free is None else (free, leader.hypothesis.without_all(group.terms))


def _surely(question: Question, found: Curved, more: Share | None, laws: bool) -> bool:
    """Whether a curve surely explains more: so much of the mismatch, or, of laws, a good part of what is left."""
    settings, left = question.run.settings, 1.0 - found.attribution.share.share
    part = settings.black_box.more * max(left, 0.0)
    least = min(NOTICED, part) if laws else NOTICED
    return more is not None and more.low is not None and more.low > least


def _apart(free: FreeCurve) -> bool:
    """Whether a curve is surely another law than those in its place; where there are none, nothing differs."""
    if free.group is None or not free.group.terms:
        return True
    return free.departure is not None and free.departure.low > STANDS


def _new(group: Group, broken: Sequence[FreeCurve]) -> bool:
    return all(group != free.group for free in broken)


def _has(hypothesis: Hypothesis, key: Key) -> bool:
    return any((t.family, t.on, t.variant) == key for t in hypothesis.terms)


def _fitted(question: Question, leader: Fit, measured: Measurement) -> Fit:
    """The explanation with the curve, all else fitted anew; what is no longer needed beside it goes."""
    found = _fit(question, leader, measured.hypothesis)
    return _settled(lean(question.everything, found)) if len(found.hypothesis.terms) > 1 else found


def _fit(question: Question, near: Fit, hypothesis: Hypothesis) -> Fit:
    """An explanation that is near another one's fit."""
    found = fit(
        question.everything,
        hypothesis,
        near.starts,
        iterations=schedules.REFIT,
        tolerance=schedules.EDGE,
        near=True,
    )
    return _settled(found)


def _refined(question: Question, found: Fit, measured: Measurement) -> tuple[Fit, Measurement]:
    """The curve once more, around its own fit: only then is it known what is noise, and how wide the band is."""
    problem, terms = question.everything, found.hypothesis.terms
    place = next(i for i, t in enumerate(terms) if (t.family, t.on, t.variant) == measured.key)
    alone = replace(measured.group, terms=())
    free = free_curve_again(problem, found, alone, (place,), _shape(terms[place]))
    again = None if free is None else measurement(problem, found.hypothesis.without(place), free)
    if again is None:
        return found, measured
    return _fit(question, found, again.hypothesis), replace(again, group=measured.group)


def _settled(found: Fit) -> Fit:
    """The same with every curve's scale in its shape."""
    terms = tuple(_of_size_one(term) for term in found.hypothesis.terms)
    return replace(found, hypothesis=replace(found.hypothesis, terms=terms))


def _shape(term: Term) -> Shape:
    effect = term.effect
    assert isinstance(effect, Measured)
    return effect.shape


def _of_size_one(term: Term) -> Term:
    effect = term.effect
    if not isinstance(effect, Measured):
        return term
    scaled = replace(
        effect.shape, heights=tuple(term.values["scale"] * height for height in effect.shape.heights)
    )
    return replace(term, values=scaled.values(term.values["freedom"]))


def _named(question: Question, found: Curved, tried: _Tried) -> Fit | None:
    """The explanation with laws of the catalogue in the curve's place, where these do as well; None where none do."""
    problem, settings = question.everything, question.run.settings
    for near in tried.nearest:
        if near.law.misses > FOLLOWS:
            continue
        hypothesis = tried.fit.hypothesis
        (place,) = (
            i for i, t in enumerate(hypothesis.terms) if (t.family, t.on, t.variant) == tried.measured.key
        )
        hypothesis = hypothesis.without(place)
        for candidate, term in zip(near.candidates, near.terms, strict=True):
            hypothesis = hypothesis.plus(term, candidate.declared)
        if hypothesis.says_the_same_as(found.judgement.leader.hypothesis):
            continue
        other = _fit(question, tried.fit, hypothesis)
        if gain(problem, tried.fit, other) < settings.acceptance.per_term:
            return other
    return None


def _moved(question: Question, judgement: Judgement, leader: Fit) -> Judgement:
    """The judgement of the new leader; the others are as many nats further behind."""
    problem = question.everything
    nats = scores(problem, [leader, judgement.leader])
    ahead = float(nats[0] - nats[1])
    others = [
        replace(r, behind=r.behind + ahead, in_all=None if r.in_all is None else r.in_all + ahead)
        for r in judgement.ranking
    ]
    return led_by(question, judgement, leader, [Ranked(leader.hypothesis, 0.0, True), *others])


def _reported(question: Question, tried: _Tried) -> MeasuredCurve:
    problem, measured = question.everything, tried.measured
    term = next(t for t in tried.fit.hypothesis.terms if (t.family, t.on, t.variant) == measured.key)
    scaled = replace(measured, term=term)
    curve = described(problem, scaled)
    form = None
    if measured.group.of != "twist":
        inputs = sampled(problem, scaled)
        form = closed_form(inputs[0], told(scaled.group, scaled.shape, inputs))
    return replace(curve, nearest=tuple(near.law for near in tried.nearest), found=form)
