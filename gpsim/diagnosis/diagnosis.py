"""Recording x simulator -> Diagnosis."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from gpsim.channels import FloatArray
from gpsim.corrected import EffectsPlant
from gpsim.diagnosis.assessment import Comparison, compare, depends_on, intervals, locate, tell_apart
from gpsim.diagnosis.data import held_out_names
from gpsim.diagnosis.fitting import Fit, Hypothesis, Problem, fit, gain
from gpsim.diagnosis.judgement import Judgement, judge, odds_against
from gpsim.diagnosis.run import Run
from gpsim.diagnosis.selection import Note, prune_on_held_out, refine_grid, refit, search, stepwise
from gpsim.diagnosis.setup import Question, offers_of, prepare
from gpsim.effects import ParameterEffect, Scheme, Term
from gpsim.recordings import Recording
from gpsim.simulators import Simulator

SCHEMA = "gpsim.diagnosis/1"
AT_BOUND = 1e-3  # of a bound: a value that near it was held back by it
USUAL_EFFORT = 1.5e8  # simulated rows that a judgement takes: a scale for its progress


@dataclass(frozen=True)
class Diagnosis:
    """What was found. report: the contract's diagnosis.json; plant: the corrected simulator, without its GP."""

    report: dict[str, Any]
    plant: EffectsPlant
    judgement: Judgement
    comparison: Comparison
    question: Question


def diagnose(
    recording: Recording,
    simulator: Simulator,
    parameters: Mapping[str, float],
    rng: np.random.Generator,
    note: Note = lambda done, total, text: None,
    run: Run | None = None,
) -> Diagnosis:
    """Locate, name, model and judge; raises UsageError where nothing can be said.

    The pipeline on one page; every step takes what those before it returned. run: settings, and workers to share the
    work with; the defaults and nobody without one.
    """
    run = run or Run()
    step = _Steps(run, note)
    step("prepare", 0, "cutting windows")
    question = prepare(recording, simulator, parameters, run)
    offers = offers_of(question)
    step("search", 5)
    found = search(question.searched, offers, _scheme(recording), step.share(5, 40))
    step("refine grid", 40, "fitting the best on all windows")
    question, found = refine_grid(question, found)
    step("refit", 40, "fitting the best on all windows")
    contenders = refit(question, found)
    step("stepwise", 40)
    contenders = stepwise(question, contenders, offers, step.by_budget(40, 90))
    step("prune on held-out", 90, "asking held-out windows")
    contenders = prune_on_held_out(question, contenders)
    step("judge", 90, "looking for rivals, and for what is left")
    judgement = judge(question, contenders, found)
    step("compare", 90, "comparing on held-out data")
    comparison = compare(question, judgement, offers, rng)
    report = _report(question, judgement, comparison)
    step("done", 100, "done")
    plant = _corrected(question, judgement, recording.dt)
    return Diagnosis(report, plant, judgement, comparison, question)


def _scheme(recording: Recording) -> Scheme:
    return recording.integrator  # type: ignore[return-value]  # `prepare` has checked it


def _corrected(question: Question, judgement: Judgement, dt: float) -> EffectsPlant:
    """The simulator with the leading effects, without a Gaussian process."""
    problem, leader = question.everything, judgement.leader.hypothesis
    return EffectsPlant(
        problem.simulator,  # in which the recording's angles wrap
        dict(problem.parameters),
        leader.terms,
        leader.scheme if leader.terms else _scheme(question.recording),
        math.ceil(problem.substeps / question.thinned),  # those are of a thinned transition
        dt,
    )


