"""The sizes of an explanation's effects: values, 90 % intervals, what stopped at a bound, what no machine has.

Intervals are from the quadratic of the fit in its coordinates, widened by what is left: windows are the blocks, and so
are longer runs of neighbouring ones, and where gradients scatter over them more than the model says, that counts (White
1982; over runs as Newey and West 1987); what halving the substep moves is added. Ends are carried to the parameters'
units one by one: a ratio's interval is as wide, in logarithms, to either side.

What is left after a fit is what no named effect could take. What they did take of it went into their sizes, the same
way everywhere, so that neither windows nor runs of them disagree (Kennedy and O'Hagan 2001: a model's inadequacy is no
noise). How much that is was measured on rough worlds, which hold two to four nuisances outside the catalogue.

Where rivals cannot be ruled out that say something else of the same parameter, an interval is that of the mixture
(Hoeting et al. 1999, "Bayesian model averaging", Statistical Science 14): a motor's gain in a mass's place scales all
forces.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from scipy.special import ndtr, ndtri, stdtrit

from gpsim.channels import FloatArray
from gpsim.diagnosis.fitting import Fit, Hypothesis, Problem, Shooting, coordinates
from gpsim.diagnosis.settings import IntervalSettings
from gpsim.diagnosis.setup import PreparedProblem
from gpsim.effects import (
    RISE,
    EffectParameter,
    ParameterEffect,
    Term,
    base_name,
    closed,
    own_name,
    owner_of,
    times_beyond,
)
from gpsim.findings import Estimate
from gpsim.simulators import Simulator

OPEN = 1e-13  # of the largest curvature: the windows know as much at least of any direction
RUNS_OF_WINDOWS = 20  # runs of neighbouring windows whose gradients scatter, too: what drifts shows there
AT_BOUND = 1e-3  # of a bound: a value that near it was held back by it
TINY = 1e-150  # guards a division, squared or not
GRID = 4001  # places at which a mixture's distribution is worked out


def estimates(question: PreparedProblem, found: Fit, left: float) -> tuple[dict[str, Estimate], ...]:
    """Of every term of an explanation its parameters by name. left: of the mismatch what has no name.

    What is one recording's own is told apart by its parameter's name (see `gpsim.effects.term`). Intervals are what the
    data know of each parameter, and what physics without a name may have done to it.
    """
    problem, hypothesis = question.everything, found.hypothesis
    settings = problem.run.settings.intervals
    error = model_error(left, settings)
    bounds, out, at = intervals(problem, found), [], 0
    for term, declared in zip(hypothesis.terms, hypothesis.declared, strict=True):
        values = np.array([term.values[p.name] for p in declared])
        known = bounds[at : at + len(declared)]
        at += len(declared)
        wide = with_model_error(known, values, declared, error, settings.level)
        sizes = {p.name: _estimate(p, term, ends) for p, ends in zip(declared, wide, strict=True)}
        for owner in dict.fromkeys(map(owner_of, sizes)):
            sizes |= _in_other_words(problem, hypothesis, term, owner, sizes)
        sizes |= _not_asked(problem.simulator, term, sizes)
        out.append(sizes)
    return tuple(out)


def averaged(
    question: PreparedProblem, leader: Fit, rivals: Sequence[Fit], probabilities: Sequence[float], left: float
) -> tuple[dict[str, Estimate], ...]:
    """The leader's estimates, with intervals that hold what rivals say of the same, as likely as they are.

    probabilities: of the leader, then of the rivals; left: as of `estimates`.
    """
    own, *others = (estimates(question, found, left) for found in (leader, *rivals))
    level, out = question.run.settings.intervals.level, []
    for term, sizes in zip(leader.hypothesis.terms, own, strict=True):
        told = [
            (p, said)
            for p, found, every in zip(probabilities[1:], rivals, others, strict=True)
            for other, said in zip(found.hypothesis.terms, every, strict=True)
            if (other.identity, other.variant, other.gate) == (term.identity, term.variant, term.gate)
        ]
        out.append(
            {
                name: _mixed(
                    size, [(probabilities[0], size), *((p, e[name]) for p, e in told if name in e)], level
                )
                for name, size in sizes.items()
            }
        )
    return tuple(out)


def _mixed(own: Estimate, parts: Sequence[tuple[float, Estimate]], level: float) -> Estimate:
    """The estimate with the interval of a mixture of normal distributions, no narrower than its own."""
    if len(parts) < 2 or any(e.low is None or e.high is None for _, e in parts):
        return own
    weights, middles = (np.array(x) for x in zip(*((p, e.value) for p, e in parts), strict=True))
    ends = np.array([(e.low, e.high) for _, e in parts], dtype=float)
    deviations = np.maximum(
        np.ptp(ends, axis=1) / (2 * ndtri(0.5 + level / 2)), 1e-12 * np.abs(middles) + TINY
    )
    far = 10.0 * deviations.max()
    x = np.linspace(middles.min() - far, middles.max() + far, GRID)
    below = ndtr((x[:, None] - middles) / deviations) @ weights / weights.sum()
    low, high = (float(np.interp(0.5 + side * level / 2, below, x)) for side in (-1, 1))
    return replace(own, low=min(low, ends[0, 0]), high=max(high, ends[0, 1]))


def _estimate(parameter: EffectParameter, term: Term, interval: FloatArray) -> Estimate:
    value, (low, high) = term.values[parameter.name], (float(edge) for edge in interval)
    usual = parameter.plausible if times_beyond(parameter, value) > 1.0 else None
    if parameter.exact:
        return Estimate(value, *parameter.exact, parameter.unit, usual=usual)
    # Where one of several parameters does nothing the law is a simpler one, and no search was held back.
    ends = [b for b in (parameter.low, parameter.high) if b != parameter.none or len(term.values) == 1]
    # Where it is cannot be seen at all, as what lies across a planar arm.
    anywhere = parameter.place and low <= parameter.low and parameter.high <= high
    return Estimate(value, low, high, parameter.unit, stopped(value, *ends) and not anywhere, usual)


def _in_other_words(
    problem: Problem, hypothesis: Hypothesis, term: Term, owner: int | None, sizes: Mapping[str, Estimate]
) -> dict[str, Estimate]:
    """Coefficient for force and force for coefficient, where the simulator knows the normal force.

    owner: the recording whose own these are, None: shared ones.
    """
    own = {base_name(name): size for name, size in sizes.items() if owner_of(name) == owner}
    if "coefficient" not in term.effect.variants or len(own) != 1:
        return {}
    ((name, given),) = own.items()
    mean = _mean_load(problem, hypothesis, term.on, owner)
    if mean is None or name not in ("coefficient", "force"):
        return {}
    other, times, unit = "coefficient", 1.0 / mean, "1"
    if name == "coefficient":
        unit = next((c.force_unit for c in problem.simulator.coordinates if c.name == term.on), "N")
        other, times = "force", mean
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
            values = {name: np.array([value]) for name, value in term.values.items()}
            believed = np.array([parameters[term.on]])
            parameters[term.on] = float(term.effect.corrected(believed, values)[0])
    state, action = windows.measured[:, 0], windows.actions[:, 0]
    rates = problem.simulator.rates(state, action, parameters)
    load = problem.simulator.normal_force(state, rates, parameters).get(on)
    return None if load is None else float(np.mean(load))


def intervals(problem: Problem, fit: Fit, level: float | None = None) -> FloatArray:
    """(P, 2): the interval of each parameter that holds it with a probability `level`, the usual one without it."""
    level = level or problem.run.settings.intervals.level
    if not len(fit.z):
        return np.empty((0, 2))
    own = coordinates(fit.hypothesis.parameters)
    freedom = max(len(problem.windows) - len(fit.z), 2)
    half = stdtrit(freedom, 0.5 + level / 2) * np.sqrt(np.diag(_covariance(problem, fit)))
    half = half + np.abs(_numerical_shift(problem, fit))
    ends = np.stack(
        [own.natural(np.clip(fit.z + side * half, own.low, own.high)) for side in (-1.0, 1.0)], axis=1
    )
    return np.sort(ends, axis=1)


def covariance(problem: Problem, fit: Fit) -> FloatArray:
    """(P, P): how uncertain the parameters are together, in their units, widened as the intervals are."""
    slope = coordinates(fit.hypothesis.parameters).slope(fit.z)
    return np.asarray(_covariance(problem, fit) * np.outer(slope, slope))


def informed(problem: Problem, fit: Fit) -> FloatArray:
    """(P, P): the information on each parameter, in its unit, as much less as correlation and scatter make of it."""
    found = _with_slopes(problem, fit)
    information = found.by_window.sum(axis=0)
    own = np.diag(_inverse(information))
    widened = np.diag(_covariance(problem, found)) / np.maximum(own, TINY)
    slope = coordinates(fit.hypothesis.parameters).slope(found.z)
    return np.asarray(information / max(float(np.median(widened)), 1.0) / np.outer(slope, slope))


def _with_slopes(problem: Problem, fit: Fit) -> Fit:
    """The fit with what its windows say of all parameters of its hypothesis, whatever was fitted."""
    shooting = Shooting(problem, fit.noise)
    point = shooting.at(fit.hypothesis, fit.starts)
    by_window, gradients, _, _ = shooting.slopes(point).projected()
    return replace(point, by_window=by_window, gradients=gradients)


def _covariance(problem: Problem, fit: Fit) -> FloatArray:
    """(P, P) of the coordinates: the largest of the model's own and of the scatter over windows and runs of them."""
    inverse = _inverse(fit.information)
    ratio, order = np.ones(len(inverse)), np.lexsort((problem.windows.t[:, 0], problem.windows.episode))
    runs = np.array_split(fit.gradients[order], min(RUNS_OF_WINDOWS, len(order)))
    for gradients in (fit.gradients, np.array([run.sum(axis=0) for run in runs])):
        count, size = gradients.shape
        centred = gradients - gradients.mean(axis=0)
        scatter = centred.T @ centred * count / max(count - size, 1)  # of a sum that vanishes
        sandwich = inverse @ scatter @ inverse
        ratio = np.maximum(ratio, np.diag(sandwich) / np.maximum(np.diag(inverse), TINY))
    return np.asarray(inverse * np.sqrt(np.outer(ratio, ratio)))


