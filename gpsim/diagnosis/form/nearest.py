"""From a curve to names: the catalogue's laws of the same site and input that come nearest to it, alone or in twos."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from scipy.optimize import least_squares

from gpsim.channels import FloatArray
from gpsim.diagnosis.fitting import Candidate, Hypothesis, Problem
from gpsim.diagnosis.form.shapes import Measurement, told
from gpsim.diagnosis.form.visited import Law, of_law, places, twists, visited
from gpsim.diagnosis.report import NearestLaw
from gpsim.effects import Term, VehicleEffect, effect_of
from gpsim.recordings import evenly

PLACES = 300  # of what was visited, at which a law is held against a curve
NAMES = 3  # laws that are told
BETTER = 0.5  # of what the best law alone misses: two together are told where they miss less
LARGE = 1e6  # of a law that is not finite
HALF = 0.5  # of what a law misses, that the part of the input where it differs holds at least


@dataclass(frozen=True)
class Near:
    """Laws fitted to a curve, and what of it they miss."""

    candidates: tuple[Candidate, ...]
    terms: tuple[Term, ...]
    law: NearestLaw


def nearest(problem: Problem, found: Measurement, offers: Sequence[Candidate]) -> list[Near]:
    """The best first, at most three: laws alone, and two together where that is much nearer."""
    own = [c for c in offers if _same(c, found)]
    inputs = sampled(problem, found)
    curve = told(found.group, found.shape, inputs)
    alone = sorted((_near(problem, found, (c,), inputs, curve) for c in own), key=lambda n: n.law.misses)
    if not alone:
        return []
    both = [
        _near(problem, found, pair, inputs, curve)
        for pair in combinations(own, 2)
        if pair[0].family != pair[1].family
    ]
    much = [n for n in both if n.law.misses < BETTER * alone[0].law.misses]
    best = min(much, key=lambda n: n.law.misses, default=None)
    return ([best] if best is not None else []) + alone[: NAMES - (best is not None)]


def sampled(problem: Problem, found: Measurement) -> Law:
    """Inputs of the curve as they were visited, in the order of its own."""
    group = found.group
    if group.of == "twist":
        pairs = twists(problem)
        rows = pairs[evenly(len(pairs), PLACES)]
        return rows[:, 0], rows[:, 1]
    (name,) = group.inputs(problem.simulator)
    values = np.sort(visited(problem, name))
    values = values[evenly(len(values), PLACES)]
    return (values[values != 0.0] if group.dry else values,)


def _same(candidate: Candidate, found: Measurement) -> bool:
    """Whether a candidate's law has the curve's site, place and input, and acts everywhere."""
    effect, group = effect_of(candidate.family), found.group
    changes = effect.changes if isinstance(effect, VehicleEffect) else ""
    there = effect.site == group.site and candidate.place.on == group.on and changes == group.changes
    return there and effect.function_of == group.of and not candidate.only_gated and candidate.variant == ""


def _near(
    problem: Problem, found: Measurement, candidates: tuple[Candidate, ...], inputs: Law, curve: FloatArray
) -> Near:
    """The laws' parameters by least squares, from each of their starts."""
    declared = [p for c in candidates for p in c.declared]
    scale = np.array([max(p.scale, 1e-300) for p in declared])
    bounds = np.array([(p.low, p.high) for p in declared]).T / scale
    bounds[1] = np.maximum(bounds[1], bounds[0] + 1e-9)
    size = max(float(np.sqrt(np.mean(_does(found, inputs, curve) ** 2))), 1e-300)

    def missed(theta: FloatArray) -> FloatArray:
        rest = (_law(problem, found, candidates, theta * scale, inputs) - curve) / size
        return np.nan_to_num(rest, nan=LARGE, posinf=LARGE, neginf=-LARGE)

    best = None
    for start in _starts(candidates):
        at = np.clip(start / scale, *bounds)
        tried = least_squares(missed, at, bounds=bounds, max_nfev=60)
        best = tried if best is None or tried.cost < best.cost else best
    assert best is not None
    rest = best.fun**2
    terms = _terms(candidates, best.x * scale)
    names = {
        f"{c.family}.{k}": float(v)
        for c, t in zip(candidates, terms, strict=True)
        for k, v in t.values.items()
    }
    misses = float(rest.mean())
    where = None if found.group.of == "twist" else _where(inputs[0], rest)
    at_knots = _law(problem, found, candidates, best.x * scale, places(found.shape.axes))
    law = NearestLaw(
        effects=tuple(t.identity for t in terms),
        parameters=names,
        misses=misses,
        differs=where,
        values=tuple(float(f"{y:.6g}") for y in at_knots),
    )
    return Near(candidates, terms, law)


def _does(found: Measurement, inputs: Law, curve: FloatArray) -> FloatArray:
    """What the curve does beside the base simulator."""
    return curve if found.group.dry else found.shape.at(*inputs)


def _starts(candidates: tuple[Candidate, ...]) -> list[FloatArray]:
    """The first of the declared ones, and the others of a law alone."""
    several = max(len(p.starts) for c in candidates for p in c.declared) if len(candidates) == 1 else 1
    return [
        np.array([p.starts[min(i, len(p.starts) - 1)] for c in candidates for p in c.declared])
        for i in range(several)
    ]


def _terms(candidates: tuple[Candidate, ...], values: FloatArray) -> tuple[Term, ...]:
    out, at = [], 0
    for c in candidates:
        out.append(c.term([float(v) for v in values[at : at + len(c.declared)]]))
        at += len(c.declared)
    return tuple(out)


def _law(
    problem: Problem, found: Measurement, candidates: tuple[Candidate, ...], values: FloatArray, inputs: Law
) -> FloatArray:
    terms = _terms(candidates, values)
    hypothesis = Hypothesis(terms, tuple(() for _ in terms))
    group = found.group
    return of_law(
        problem, hypothesis, type(group)(group.site, group.on, group.of, tuple(range(len(terms)))), inputs
    )


def _where(x: FloatArray, rest: FloatArray) -> tuple[float, float] | None:
    """The shortest part of the input that holds half of what is missed; x ascending."""
    total = np.concatenate([[0.0], np.cumsum(rest)])
    if total[-1] <= 0.0:
        return None
    ends = np.searchsorted(total, total[:-1] + HALF * total[-1])
    widths = [(x[e - 1] - x[b], b, e) for b, e in enumerate(ends) if e < len(total)]
    _, begin, end = min(widths)
    return float(f"{x[begin]:.3g}"), float(f"{x[end - 1]:.3g}")
