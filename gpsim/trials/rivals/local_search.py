"""Other explanations in the neighbourhood of a fit: the way to an equal one is short from there.

Fitted from what was measured, rivals of a swinging or sticking body get stuck: where a motion is unstable, the best
that can be said without one of its effects is far from all that explain it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from gpsim.channels import FloatArray
from gpsim.diagnosis.fitting import (
    Candidate,
    Directions,
    Fit,
    Hypothesis,
    Problem,
    fit,
    screened,
    starts_of,
    stretched,
)
from gpsim.diagnosis.selection import left_open

PROMISING = 0.3  # share of what is missing that a replacement must explain by the linear estimate
FITTED = 4  # replacements of a term
SMALL = 0.01  # of an effect: a change that acts linearly even where motions diverge
SAME = 0.9  # share of such a change that the other effect must undo to be continued
STEPS = 8  # in which an effect is taken away and the other one put in its place


def replaced_near(problem: Problem, offers: Sequence[Candidate], at: Fit) -> list[Fit]:
    """One term after another replaced, from where the fit stands: its start states and all its other terms."""
    out = []
    for i, term in enumerate(at.hypothesis.terms):
        parent = left_open(problem, at, i)
        directions = Directions(problem, parent)
        open_offers = [c for c in _others(at, offers) if c.gateable or not term.gate]
        needed = PROMISING * 0.5 * float((directions.rest**2).sum())
        for worth, candidate, start in screened(directions, open_offers, term.gate)[:FITTED]:
            if worth > needed:
                values = stretched(directions, candidate, start, term.gate)
                gated = replace(candidate.term(values), gate=term.gate)
                out.append(_fit(problem, parent.hypothesis.plus(gated, candidate.declared), at.starts))
    return out


def continued(problem: Problem, offers: Sequence[Candidate], at: Fit) -> list[Fit]:
    """One term after another taken away step by step, while another one that does the same takes over (continuation).

    For effects of one parameter, which small changes tell to be the same.
    """
    out = []
    for i, term in enumerate(at.hypothesis.terms):
        if term.gate or len(at.hypothesis.declared[i]) != 1:
            continue
        directions = Directions(problem, _weakened(problem, at, i, 1.0 - SMALL))
        whole = 0.5 * float((directions.rest**2).sum())
        for candidate in _others(at, offers):
            if len(candidate.declared) == 1 and _undoes(directions, candidate) > SAME * whole:
                out.append(_walked(problem, at, i, candidate))
    return out


def _others(at: Fit, offers: Sequence[Candidate]) -> list[Candidate]:
    """What may take a term's place."""
    return [c for c in offers if c.identity not in at.hypothesis.claims and not c.only_gated]


def _undoes(directions: Directions, candidate: Candidate) -> float:
    """Nats that a little of another effect makes good."""
    p = candidate.declared[0]
    little = [p.none + SMALL * (start[0] - p.none) for start in starts_of(candidate)]
    parent = directions.parent.hypothesis
    child = parent.plus(candidate.term([little[0]]), candidate.declared)
    thetas = np.array([[*parent.theta, value] for value in little])
    return float(directions.gains(child, thetas).max())


def _weakened(problem: Problem, at: Fit, index: int, share: float) -> Fit:
    """The fit with a share of one term only, which is no longer fitted; all else stays."""
    hypothesis = _with_share(at.hypothesis, at.hypothesis, index, share)
    bare = fit(problem, hypothesis.frozen(), at.starts, iterations=0)
    return replace(bare, hypothesis=hypothesis)


def _with_share(hypothesis: Hypothesis, truth: Hypothesis, index: int, share: float) -> Hypothesis:
    """The hypothesis with term `index` at a share of what it is in the truth, and held there."""
    (p,) = truth.declared[index]
    value = p.none + share * (truth.terms[index].values[p.name] - p.none)
    terms, declared = list(hypothesis.terms), list(hypothesis.declared)
    terms[index] = replace(terms[index], values={**terms[index].values, p.name: value})
    declared[index] = ()
    return replace(hypothesis, terms=tuple(terms), declared=tuple(declared))


def _walked(problem: Problem, at: Fit, index: int, candidate: Candidate) -> Fit:
    none = [p.none for p in candidate.declared]
    found = replace(at, hypothesis=at.hypothesis.plus(candidate.term(none), candidate.declared))
    for step in range(1, STEPS + 1):
        held = _with_share(found.hypothesis, at.hypothesis, index, 1.0 - step / STEPS)
        found = _fit(problem, held, found.starts)
    return _fit(problem, found.hypothesis.without(index), found.starts)


def _fit(problem: Problem, hypothesis: Hypothesis, starts: FloatArray) -> Fit:
    return fit(problem, hypothesis, starts, iterations=14, tolerance=0.05)