def _inverse(information: FloatArray) -> FloatArray:
    """Of coordinates of whatever size, scaled to a unit diagonal; an open direction keeps a little information."""
    scale = np.sqrt(np.maximum(np.diag(information), TINY))
    values, vectors = np.linalg.eigh(information / np.outer(scale, scale))
    values = np.maximum(values, OPEN * max(float(values[-1]), 1.0))
    return np.asarray((vectors / values) @ vectors.T / np.outer(scale, scale))


def _numerical_shift(problem: Problem, fit: Fit) -> FloatArray:
    """(P,) how far one Gauss-Newton step moves the coordinates on a grid twice as fine.

    Not of who owns the integration, whose steps were chosen by what halving them changes.
    """
    if fit.hypothesis.scheme != "fine" or closed(problem.simulator) is not None:
        return np.zeros(len(fit.z))
    fine = _with_slopes(replace(problem, substeps=2 * problem.substeps), fit)
    here = _with_slopes(problem, fit)
    moved = fine.gradients.sum(axis=0) - here.gradients.sum(axis=0)
    return np.asarray(_inverse(fit.information) @ moved)


def model_error(left: float, settings: IntervalSettings) -> float:
    """Standard deviation of a size, as a share of what it does. left: share of the mismatch that has no name.

    Shares are of squares, hence the root: what bends a size is as large as what is left, times a number.
    """
    return settings.model_error * math.sqrt(max(left, 0.0))


def with_model_error(
    bounds: FloatArray, values: FloatArray, declared: Sequence[EffectParameter], error: float, level: float
) -> FloatArray:
    """(P, 2): the intervals (P, 2) of one effect's values (P,), widened by a model error, within what may be.

    Sizes are told from the value at which they do nothing. Where something acts (a rest position) has none: it is
    widened as many times as the size beside it that widens most.
    """
    sides = np.abs(bounds - values[:, None])
    sizes = np.abs(values - np.array([p.none for p in declared]))
    wide = np.hypot(sides, ndtri(0.5 + level / 2) * error * sizes[:, None])
    places = np.array([p.place for p in declared])
    if places.any():
        own = np.maximum(sides.max(axis=1), np.finfo(float).tiny)
        times = (wide.max(axis=1) / own)[~places].max(initial=1.0)
        wide[places] = sides[places] * times
    low, high = (np.array([[getattr(p, end)] for p in declared]) for end in ("low", "high"))
    return np.asarray(np.clip(values[:, None] + wide * (-1.0, 1.0), low, high))


def stopped(value: float, *bounds: float) -> bool:
    """Whether a value stopped at a bound of the search."""
    return any(math.isclose(value, bound, rel_tol=AT_BOUND) for bound in bounds)
