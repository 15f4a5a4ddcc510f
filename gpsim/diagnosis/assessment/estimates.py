"""The sizes of an explanation's effects: values, 90 % intervals, what stopped at a bound, what no machine has."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from gpsim.channels import FloatArray
from gpsim.diagnosis.assessment.intervals import intervals
from gpsim.diagnosis.assessment.model_error import model_error, with_model_error
from gpsim.diagnosis.fitting import Fit, Hypothesis, Problem
from gpsim.diagnosis.report import Estimate
from gpsim.diagnosis.setup import Question
from gpsim.effects import (
    RISE,
    EffectParameter,
    ParameterEffect,
    Term,
    base_name,
    own_name,
    owner_of,
    times_beyond,
)
from gpsim.simulators import Simulator

AT_BOUND = 1e-3  # of a bound: a value that near it was held back by it
Sizes = tuple[Mapping[str, Estimate], ...]
"""Of every term its parameters by name."""


def estimates(question: Question, found: Fit, left: float) -> Sizes:
    """Of every term of an explanation. left: of the mismatch what is left.

    What is one recording's own is told apart by its parameter's name (see `gpsim.effects.own`).
    """
    bounds = _intervals(question.everything, found, left)
    out, at = [], 0
    for term, declared in zip(found.hypothesis.terms, found.hypothesis.declared, strict=True):
        sizes = {p.name: _estimate(p, term, bounds[at + i]) for i, p in enumerate(declared)}
        at += len(declared)
        for owner in dict.fromkeys(map(owner_of, sizes)):
            sizes |= _in_other_words(question, found, term, owner, sizes)
        sizes |= _not_asked(question.everything.simulator, term, sizes)
        out.append(sizes)
    return tuple(out)


def _intervals(problem: Problem, found: Fit, left: float) -> FloatArray:
    """(P, 2): what the data know of each parameter, less what physics without a name may have done to it."""
    bounds, settings = intervals(problem, found), problem.run.settings.intervals
    if not found.hypothesis.terms:
        return bounds
    error = model_error(left, settings)
    out, at = [], 0
    for term, declared in zip(found.hypothesis.terms, found.hypothesis.declared, strict=True):
        values = np.array([term.values[p.name] for p in declared])
        own = bounds[at : at + len(declared)]
        out.append(with_model_error(own, values, declared, error, settings.level))
        at += len(declared)
    return np.concatenate(out)


def _estimate(parameter: EffectParameter, term: Term, interval: FloatArray) -> Estimate:
    value, (low, high) = term.values[parameter.name], (float(edge) for edge in interval)
    usual = parameter.plausible if times_beyond(parameter, value) > 1.0 else None
    if parameter.exact:
        return Estimate(value, *parameter.exact, parameter.unit, usual=usual)
    # Where one of several parameters does nothing the law is a simpler one, and no search was held back.
    ends = [b for b in (parameter.low, parameter.high) if b != parameter.none or len(term.values) == 1]
    held = any(math.isclose(value, bound, rel_tol=AT_BOUND) for bound in ends)
    if parameter.place and low <= parameter.low and parameter.high <= high:
        held = False  # where it is cannot be seen at all, as what lies across a planar arm
    return Estimate(value, low, high, parameter.unit, held, usual)


def _in_other_words(
    question: Question, found: Fit, term: Term, owner: int | None, sizes: Mapping[str, Estimate]
) -> dict[str, Estimate]:
    """Coefficient for force and force for coefficient, where the simulator knows the normal force.

    owner: the recording whose own these are, None: shared ones.
    """
    problem = question.everything
    parameters = {base_name(name): size for name, size in sizes.items() if owner_of(name) == owner}
    if "coefficient" not in term.effect.variants or len(parameters) != 1:
        return {}
    mean = _mean_load(problem, found.hypothesis, term.on, owner)
    if mean is None:
        return {}
    unit = next((c.force_unit for c in problem.simulator.coordinates if c.name == term.on), "N")
    ((name, given),) = parameters.items()
    others = {"coefficient": ("force", mean, unit), "force": ("coefficient", 1.0 / mean, "1")}
    if name not in others:
        return {}
    other, times, unit = others[name]
    low, high = (None if edge is None else edge * times for edge in (given.low, given.high))
    name = other if owner is None else own_name(other, owner)
    return {name: Estimate(given.value * times, low, high, unit, given.at_bound)}


def _not_asked(simulator: Simulator, term: Term, sizes: Mapping[str, Estimate]) -> dict[str, Estimate]:
    """Values that were chosen before anything was fitted: the speed below which a joint's friction grows."""
    units = {c.name: simulator.state.units[c.velocity] for c in simulator.coordinates}
    left = [name for name in term.values if name not in sizes and term.variant == RISE]
    return {name: Estimate(term.values[name], None, None, units[term.on]) for name in left}


def _mean_load(problem: Problem, hypothesis: Hypothesis, on: str, owner: int | None) -> float | None:
    """Mean normal force of a coordinate, by the parameters that the hypothesis corrects.

    owner: of several recordings the one over which it is, by what is corrected there; None: over all.
    """
    windows, parameters = problem.windows, dict(problem.parameters)
    if owner is not None:
        windows = windows.take(np.flatnonzero(windows.sources == owner))
    for term in hypothesis.in_recording(owner).terms:
        if isinstance(term.effect, ParameterEffect) and not term.gate:
            believed = np.array([parameters[term.on]])
            parameters[term.on] = float(term.effect.corrected(believed, _arrays(term.values))[0])
    state, action = windows.measured[:, 0], windows.actions[:, 0]
    rates = problem.simulator.rates(state, action, parameters)
    load = problem.simulator.normal_force(state, rates, parameters).get(on)
    return None if load is None else float(np.mean(load))


def _arrays(values: Mapping[str, float]) -> dict[str, FloatArray]:
    return {name: np.array([value]) for name, value in values.items()}
