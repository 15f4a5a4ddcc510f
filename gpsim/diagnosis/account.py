"""What a diagnosis found, put together: the effects with their numbers, the rivals, the fit and what is left."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from gpsim.channels import BoolArray, FloatArray
from gpsim.diagnosis.assessment import (
    Comparison,
    by_recording,
    combinations,
    depends_on,
    intervals,
    locate,
    model_error,
    tell_apart,
    with_model_error,
)
from gpsim.diagnosis.attribution import Attribution, fits_without
from gpsim.diagnosis.fitting import Fit, Hypothesis, Problem, gain
from gpsim.diagnosis.judgement import Judgement, Laws, odds_against
from gpsim.diagnosis.own import by_name, parted
from gpsim.diagnosis.report import (
    Alternative,
    Curve,
    Diagnosis,
    Estimate,
    HeldOutFit,
    MissingLaw,
    NamedEffect,
    Remainder,
    RemainderGp,
    Verdict,
)
from gpsim.diagnosis.setup import Question, not_asked
from gpsim.effects import EffectParameter, ParameterEffect, Term, owner_of
from gpsim.residuals import held_out_names

AT_BOUND = 1e-3  # of a bound: a value that near it was held back by it


@dataclass(frozen=True)
class Answer:
    """What may be said: the verdict, the judgement it is about, what that is worth, whether its laws hold."""

    verdict: Verdict
    judgement: Judgement
    attribution: Attribution
    comparison: Comparison
    laws: Laws


def account(question: Question, answer: Answer) -> Diagnosis:
    """The result: facts alone, what a person would say of them is made in reports."""
    problem = question.everything
    judgement, comparison, attribution = answer.judgement, answer.comparison, answer.attribution
    leader, rivalled = judgement.leader, answer.verdict in ("ambiguous", "partial")
    names = [source.name for source in question.recording.sources]
    effects = _weighed(_effects(question, answer, leader, judgement.probabilities[0]), answer)
    return Diagnosis(
        verdict=answer.verdict,
        location=locate(question, judgement, comparison, answer.verdict),
        effects=effects,
        alternatives=tuple(
            Alternative(_effects(question, answer, rival, p), p)
            for rival, p in zip(judgement.rivals, judgement.probabilities[1:], strict=True)
        ),
        tell_apart=None,
        discrimination=tell_apart(problem, judgement) if rivalled else None,
        fit=HeldOutFit(tuple(held_out_names(question.recording)), comparison.one_step, comparison.rollout),
        remainder=_remainder(problem, answer),
        integration=leader.hypothesis.scheme,
        tuned=comparison.tuned,
        dt=question.recording.dt,
        thinned=question.thinned,
        not_measured=tuple(question.hidden),
        explained=replace(attribution.explained, one_step=comparison.shares),
        curves=answer.laws.curves,
        not_asked=not_asked(question),
        combinations=by_name(combinations(problem, leader, judgement.rivals), names),
        ranking=tuple(ranked.entry for ranked in judgement.ranking),
        facts=question.facts,
        recordings=by_recording(question, judgement, attribution, effects),
    ).settled()


def _weighed(effects: Sequence[NamedEffect], answer: Answer) -> tuple[NamedEffect, ...]:
    """The effects with what they are worth."""
    worth = answer.attribution
    parts = zip(effects, worth.importance, worth.needed, worth.roles, answer.laws.forms, strict=True)
    return tuple(
        replace(effect, importance=importance, needed=needed, role=role, form=form)
        for effect, importance, needed, role, form in parts
    )


def _remainder(problem: Problem, answer: Answer) -> Remainder:
    judgement, comparison = answer.judgement, answer.comparison
    lack, shares = judgement.lack, comparison.shares
    least = min(shares, key=lambda name: shares[name].share, default=None)
    return Remainder(
        judgement.structured,
        tuple(_remaining(problem, comparison)) if judgement.structured else (),
        judgement.p_value,
        _missing_law(judgement, answer.laws.missing),
        _gp(comparison, judgement.leader),
        None if answer.verdict == "none" else 1.0 - answer.attribution.share.share,
        lack.rate if lack is not None and lack.significant else least,
    )


def _missing_law(judgement: Judgement, curve: Curve | None) -> MissingLaw | None:
    """Which smooth law of which rate would explain more, whether chance could have done it."""
    lack = judgement.lack
    if lack is None:
        return None
    return MissingLaw(
        rate=lack.rate,
        on=tuple(lack.on),
        memory=lack.memory,
        nats=round(lack.nats, 2),
        p_value=lack.p_value,
        curve=curve,
    )


def _gp(comparison: Comparison, leader: Fit) -> RemainderGp:
    """Whether a Gaussian process models what is left, beside the effects or, in their place, the base alone."""
    found = comparison.corrected
    if found is None:
        return RemainderGp(False, None, None, comparison.why_no_gp)
    named = leader.hypothesis.terms and found.hypothesis == leader.hypothesis
    return RemainderGp(True, "effects" if named else "base", None)


def _remaining(problem: Problem, comparison: Comparison) -> list[str]:
    settings = problem.run.settings.location
    return depends_on(problem.simulator, comparison, comparison.left_after, settings)


def _effects(
    question: Question,
    answer: Answer,
    found: Fit,
    probability: float,
) -> tuple[NamedEffect, ...]:
    problem, judgement = question.everything, answer.judgement
    if not found.hypothesis.terms:
        return ()
    bounds, lesser = _intervals(problem, answer, found), fits_without(problem, found, judgement.null)
    out, at = [], 0
    for index, (term, declared) in enumerate(
        zip(found.hypothesis.terms, found.hypothesis.declared, strict=True)
    ):
        estimates = {p.name: _estimate(p, term, bounds[at + i]) for i, p in enumerate(declared)}
        at += len(declared)
        parameters, own = parted(estimates, [source.name for source in question.recording.sources])
        parameters |= _in_other_words(question, found, term, parameters)
        alone = bool(own) and not any(owner_of(name) is None for name in estimates)
        without = lesser[index]
        out.append(
            NamedEffect(
                family=term.family,
                on=term.on,
                site=term.effect.site,
                parameters=parameters,
                region=term.gate.region,
                since=None if term.gate.since is None else term.gate.since + question.origin,
                since_episode=question.episode_name(term.gate.since_episode),
                probability=probability,
                odds=odds_against(judgement.ranking, found.hypothesis, term.identity),
                evidence_gain=gain(problem, found, without),
                explains=_share(judgement.noise, found, without, problem.observed),
                recordings=tuple(own) if alone else None,
                own=own or None,
            )
        )
    return tuple(out)


def _intervals(problem: Problem, answer: Answer, found: Fit) -> FloatArray:
    """(P, 2): what the data know of each parameter, less what physics without a name may have done to it."""
    bounds, lack = intervals(problem, found), answer.judgement.lack
    settings = problem.run.settings.intervals
    if lack is None or not lack.significant:
        return bounds
    error = model_error(1.0 - answer.attribution.share.share, settings)
    out, at = [], 0
    for term, declared in zip(found.hypothesis.terms, found.hypothesis.declared, strict=True):
        values = np.array([term.values[p.name] for p in declared])
        own = bounds[at : at + len(declared)]
        out.append(with_model_error(own, values, declared, error, settings.level))
        at += len(declared)
    return np.concatenate(out)


def _estimate(parameter: EffectParameter, term: Term, interval: FloatArray) -> Estimate:
    value, (low, high) = term.values[parameter.name], (float(edge) for edge in interval)
    held = any(math.isclose(value, bound, rel_tol=AT_BOUND) for bound in (parameter.low, parameter.high))
    return Estimate(value, low, high, parameter.unit, held)


def _share(noise: FloatArray, found: Fit, without: Fit, observed: BoolArray) -> float:
    """The largest share of a channel's excess over noise that the term takes away."""
    excess = np.maximum(without.variance - noise**2, 1e-300)
    share = (without.variance - np.maximum(found.variance, noise**2)) / excess
    return float(np.clip(share[observed & (without.variance > 1.05 * noise**2)], 0.0, 1.0).max(initial=0.0))


