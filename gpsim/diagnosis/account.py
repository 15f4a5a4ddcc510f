"""What a diagnosis found, put together: the effects with their numbers, the rivals, the fit and what is left."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from gpsim.diagnosis.assessment import (
    Comparison,
    by_recording,
    depends_on,
    design_experiment,
    estimates,
    identifiable_combinations,
    locate,
)
from gpsim.diagnosis.fitting import Fit, Problem
from gpsim.diagnosis.judging import Attribution, Judgement, odds_against
from gpsim.diagnosis.setup import PreparedProblem, not_asked
from gpsim.effects import IN_EPISODE, Term, base_name, closed, origins, owner_of
from gpsim.findings import (
    Alternative,
    BroughtFrom,
    Combination,
    Diagnosis,
    Doubt,
    Estimate,
    Form,
    HeldOutFit,
    MeasuredCurve,
    NamedEffect,
    Remainder,
    RemainderGp,
    Share,
    Verdict,
)
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
    sizes: tuple[Mapping[str, Estimate], ...]
    doubts: tuple[Doubt, ...]
    curves: Mapping[tuple[str, str, str], MeasuredCurve] = field(default_factory=dict)


def account(question: PreparedProblem, answer: Answer) -> Diagnosis:
    """The result: facts alone, what a person would say of them is made in reports."""
    problem = question.everything
    judgement, comparison, attribution = answer.judgement, answer.comparison, answer.attribution
    leader, rivalled = judgement.leader, answer.verdict in ("ambiguous", "partial")
    remainder, box = _remainder(problem, answer), comparison.black_box
    if box is not None:  # a Gaussian process makes its guess of what what is left depends on
        box = replace(box, depends_on=remainder.depends_on)
    held_out, left = tuple(held_out_names(question.recording)), 1.0 - attribution.share.share
    brought = origins(t.family for fit in (leader, *judgement.rivals) for t in fit.hypothesis.terms)
    effects = _effects(question, answer, leader, judgement.probabilities[0], answer.sizes)
    return Diagnosis(
        verdict=answer.verdict,
        location=locate(question, judgement, comparison, answer.verdict),
        doubts=answer.doubts,
        effects=effects,
        alternatives=tuple(
            Alternative(_effects(question, answer, rival, p, estimates(question, rival, left)), p)
            for rival, p in zip(judgement.rivals, judgement.probabilities[1:], strict=True)
        ),
        tell_apart=None,
        discrimination=design_experiment(problem, judgement) if rivalled else None,
        fit=HeldOutFit(held_out, comparison.one_step, comparison.rollout, box),
        remainder=remainder,
        integration=leader.hypothesis.scheme,
        tuned=comparison.tuned,
        dt=question.recording.dt,
        thinned=question.thinned,
        not_measured=tuple(question.hidden),
        explained=replace(attribution.explained, one_step=comparison.shares),
        not_asked=not_asked(question),
        combinations=_called(question, identifiable_combinations(problem, leader, judgement.rivals)),
        ranking=tuple(tried.entry for tried in judgement.ranking[:MOST_TOLD]),
        facts=question.facts,
        recordings=by_recording(question, judgement, attribution, effects),
        brought={f: BroughtFrom(of["reference"], of["sha256"]) for f, of in brought.items()} or None,
    ).settled()


def _remainder(problem: Problem, answer: Answer) -> Remainder:
    """What is left, and whether a Gaussian process models it, beside the effects or, in their place, the base alone."""
    judgement, comparison, leader = answer.judgement, answer.comparison, answer.judgement.leader.hypothesis
    shares, found = comparison.shares, comparison.corrected
    gp = RemainderGp(False, None, None, comparison.why_no_gp)
    if found is not None:
        gp = RemainderGp(True, "effects" if leader.terms and found.hypothesis == leader else "base", None)
    remaining = (
        depends_on(problem.simulator, comparison, comparison.left_after) if judgement.structured else ()
    )
    return Remainder(
        judgement.structured,
        tuple(remaining),
        judgement.p_value,
        None,
        gp,
        None if answer.verdict == "none" else 1.0 - answer.attribution.share.share,
        min(shares, key=lambda name: shares[name].share, default=None),
    )


def _effects(
    question: PreparedProblem,
    answer: Answer,
    found: Fit,
    probability: float,
    sizes: Sequence[Mapping[str, Estimate]],
) -> tuple[NamedEffect, ...]:
    """The effects of an explanation, on every place on which they act alike; the leader's with what they are worth."""
    problem, judgement, worth = question.everything, answer.judgement, answer.attribution
    robot = closed(problem.simulator)  # what it leaves is of all of its joints
    out: list[NamedEffect] = []
    for i, (term, known) in enumerate(zip(found.hypothesis.terms, sizes, strict=True)):
        parameters, own = _parted(question, known)
        alone = bool(own) and not any(owner_of(name) is None for name in known)
        odds = odds_against(judgement.ranking, found.hypothesis, term.identity)
        effect = NamedEffect(
            family=term.family,
            on=term.on,
            site=term.effect.site,
            parameters=parameters,
            region=term.gate.region,
            since=None if term.gate.since is None else term.gate.since + question.origin,
            since_episode=question.episode_name(term.gate.since_episode),
            acts_in=_acts_in(problem, term) if term.gate else None,
            probability=probability,
            odds=odds,
            evidence_gain=0.0,
            explains=0.0,
            recordings=tuple(own) if alone else None,
            own=own or None,
            curve=answer.curves.get((term.family, term.on, term.variant)),
        )
        if found is judgement.leader:
            effect = replace(
                effect,
                odds=odds if robot else worth.told(odds, judgement.p_value, problem.run.settings.verdict),
                evidence_gain=judgement.gains[i],
                explains=worth.importance[i].share,
                importance=_part(worth.importance[i], term),
                needed=_part(worth.needed[i], term),
                role=worth.roles[i],
                form=answer.forms[i],
            )
        out += [replace(effect, on=on) for on in term.places]
    return tuple(out)