@dataclass(frozen=True)
class _Steps:
    """Tells what is going on, and writes down for which step decisions are made."""

    run: Run
    note: Note

    def __call__(self, name: str, done: int, text: str = "") -> None:
        self.run.trace.step = name
        if text:
            self.note(done, 100, text)

    def share(self, first: int, last: int) -> Note:
        """A step's own progress as a part of the whole."""
        return lambda done, total, text: self.note(first + (last - first) * done // total, 100, text)

    def by_budget(self, first: int, last: int) -> Callable[[str], None]:
        """Progress from `first` on, the slower the nearer to `last`: how many rounds there will be nobody knows."""
        budget, begun = self.run.budget, self.run.budget.spent

        def tell(text: str) -> None:
            done = last - round((last - first) * math.exp(-(budget.spent - begun) / USUAL_EFFORT))
            self.note(done, 100, text)

        return tell


def _report(question: Question, judgement: Judgement, comparison: Comparison) -> dict[str, Any]:
    problem = question.everything
    leader = judgement.leader
    return {
        "schema": SCHEMA,
        "verdict": judgement.verdict,
        "location": locate(question, judgement, comparison),
        "effects": _effects(question, judgement, leader, judgement.probabilities[0]),
        "alternatives": [
            {"effects": _effects(question, judgement, rival, p), "probability": p}
            for rival, p in zip(judgement.rivals, judgement.probabilities[1:], strict=True)
        ],
        "tell_apart": tell_apart(problem, judgement),
        "fit": {
            "held_out": held_out_names(question.recording),
            "one_step": comparison.one_step,
            "rollout": comparison.rollout,
        },
        "remainder": {
            "structured": judgement.structured,
            "depends_on": _remaining(problem, comparison) if judgement.structured else [],
            "p_value": judgement.p_value,
            "lack_of_fit": _lack_of_fit(judgement),
            "gp": _gp(comparison, leader),
        },
        "integration": leader.hypothesis.scheme,
        "tuned": comparison.tuned,
        "dt": question.recording.dt,
        "thinned": question.thinned,
        "not_measured": list(question.hidden),
        "ranking": [ranked.entry for ranked in judgement.ranking],
    }


def _lack_of_fit(judgement: Judgement) -> dict[str, Any] | None:
    """Which smooth law of which rate would explain more, whether chance could have done it."""
    lack = judgement.lack
    if lack is None:
        return None
    return {
        "rate": lack.rate,
        "on": list(lack.on),
        "memory": lack.memory,
        "nats": round(lack.nats, 2),
        "p_value": lack.p_value,
    }


def _gp(comparison: Comparison, leader: Fit) -> dict[str, Any]:
    """Whether a Gaussian process models what is left, beside the effects or, in their place, the base alone."""
    found = comparison.corrected
    if found is None:
        return {"used": False, "beside": None, "why_not": comparison.why_no_gp}
    named = leader.hypothesis.terms and found.hypothesis == leader.hypothesis
    return {"used": True, "beside": "effects" if named else "base", "why_not": None}


def _remaining(problem: Problem, comparison: Comparison) -> list[str]:
    return depends_on(problem.simulator, comparison, comparison.left_after)


def _effects(
    question: Question, judgement: Judgement, found: Fit, probability: float
) -> list[dict[str, Any]]:
    problem = question.everything
    if not found.hypothesis.terms:
        return []
    bounds = intervals(problem, found)
    calls = [(question, judgement, found, i) for i in range(len(found.hypothesis.terms))]
    lesser = problem.run.side_by_side(_without, calls)
    out, at = [], 0
    for index, (term, declared) in enumerate(
        zip(found.hypothesis.terms, found.hypothesis.declared, strict=True)
    ):
        parameters: dict[str, dict[str, Any]] = {}
        for i, p in enumerate(declared):
            low, high = (float(v) for v in bounds[at + i])
            value = term.values[p.name]
            parameters[p.name] = {"value": value, "low": low, "high": high, "unit": p.unit}
            parameters[p.name] |= {
                "at_bound": any(math.isclose(value, bound, rel_tol=AT_BOUND) for bound in (p.low, p.high))
            }
        at += len(declared)
        parameters |= _in_other_words(question, found, term, parameters)
        without = lesser[index]
        spoken = {name: f"{v['value']:.4g} {v['unit']}".removesuffix(" 1") for name, v in parameters.items()}
        out.append(
            {
                "family": term.family,
                "on": term.on,
                "site": term.effect.site,
                "parameters": parameters,
                "region": {k: list(v) for k, v in term.gate.region.items()},
                "since": None if term.gate.since is None else term.gate.since + question.origin,
                "since_episode": question.episode_name(term.gate.since_episode),
                "probability": probability,
                "odds": odds_against(judgement.ranking, found.hypothesis, term.identity),
                "evidence_gain": gain(problem, found, without),
                "explains": _share(judgement.noise, found, without, problem.observed),
                "sentence": term.effect.sentence(term.on, spoken),
            }
        )
    return out


def _without(question: Question, judgement: Judgement, found: Fit, index: int) -> Fit:
    """The fit with one term less, integrated by the same scheme on as fine a grid."""
    problem, less = question.everything, found.hypothesis.without(index)
    grid = problem.as_finely(less, found.hypothesis)
    if grid is problem and not less.terms and less.scheme == judgement.null.hypothesis.scheme:
        return judgement.null
    return fit(grid, less, found.starts, iterations=12, tolerance=0.2, near=True)


def _share(
    noise: FloatArray, found: Fit, without: Fit, observed: np.ndarray[Any, np.dtype[np.bool_]]
) -> float:
    """The largest share of a channel's excess over noise that the term takes away."""
    excess = np.maximum(without.variance - noise**2, 1e-300)
    share = (without.variance - np.maximum(found.variance, noise**2)) / excess
    return float(np.clip(share[observed & (without.variance > 1.05 * noise**2)], 0.0, 1.0).max(initial=0.0))


def _in_other_words(
    question: Question, found: Fit, term: Term, parameters: Mapping[str, dict[str, Any]]
) -> dict[str, dict[str, Any]]:
    """Coefficient for force and force for coefficient, where the simulator knows the normal force."""
    problem = question.everything
    if "coefficient" not in term.effect.variants or len(parameters) != 1:
        return {}
    mean = _mean_load(problem, found.hypothesis, term.on)
    if mean is None:
        return {}
    unit = next((c.force_unit for c in problem.simulator.coordinates if c.name == term.on), "N")
    ((name, given),) = parameters.items()
    other = {"coefficient": ("force", mean, unit), "force": ("coefficient", 1.0 / mean, "1")}.get(name)
    if other is None:
        return {}
    return {
        other[0]: {
            key: None if given[key] is None else given[key] * other[1] for key in ("value", "low", "high")
        }
        | {"unit": other[2], "at_bound": given["at_bound"]}
    }


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