def _in_other_words(
    question: Question, found: Fit, term: Term, parameters: Mapping[str, Estimate]
) -> dict[str, Estimate]:
    """Coefficient for force and force for coefficient, where the simulator knows the normal force."""
    problem = question.everything
    if "coefficient" not in term.effect.variants or len(parameters) != 1:
        return {}
    mean = _mean_load(problem, found.hypothesis, term.on)
    if mean is None:
        return {}
    unit = next((c.force_unit for c in problem.simulator.coordinates if c.name == term.on), "N")
    ((name, given),) = parameters.items()
    others = {"coefficient": ("force", mean, unit), "force": ("coefficient", 1.0 / mean, "1")}
    if name not in others:
        return {}
    other, times, unit = others[name]
    low, high = (None if edge is None else edge * times for edge in (given.low, given.high))
    return {other: Estimate(given.value * times, low, high, unit, given.at_bound)}


def _mean_load(problem: Problem, hypothesis: Hypothesis, on: str) -> float | None:
    """Mean normal force of a coordinate over the recording, by the parameters that the hypothesis corrects."""
    windows, parameters = problem.windows, dict(problem.parameters)
    for term in hypothesis.terms:
        if isinstance(term.effect, ParameterEffect) and not term.gate:
            believed = np.array([parameters[term.on]])
            parameters[term.on] = float(term.effect.corrected(believed, _arrays(term.values))[0])
    state, action = windows.measured[:, 0], windows.actions[:, 0]
    rates = problem.simulator.rates(state, action, parameters)
    load = problem.simulator.normal_force(state, rates, parameters).get(on)
    return None if load is None else float(np.mean(load))


def _arrays(values: Mapping[str, float]) -> dict[str, FloatArray]:
    return {name: np.array([value]) for name, value in values.items()}
