"""What a diagnosis found, put together: the effects with their numbers, the rivals, the fit and what is left."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

from gpsim.diagnosis.assessment import (
    Comparison,
    Sizes,
    acts_in,
    by_recording,
    combinations,
    depends_on,
    estimates,
    locate,
    tell_apart,
)
from gpsim.diagnosis.fitting import Fit, Problem
from gpsim.diagnosis.judging import Attribution, Judgement, odds_against
from gpsim.diagnosis.own import by_name, parted
from gpsim.diagnosis.report import (
    Alternative,
    BroughtFrom,
    Diagnosis,
    Doubt,
    Form,
    HeldOutFit,
    MeasuredCurve,
    NamedEffect,
    Remainder,
    RemainderGp,
    Share,
    Verdict,
)
from gpsim.diagnosis.setup import Question, not_asked
from gpsim.effects import Term, origins, owner_of
from gpsim.residuals import held_out_names

MOST_TOLD = 60  # hypotheses of the ranking


@dataclass(frozen=True)
class Answer:
    """What may be said: the verdict, the judgement it is about, what that is worth, whether its laws hold.

    sizes: of the leader's effects; doubts: what keeps them from being named; curves: those of its effects that were
    measured, by family, place and variant.
    """

    verdict: Verdict
    judgement: Judgement
    attribution: Attribution
    comparison: Comparison
    forms: tuple[Form, ...]
    sizes: Sizes
    doubts: tuple[Doubt, ...]
    curves: Mapping[tuple[str, str, str], MeasuredCurve] = field(default_factory=dict)


def account(question: Question, answer: Answer) -> Diagnosis:
    """The result: facts alone, what a person would say of them is made in reports."""
    problem = question.everything
    judgement, comparison, attribution = answer.judgement, answer.comparison, answer.attribution
    leader, rivalled = judgement.leader, answer.verdict in ("ambiguous", "partial")
    remainder = _remainder(problem, answer)
    names = [source.name for source in question.recording.sources]
    effects = _weighed(_effects(question, answer, leader, judgement.probabilities[0], answer.sizes), answer)
    return Diagnosis(
        verdict=answer.verdict,
        location=locate(question, judgement, comparison, answer.verdict),
        doubts=answer.doubts,
        effects=effects,
        alternatives=tuple(_rival(question, answer, i) for i in range(len(judgement.rivals))),
        tell_apart=None,
        discrimination=tell_apart(problem, judgement) if rivalled else None,
        fit=_fit(question, comparison, remainder.depends_on),
        remainder=remainder,
        integration=leader.hypothesis.scheme,
        tuned=comparison.tuned,
        dt=question.recording.dt,
        thinned=question.thinned,
        not_measured=tuple(question.hidden),
        explained=replace(attribution.explained, one_step=comparison.shares),
        not_asked=not_asked(question),
        combinations=by_name(combinations(problem, leader, judgement.rivals), names),
        ranking=tuple(tried.entry for tried in judgement.ranking[:MOST_TOLD]),
        facts=question.facts,
        recordings=by_recording(question, judgement, attribution, effects),
        brought=_brought(judgement),
    ).settled()


def _brought(judgement: Judgement) -> dict[str, BroughtFrom] | None:
    """Where the families of the account and its rivals are from that a user brought."""
    told = (judgement.leader, *judgement.rivals)
    found = origins(term.family for fit in told for term in fit.hypothesis.terms)
    return {family: BroughtFrom(of["reference"], of["sha256"]) for family, of in found.items()} or None


def _rival(question: Question, answer: Answer, index: int) -> Alternative:
    judgement = answer.judgement
    found, probability = judgement.rivals[index], judgement.probabilities[1 + index]
    sizes = estimates(question, found, 1.0 - answer.attribution.share.share)
    effects = _effects(question, answer, found, probability, sizes)
    told = zip(effects, found.hypothesis.terms, strict=True)
    return Alternative(
        tuple(replace(effect, on=on) for effect, term in told for on in term.places), probability
    )


def _fit(question: Question, comparison: Comparison, remaining: tuple[str, ...]) -> HeldOutFit:
    """Held-out errors. remaining: on what what is left depends, of which a Gaussian process makes its guess."""
    box = comparison.black_box
    if box is not None and not box.depends_on:
        box = replace(box, depends_on=remaining)
    held_out = tuple(held_out_names(question.recording))
    return HeldOutFit(held_out, comparison.one_step, comparison.rollout, box)


def _weighed(effects: Sequence[NamedEffect], answer: Answer) -> tuple[NamedEffect, ...]:
    """The effects with what they are worth."""
    worth, terms = answer.attribution, answer.judgement.leader.hypothesis.terms
    parts = zip(effects, worth.importance, worth.needed, worth.roles, answer.forms, terms, strict=True)
    return tuple(
        replace(
            effect,
            on=on,
            importance=_part(importance, term),
            needed=_part(needed, term),
            role=role,
            form=form,
        )
        for effect, importance, needed, role, form, term in parts
        for on in term.places
    )


def _part(share: Share, term: Term) -> Share:
    """What one of the places on which a term acts alike is worth."""
    low, high = (None if edge is None else edge / len(term.places) for edge in (share.low, share.high))
    return replace(share, share=share.share / len(term.places), low=low, high=high)


def _remainder(problem: Problem, answer: Answer) -> Remainder:
    judgement, comparison = answer.judgement, answer.comparison
    shares = comparison.shares
    least = min(shares, key=lambda name: shares[name].share, default=None)
    return Remainder(
        judgement.structured,
        tuple(_remaining(problem, comparison)) if judgement.structured else (),
        judgement.p_value,
        None,
        _gp(comparison, judgement.leader),
        None if answer.verdict == "none" else 1.0 - answer.attribution.share.share,
        least,
    )


def _gp(comparison: Comparison, leader: Fit) -> RemainderGp:
    """Whether a Gaussian process models what is left, beside the effects or, in their place, the base alone."""
    found = comparison.corrected
    if found is None:
        return RemainderGp(False, None, None, comparison.why_no_gp)
    named = leader.hypothesis.terms and found.hypothesis == leader.hypothesis
    return RemainderGp(True, "effects" if named else "base", None)


def _remaining(problem: Problem, comparison: Comparison) -> list[str]:
    return depends_on(problem.simulator, comparison, comparison.left_after)


def _effects(
    question: Question,
    answer: Answer,
    found: Fit,
    probability: float,
    sizes: Sizes,
) -> tuple[NamedEffect, ...]:
    problem, judgement = question.everything, answer.judgement
    if not found.hypothesis.terms:
        return ()
    names = [source.name for source in question.recording.sources]
    leads, out = found is judgement.leader, []
    for i, (term, known) in enumerate(zip(found.hypothesis.terms, sizes, strict=True)):
        parameters, own = parted(known, names)
        alone = bool(own) and not any(owner_of(name) is None for name in known)
        out.append(
            NamedEffect(
                family=term.family,
                on=term.on,
                site=term.effect.site,
                parameters=parameters,
                region=term.gate.region,
                since=None if term.gate.since is None else term.gate.since + question.origin,
                since_episode=question.episode_name(term.gate.since_episode),
                acts_in=acts_in(problem, term) if term.gate else None,
                probability=probability,
                odds=odds_against(judgement.ranking, found.hypothesis, term.identity),
                evidence_gain=judgement.gains[i] if leads else 0.0,
                explains=answer.attribution.importance[i].share if leads else 0.0,
                recordings=tuple(own) if alone else None,
                own=own or None,
                curve=answer.curves.get((term.family, term.on, term.variant)),
            )
        )
    return tuple(out)
