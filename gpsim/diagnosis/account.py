"""What a diagnosis found, put together: the effects with their numbers, the rivals, the fit and what is left."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from gpsim.channels import BoolArray, FloatArray
from gpsim.diagnosis.assessment import Comparison, depends_on, intervals, locate, tell_apart
from gpsim.diagnosis.fitting import Fit, Hypothesis, Problem, fit, gain
from gpsim.diagnosis.judgement import Judgement, odds_against
from gpsim.diagnosis.report import (
    Alternative,
    Diagnosis,
    Estimate,
    HeldOutFit,
    MissingLaw,
    NamedEffect,
    Remainder,
    RemainderGp,
)
from gpsim.diagnosis.setup import Question
from gpsim.effects import EffectParameter, ParameterEffect, Term
from gpsim.residuals import held_out_names

AT_BOUND = 1e-3  # of a bound: a value that near it was held back by it


def account(question: Question, judgement: Judgement, comparison: Comparison) -> Diagnosis:
    """The result: facts alone, what a person would say of them is made in reports."""
    problem = question.everything
    leader = judgement.leader
    return Diagnosis(
        verdict=judgement.verdict,
        location=locate(question, judgement, comparison),
        effects=_effects(question, judgement, leader, judgement.probabilities[0]),
        alternatives=tuple(
            Alternative(_effects(question, judgement, rival, p), p)
            for rival, p in zip(judgement.rivals, judgement.probabilities[1:], strict=True)
        ),
        tell_apart=None,
        discrimination=tell_apart(problem, judgement),
        fit=HeldOutFit(tuple(held_out_names(question.recording)), comparison.one_step, comparison.rollout),
        remainder=Remainder(
            judgement.structured,
            tuple(_remaining(problem, comparison)) if judgement.structured else (),
            judgement.p_value,
            _missing_law(judgement),
            _gp(comparison, leader),
        ),
        integration=leader.hypothesis.scheme,
        tuned=comparison.tuned,
        dt=question.recording.dt,
        thinned=question.thinned,
        not_measured=tuple(question.hidden),
        ranking=tuple(ranked.entry for ranked in judgement.ranking),
        facts=question.facts,
    ).settled()


def _missing_law(judgement: Judgement) -> MissingLaw | None:
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
    question: Question, judgement: Judgement, found: Fit, probability: float
) -> tuple[NamedEffect, ...]:
    problem = question.everything
    if not found.hypothesis.terms:
        return ()
    bounds = intervals(problem, found)
    calls = [(question, judgement, found, i) for i in range(len(found.hypothesis.terms))]
    lesser = problem.run.side_by_side(_without, calls)
    out, at = [], 0
    for index, (term, declared) in enumerate(
        zip(found.hypothesis.terms, found.hypothesis.declared, strict=True)
    ):
        parameters = {p.name: _estimate(p, term, bounds[at + i]) for i, p in enumerate(declared)}
        at += len(declared)
        parameters |= _in_other_words(question, found, term, parameters)
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
            )
        )
    return tuple(out)


def _estimate(parameter: EffectParameter, term: Term, interval: FloatArray) -> Estimate:
    value, (low, high) = term.values[parameter.name], (float(edge) for edge in interval)
    held = any(math.isclose(value, bound, rel_tol=AT_BOUND) for bound in (parameter.low, parameter.high))
    return Estimate(value, low, high, parameter.unit, held)


def _without(question: Question, judgement: Judgement, found: Fit, index: int) -> Fit:
    """The fit with one term less, integrated by the same scheme on as fine a grid."""
    problem, less = question.everything, found.hypothesis.without(index)
    grid = problem.as_finely(less, found.hypothesis)
    if grid is problem and not less.terms and less.scheme == judgement.null.hypothesis.scheme:
        return judgement.null
    return fit(grid, less, found.starts, iterations=12, tolerance=0.2, near=True)


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
