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
    FreeCurve,
    Measurement,
    Near,
    closed_form,
    described,
    free_curve_again,
    measurement,
    nearest,
    sampled,
    told,
)
from gpsim.diagnosis.judgement.curves_asked import alone, in_place, many, simpler, surely
from gpsim.diagnosis.judgement.judgement import Judgement, led_by
from gpsim.diagnosis.judgement.laws import Laws, gains, laws_of
from gpsim.diagnosis.judgement.ranking import Ranked
from gpsim.diagnosis.report import MeasuredCurve
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

WORTH = 0.01
"""Of the mismatch, that an account of few laws must leave for a curve to be tried in the place of all of it: each input
has its own, which is dear (laws that stood for a curve left 7 to 60 %; those of the EMPS axis less than 0.1 %)."""

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
    """A fitted curve, how far it is ahead of the leader, and whether it is in the place of laws."""

    fit: Fit
    measured: Measurement
    nats: float
    instead: bool


def curved(question: Question, found: Curved, offers: Sequence[Candidate]) -> Curved:
    """Put a curve in the place of one group of laws after another, as long as one is surely better."""
    refused = set[Key]()
    for _ in range(question.run.settings.form.curves):
        tried = _best(question, found, refused)
        if tried is None:
            break
        near = nearest(question.everything, tried.measured, offers)
        named = _named(question, found, tried, near)
        leader = tried.fit if named is None else named
        moved = _moved(question, found.judgement, leader)
        worth = attribute(question, moved.leader, moved.null)
        if worth.share.share < found.attribution.share.share:
            refused.add(tried.measured.key)
            continue
        curves = dict(found.curves)
        if named is None:
            curves[tried.measured.key] = _reported(question, tried, near)
        found = Curved(moved, worth, laws_of(question, moved, worth), curves)
        if named is not None:
            refused.add(tried.measured.key)
    return found


def _best(question: Question, found: Curved, refused: set[Key]) -> _Tried | None:
    """The curve that is furthest ahead of the leader, of those that are surely better."""
    leader, enough = found.judgement.leader, question.run.settings.acceptance.per_term
    left = 1.0 - found.attribution.share.share
    asked = in_place(question, found.judgement, found.laws, left)
    tried = [t for free, beside in asked if (t := _tried(question, found, free, beside, refused))]
    tried += _alone(question, found, refused)
    worth = gains(found.judgement, found.attribution, [one.fit.hypothesis for one in tried])
    better = [
        one
        for one, more in zip(tried, worth, strict=True)
        if surely(question, left, more, one.instead) or simpler(leader.hypothesis, one.fit.hypothesis, more)
    ]
    for one in better:
        names = one.fit.hypothesis.names, leader.hypothesis.names
        question.run.trace.note(*names, one.nats > enough, "measured curve", gain=one.nats)
    most = max((one.nats for one in better), default=0.0)
    if most <= enough:
        return None
    near = [one for one in better if one.nats > max(enough, (1.0 - FOLLOWS) * most)]
    best = min(near, key=lambda one: (len(one.fit.hypothesis.terms), -one.nats))
    return _refined(question, found, best)


def _alone(question: Question, found: Curved, refused: set[Key]) -> list[_Tried]:
    """The best curve that stands alone, around its own fit; none behind laws, nor where few leave too little."""
    worth = many(question, found.judgement) or found.attribution.share.share <= 1.0 - WORTH
    if found.curves or not worth:
        return []
    asked = alone(question, found.judgement, found.laws)
    tried = [t for free, beside in asked if (t := _tried(question, found, free, beside, refused))]
    best = max(tried, key=lambda one: one.nats, default=None)
    if best is None or best.nats <= question.run.settings.acceptance.per_term:
        return []
    return [_refined(question, found, best)]


def _tried(
    question: Question, found: Curved, free: FreeCurve, beside: Fit, refused: set[Key]
) -> _Tried | None:
    """A free curve as an effect, fitted; None where it is none, was tried before or is left out again."""
    problem, leader = question.everything, found.judgement.leader
    measured = measurement(problem, beside.hypothesis, free) if _apart(free) else None
    if measured is None or measured.key in refused or _has(leader.hypothesis, measured.key):
        return None
    if not problem.run.known.asks(measured.term.identity):
        return None
    fitted = _fitted(question, beside, measured)
    instead = bool(free.group and free.group.terms) or beside is not leader
    ahead = gain(problem, fitted, leader)
    return _Tried(fitted, measured, ahead, instead) if _has(fitted.hypothesis, measured.key) else None


def _apart(free: FreeCurve) -> bool:
    """Whether a curve is surely another law than those in its place; where there are none, nothing differs."""
    if free.group is None or not free.group.terms:
        return True
    return free.departure is not None and free.departure.low > STANDS


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


def _refined(question: Question, found: Curved, tried: _Tried) -> _Tried:
    """The curve once more, around its own fit: only then is it known what is noise, and how wide the band is."""
    problem, measured, terms = question.everything, tried.measured, tried.fit.hypothesis.terms
    place = next(i for i, t in enumerate(terms) if (t.family, t.on, t.variant) == measured.key)
    alone = replace(measured.group, terms=())
    free = free_curve_again(problem, tried.fit, alone, (place,), _shape(terms[place]))
    again = None if free is None else measurement(problem, tried.fit.hypothesis.without(place), free)
    if again is None:
        return tried
    fitted = _fit(question, tried.fit, again.hypothesis)
    ahead = gain(problem, fitted, found.judgement.leader)
    return replace(tried, fit=fitted, measured=replace(again, group=measured.group), nats=ahead)


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


def _named(question: Question, found: Curved, tried: _Tried, laws: Sequence[Near]) -> Fit | None:
    """The explanation with laws of the catalogue in the curve's place, where these do as well; None where none do."""
    problem, settings = question.everything, question.run.settings
    for near in laws:
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


def _reported(question: Question, tried: _Tried, laws: Sequence[Near]) -> MeasuredCurve:
    problem, measured = question.everything, tried.measured
    term = next(t for t in tried.fit.hypothesis.terms if (t.family, t.on, t.variant) == measured.key)
    scaled = replace(measured, term=term)
    curve = described(problem, scaled)
    form = None
    if measured.group.of != "twist":
        inputs = sampled(problem, scaled)
        form = closed_form(inputs[0], told(scaled.group, scaled.shape, inputs))
    return replace(curve, nearest=tuple(near.law for near in laws), found=form)
