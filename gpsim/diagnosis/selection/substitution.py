"""Replacing one term of a hypothesis: by another law that explains as much, a special case, or what may have jumped."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from gpsim.diagnosis.fitting import (
    Candidate,
    Directions,
    Fit,
    Hypothesis,
    Order,
    Problem,
    child_of,
    fit,
    fit_all,
    rescored,
    screened,
    stretched,
)
from gpsim.diagnosis.selection.acceptance import pays
from gpsim.diagnosis.selection.beam import LEAST_LINEAR_GAIN, most_promising
from gpsim.diagnosis.selection.elimination import (
    CLEAR_LOSS,
    FINE_SPACING,
    for_screening,
    on_some_windows,
    whole_robot,
)
from gpsim.diagnosis.selection.gate_edges import placed
from gpsim.diagnosis.selection.gates import NEAR_REACH, gated_children, makes_sense, moments, with_edges
from gpsim.diagnosis.settings import schedules
from gpsim.effects import Gate, Term

SUBSTITUTES_FITTED = 3  # terms that are fitted in the place of one, beside its special cases
LEAST_SHARE_OF_BEST = 0.5
"""Share of the linear gain of the best in a term's place that another must promise."""
TWIN_SHARE = 0.9  # share of it that one must promise which can hardly be told from the best
AS_WELL = 5.0  # loss against the leader within which a hypothesis does as well [nats]
JUMPS = 3  # terms that are fitted as what jumped, in the place of a drift or of a slight term
SLIGHT_GAIN = 200.0  # gain of a term so slight that it may stand for one that began late [nats]


def substitutes(
    problem: Problem, leader: Fit, index: int, offers: Sequence[Candidate], twins: bool = False
) -> list[Fit]:
    """The leader with one term replaced by others that promise about as much, behind its gate where it has one.

    twins: only by those that promise nearly as much as the one that promises most.
    """
    old = leader.hypothesis.terms[index]
    part, seen = on_some_windows(problem, leader, for_screening(problem))
    parent = left_open(part, seen, index)
    open_offers = [c for c in offers if _fits_gate(c, old.gate)]
    directions = Directions(part, parent)
    found = screened(directions, open_offers, old.gate)
    share = TWIN_SHARE if twins else LEAST_SHARE_OF_BEST
    promising = [
        (candidate, start)
        for worth, candidate, start in found
        if worth > max(LEAST_LINEAR_GAIN, share * found[0][0]) and candidate.identity != old.identity
    ]
    special = _special_cases(old, open_offers) + _other_words(directions, old, offers)
    names = {candidate.identity for candidate, _ in special}
    others = [(c, start) for c, start in promising if c.identity not in names]
    most_others = 1 if whole_robot(problem, leader.hypothesis) else SUBSTITUTES_FITTED
    children = [
        child
        for candidate, start in [*special, *others[:most_others]]
        if (child := _in_place(parent.hypothesis, candidate, start, old.gate))
    ]
    most = rescored(part, seen).objective + CLEAR_LOSS
    looks = fit_all(part, [Order(child, seen.starts, schedules.REFIT, schedules.ROUGH) for child in children])
    near = [f for f in looks if f.objective < most or f.hypothesis.terms[-1].identity in names]
    orders = [Order(f.hypothesis, leader.starts, schedules.REFIT, schedules.ROUGH) for f in near]
    fits = fit_all(problem, orders)
    if not old.gate and not twins:
        if old.effect.drifts:
            return fits + _jumps(problem, part, parent, old.on, offers)
        lost = rescored(part, parent).objective - rescored(part, seen).objective
        slight = lost * len(problem.windows) / len(part.windows) < SLIGHT_GAIN
        return fits + (_later(problem, part, directions, open_offers) if slight else [])
    if not old.gate:
        return fits
    worth_it = leader.objective + 2 * AS_WELL  # its own edges may make the difference
    near = [f for f in fits if f.objective < worth_it]
    how = (NEAR_REACH, FINE_SPACING)
    sharper = problem.run.side_by_side(
        placed, [(problem, f, len(f.hypothesis.terms) - 1, *how) for f in near]
    )
    return [*sharper, *(f for f in fits if f.objective >= worth_it)]


