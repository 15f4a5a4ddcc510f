"""Improving a hypothesis on all training windows: one more term, another one in the place of each, finer edges.

The search looks at few windows and follows the best single term; what it overlooks is either weak, and shows with
more data, or was taken by a term that is not quite right, and shows when that one is taken out again.
"""

from __future__ import annotations

from collections.abc import Sequence

from gpsim.diagnosis.evidence import scores, whiteness
from gpsim.diagnosis.gates import gated_children, polished
from gpsim.diagnosis.hypothesis import Candidate
from gpsim.diagnosis.problem import Problem
from gpsim.diagnosis.screening import Directions, child_of, screened
from gpsim.diagnosis.search import STRUCTURED, grown, pays
from gpsim.diagnosis.shooting import Fit, fit
from gpsim.diagnosis.workers import Order, fit_all

MOST_TERMS, ADDED, SWAPPED = 4, 3, 3  # terms of a hypothesis; candidates fitted to add, and to replace one
LEAST_SWAP = 0.5  # of the linear gain of the best in a term's place that another must promise


def improved(problem: Problem, leader: Fit, offers: Sequence[Candidate]) -> tuple[Fit, list[Fit]]:
    """The leader with terms added and replaced while that pays, and every fit that was tried on the way."""
    tried: list[Fit] = []
    while len(leader.hypothesis.terms) < MOST_TERMS:
        children = _children(problem, leader, offers)
        tried += children
        better = [child for child in children if pays(problem, child, leader)]
        if not better:
            break
        leader = _best(problem, better)
    for _ in range(2):
        others = [
            f for i in range(len(leader.hypothesis.terms)) for f in _swapped(problem, leader, i, offers)
        ]
        tried += others
        best = _best(problem, [leader, *others])
        if best is leader:
            break
        leader = best
    return polished(problem, leader), tried


def _best(problem: Problem, fits: Sequence[Fit]) -> Fit:
    nats = scores(problem, list(fits))
    return fits[int(nats.argmax())]


def _children(problem: Problem, leader: Fit, offers: Sequence[Candidate]) -> list[Fit]:
    directions = Directions(problem, leader)
    plain = grown(problem, directions, offers, ADDED)
    gated = any(term.gate for term in leader.hypothesis.terms)
    if not gated and whiteness(problem, leader)[0] < STRUCTURED:
        plain += gated_children(problem, directions, plain, offers)
    return plain


def _swapped(problem: Problem, leader: Fit, index: int, offers: Sequence[Candidate]) -> list[Fit]:
    """The leader with one term replaced by others that promise about as much, behind its gate where it has one."""
    old = leader.hypothesis.terms[index]
    parent = fit(problem, leader.hypothesis.without(index), leader.starts, iterations=8, tolerance=0.5)
    open_offers = [c for c in offers if (c.gateable or not old.gate) and not c.only_gated]
    found = screened(Directions(problem, parent), open_offers)
    others = [
        (candidate, start)
        for worth, candidate, start in found
        if worth > max(1.0, LEAST_SWAP * found[0][0])
        and candidate.identity != old.identity
        and candidate.identity not in parent.hypothesis.claims
    ]
    last = len(parent.hypothesis.terms)
    children = [child_of(parent.hypothesis, c, start).gated(last, old.gate) for c, start in others[:SWAPPED]]
    return fit_all(problem, [Order(child, leader.starts, 12) for child in children])
