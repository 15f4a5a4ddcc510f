"""The usual machine: all that machines of a kind usually have, fitted at once and taken away again.

An engineer who identifies a machine starts from the full model (inertia, viscous and dry friction, an offset, late
commands) and drops what the data do not ask for. A search that begins with nothing and adds one term at a time ends in
a poor place where several large effects act together: none of them is good alone.

1. All usual terms are fitted at once. Delays, lags and limits start from several values; all other terms start from
   nothing, in which the windows are nearly linear, or, of a robot, from what inverse dynamics says of them.
2. Backward elimination by the Wald statistic (Wald 1943): terms that cost next to nothing go together, then the
   cheapest by turns, all others fitted anew.
3. Every account on that path joins those of the beam search; evidence decides between them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from gpsim.diagnosis.fitting import (
    FREE_ROW,
    Candidate,
    Fit,
    Hypothesis,
    Order,
    Problem,
    Quadratic,
    child_of,
    expected,
    fit_all,
    fit_order,
    is_row,
    quadratic,
    scores,
)
from gpsim.diagnosis.selection.scaling import moved_inertias
from gpsim.diagnosis.settings import schedules
from gpsim.diagnosis.setup import LATE, Question, by_inverse_dynamics, is_structure, rises_of
from gpsim.effects import closed, effect_of

FREE = 0.5  # nats that terms may cost together and still go at once, without a fit between them
NEXT = 2  # of the cheapest terms that are left out by turns when each of them costs more
BEHIND = 100.0  # nats of evidence behind the best of the path, at which it ends
CHEAP = 10.0  # nats that a term may cost where every fit is dear, and still go with others without a fit between them
MISJUDGED = (
    5.0  # nats by which a fit may be worse than the quadratic model says before fewer terms are left out
)


def usual_machine(question: Question, offers: Sequence[Candidate]) -> list[Fit]:
    """Fits of the full model and of its best parts, the largest first; none where no usual term is on offer."""
    question = replace(question, searched=replace(question.searched, dry_steps={}))
    problem = question.searched  # where friction stops a body matters when accounts are compared to the end
    usual = [c for c in offers if is_usual(problem, c)]
    if not usual:
        return []
    full = _sized(question, usual, offers) or _full_model(problem, usual)
    path = taken_away(problem, full)
    for found in path:
        problem.run.trace.note(found.hypothesis.names, (), True, "usual machine")
    return path


def taken_away(problem: Problem, full: Fit) -> list[Fit]:
    """The full model and its parts; where it has a gain and the inertia that it moves, also those without the latter.

    All that moves together may scale. By turns the less usual gain would go, and what it does for several inertias,
    each of them would have to do.
    """
    path, moved = _with_less(problem, full), moved_inertias(problem.simulator, full.hypothesis)
    if moved and not _dear(problem):
        less = quadratic(problem, full).without(moved)
        order = Order(less, full.starts, schedules.TRIAL, schedules.ROUGH, near=True)
        path += _with_less(problem, fit_order(problem, order))
    return path


def _with_less(problem: Problem, full: Fit) -> list[Fit]:
    """The full model, and what is left of it as terms are taken away."""
    path = [full]
    while len(path[-1].hypothesis.terms) > 1 and _near_the_best(problem, path):
        if _dear(problem) and quadratic(problem, path[-1]).costs().min() > CHEAP:
            break  # what may be left out besides is asked where accounts are compared
        path.append(_fewer_terms(problem, path[-1]))
    return path


def _nothing(candidate: Candidate) -> tuple[float, ...]:
    """The values at which a term does nothing."""
    return tuple(p.none for p in candidate.declared)


def _near_the_best(problem: Problem, path: list[Fit]) -> bool:
    """Whether the last account may still lead to a better one: it is not far behind the best so far."""
    nats = scores(problem, path)
    return bool(nats.max() - nats[-1] < BEHIND)


def is_usual(problem: Problem, candidate: Candidate) -> bool:
    """Whether the full model has it; where every term costs a simulation of a whole robot, what acts at its joints."""
    effect = effect_of(candidate.family)
    if not effect.usual or candidate.variant:
        return False
    return not _dear(problem) or is_row(effect)


def _is_late(problem: Problem, candidate: Candidate) -> bool:
    """Whether it is a delay of a command of a robot."""
    return _dear(problem) and candidate.family == LATE


def _sized(question: Question, usual: Sequence[Candidate], offers: Sequence[Candidate]) -> Fit | None:
    """The fit of all that inverse dynamics say of a robot at once; None where they say nothing."""
    problem = question.searched
    others, late = [c for c in offers if is_structure(c)], [c for c in offers if _is_late(problem, c)]
    rises = rises_of(problem.simulator, offers)
    begun = by_inverse_dynamics(problem, question.recording, _begun(usual, {}), others, late, rises)
    if begun is None:
        return None
    starts = problem.windows.measured[:, 0]
    return fit_order(problem, Order(begun, starts, schedules.REFIT, schedules.ROUGH, near=True))


def _full_model(problem: Problem, usual: Sequence[Candidate]) -> Fit:
    """The best fit of all terms at once: from the usual starts, each start varied alone, and the best ones together."""
    starts = problem.windows.measured[:, 0]
    scanned = [i for i, c in enumerate(usual) if len(c.declared) == 1 and len(c.declared[0].starts) > 1]
    first = dict.fromkeys(scanned, 0)
    tried = [first]
    tried += [first | {i: k} for i in scanned for k in range(1, len(usual[i].declared[0].starts))]

    def ordered(which: dict[int, int]) -> Order:
        return Order(_begun(usual, which), starts, schedules.GLANCE, schedules.ROUGH)

    fits = fit_all(problem, [ordered(which) for which in tried])
    best = dict(first)
    for i in scanned:
        alike = [
            (f.objective, which[i]) for f, which in zip(fits, tried, strict=True) if which | {i: 0} == first
        ]
        best[i] = min(alike)[1]
    fits += fit_all(problem, [ordered(best)] if best not in tried else [])
    fits.sort(key=lambda f: f.objective)
    more = [Order(f.hypothesis, f.starts, schedules.REFIT, schedules.ROUGH, near=True) for f in fits[:NEXT]]
    return min(fit_all(problem, more), key=lambda f: f.objective)


def _begun(usual: Sequence[Candidate], which: dict[int, int]) -> Hypothesis:
    """All terms: those scanned at one of their starting values, all others at nothing."""
    out = Hypothesis()
    for i, c in enumerate(usual):
        start = (c.declared[0].starts[which[i]],) if i in which else _nothing(c)
        out = child_of(out, c, start)
    return out


def _dear(problem: Problem) -> bool:
    """Whether every fit costs simulations of a whole robot."""
    return closed(problem.simulator) is not None


def _spare(problem: Problem, around: Quadratic, gone: Sequence[int], index: int) -> bool:
    """Whether a term may go together with those that are gone, without a fit between them."""
    cost = around.cost([*gone, index])
    if _dear(problem):
        alike = index in expected(problem, around.fit.hypothesis)
        return cost - (around.cost(gone) if gone else 0.0) < (FREE_ROW if alike else CHEAP)
    return cost < FREE


def _fewer_terms(problem: Problem, found: Fit) -> Fit:
    """The best account with less: all terms that cost nothing together, or else one of the cheapest."""
    around = quadratic(problem, found)
    ranks = [effect_of(t.family).usual for t in found.hypothesis.terms]
    nothing = 0.0 if _dear(problem) else FREE  # what costs no more costs nothing

    def cheapest(gone: list[int]) -> list[int]:
        left = [i for i in range(len(ranks)) if i not in gone]
        costs = {i: around.cost([*gone, i]) for i in left}
        return sorted(left, key=lambda i: (round(costs[i], 1) if costs[i] > nothing else 0.0, ranks[i]))

    def order(gone: Sequence[int]) -> Order:
        return Order(around.without(gone), found.starts, schedules.TRIAL, schedules.ROUGH, near=True)

    gone: list[int] = []
    while len(gone) < len(ranks) - 1 and _spare(problem, around, gone, (i := cheapest(gone)[0])):
        gone.append(i)
    if gone:
        less = fit_order(problem, order(gone))
        foreseen = around.cost(gone) if _dear(problem) else FREE
        if len(gone) == 1 or less.objective < found.objective + foreseen + MISJUDGED:
            return less
    return min(fit_all(problem, [order([i]) for i in cheapest([])[:NEXT]]), key=lambda f: f.objective)