def _other_words(
    directions: Directions, old: Term, offers: Sequence[Candidate]
) -> list[tuple[Candidate, tuple[float, ...]]]:
    """The same law in its other variants (a coefficient for a force), or one of its special cases in them.

    Few windows may have preferred the wrong one.
    """
    families = {old.family, *old.effect.special_cases(old.values)}
    same = [
        c
        for c in offers
        if c.family in families and c.place.on == old.on and c.variant not in ("", old.variant)
    ]
    if old.variant:
        same += [c for c in offers if c.identity == old.identity and c.variant == ""]
    found = screened(directions, same, old.gate)
    return [(c, stretched(directions, c, start, old.gate)) for _, c, start in found]


def specialised(problem: Problem, leader: Fit, offers: Sequence[Candidate]) -> Fit:
    """The leader with special cases of its laws, where the laws do not pay over them."""
    while True:
        children = plain_forms(leader.hypothesis, offers)
        orders = [Order(child, leader.starts, schedules.REFIT, schedules.ROUGH) for child in children]
        fits = fit_all(problem, orders)
        simpler = [f for f in fits if not pays(problem, leader, f)]
        if not simpler:
            return leader
        leader = min(simpler, key=lambda f: f.objective)


def plain_forms(hypothesis: Hypothesis, offers: Sequence[Candidate]) -> list[Hypothesis]:
    """The hypothesis with one of its laws in the form of a special case with fewer parameters."""
    out = []
    for i, old in enumerate(hypothesis.terms):
        rest = hypothesis.without(i)
        for candidate, start in _special_cases(old, [c for c in offers if _fits_gate(c, old.gate)]):
            child = _in_place(rest, candidate, start, old.gate)
            if child is not None and len(child.parameters) < len(hypothesis.parameters):
                out.append(child)
    return out


def left_open(problem: Problem, at: Fit, index: int) -> Fit:
    """The fit with one term taken out and all else left as it is: what is missing then is that term, undistorted."""
    hypothesis = at.hypothesis.without(index)
    bare = fit(problem, hypothesis.frozen(), at.starts, iterations=0)
    return replace(bare, hypothesis=hypothesis)


def _special_cases(old: Term, offers: Sequence[Candidate]) -> list[tuple[Candidate, tuple[float, ...]]]:
    """Simpler laws that the old one holds, from where it stands; a screening from afar may miss them."""
    values = old.effect.special_cases(old.values)
    return [
        (c, values[c.family])
        for c in offers
        if c.family in values and c.place.on == old.on and len(c.declared) == len(values[c.family])
        if c.variant == ""
    ]


def _in_place(
    parent: Hypothesis, candidate: Candidate, start: Sequence[float], gate: Gate
) -> Hypothesis | None:
    """The parent with a term behind a gate; one that claimed the same everywhere makes room for it."""
    same = [i for i, term in enumerate(parent.terms) if term.identity == candidate.identity]
    if same and not gate:
        return None
    for i in same:
        parent = parent.without(i)
    return child_of(parent, candidate, start).gated(len(parent.terms), gate)


def _jumps(problem: Problem, part: Problem, parent: Fit, on: str, offers: Sequence[Candidate]) -> list[Fit]:
    """In place of a drift: what changed at one moment."""
    there = [c for c in offers if c.place.on == on and c.identity not in parent.hypothesis.claims]
    directions = Directions(part, parent)
    everywhere = most_promising(part, directions, there, JUMPS)
    found = with_edges(part, gated_children(part, directions, everywhere, there, moments(part)))
    return _from_measured(problem, found)


def _later(problem: Problem, part: Problem, directions: Directions, offers: Sequence[Candidate]) -> list[Fit]:
    """In place of a slight term: what began at one moment."""
    found = with_edges(part, gated_children(part, directions, [], offers, moments(part), few=directions))
    found = found[:JUMPS]
    return _from_measured(problem, found)


def _from_measured(problem: Problem, found: Sequence[Fit]) -> list[Fit]:
    """All fitted anew to these windows, from the start states that were measured there."""
    starts = problem.windows.measured[:, 0]
    return fit_all(problem, [Order(f.hypothesis, starts, schedules.REFIT, schedules.ROUGH) for f in found])


def _fits_gate(candidate: Candidate, gate: Gate) -> bool:
    if not gate:
        return not candidate.only_gated
    return candidate.gateable and makes_sense(candidate, gate.looks_at)