def _part(share: Share, term: Term) -> Share:
    """What one of the places on which a term acts alike is worth."""
    low, high = (None if edge is None else edge / len(term.places) for edge in (share.low, share.high))
    return replace(share, share=share.share / len(term.places), low=low, high=high)


def _acts_in(problem: Problem, term: Term) -> float:
    """The share of what was learnt from, in which the term's gate is open."""
    windows, simulator = problem.windows, problem.simulator
    t = windows.t[:, :-1]
    path = windows.measured[:, :-1], windows.measured[:, 1:]
    episode = {IN_EPISODE: np.broadcast_to(windows.episode[:, None], t.shape).astype(float)}
    step, channels = np.diff(windows.t, axis=1), simulator.state + simulator.action
    share = term.gate.share(path, windows.actions, t, step, channels, episode)
    return float(share[windows.valid[:, 1:]].mean()) if windows.valid[:, 1:].any() else 0.0


def _parted(
    question: PreparedProblem, known: Mapping[str, Estimate]
) -> tuple[dict[str, Estimate], dict[str, dict[str, Estimate]]]:
    """The parameters that recordings share, and recording -> its own; where none is shared, the first one's own."""
    shared = {name: e for name, e in known.items() if owner_of(name) is None}
    own: dict[str, dict[str, Estimate]] = {}
    for place, source in enumerate(question.recording.sources):
        values = {base_name(name): e for name, e in known.items() if owner_of(name) == place}
        if values:
            own[source.name] = values
    return shared or dict(next(iter(own.values()), {})), own


def _called(question: PreparedProblem, found: Sequence[Combination]) -> tuple[Combination, ...]:
    """Combinations of parameters, each of them called by the recording whose own it is."""
    sources = question.recording.sources

    def called(parameter: str) -> str:
        owner = owner_of(parameter) if sources else None
        return parameter if owner is None else f"{base_name(parameter)} in {sources[owner].name}"

    return tuple(replace(c, of=tuple(map(called, c.of))) for c in found)
