"""What differs between several recordings of one machine: values that are one recording's own.

Asked when what all recordings share has been searched to its end. Two kinds of question are screened by the same score
test as any term: one effect of the account in one recording (more friction on Friday), and one more effect there alone
(a sensor's offset, a payload). What pays by the one rule of acceptance is taken, unless held-out windows contradict it.
Then what the recordings share is searched on: an offset of one day may have been told as friction.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from gpsim.channels import FloatArray
from gpsim.diagnosis.fitting import (
    Candidate,
    Directions,
    Fit,
    Hypothesis,
    Order,
    Problem,
    child_of,
    fit_all,
    fit_near,
    fit_order,
    gain,
    scores,
    screened,
    starts_of,
)
from gpsim.diagnosis.selection.acceptance import on_its_grid, pays
from gpsim.diagnosis.selection.elimination import for_screening, likeliest, on_some_windows
from gpsim.diagnosis.selection.held_out import held_out_objective
from gpsim.diagnosis.selection.refit import CONTRADICTING_LOSS, Contenders
from gpsim.diagnosis.selection.stepwise import LEAST_ADVANCE, LEAST_GAIN_OF_A_TERM, SIMPLIFIED, stepwise
from gpsim.diagnosis.selection.substitution import AS_WELL, SUBSTITUTES_FITTED, left_open
from gpsim.diagnosis.settings import schedules
from gpsim.diagnosis.setup import Question
from gpsim.effects import Gate, base_name, owner_of

DIFFERENCE_ROUNDS = 2  # times that what they share is searched again with them
DIFFERENCES_FITTED = 9  # of those screened, that are fitted, the most promising first
MOVED_TO_SCREEN = 0.2
"""Of what a shared effect does, by which its values are moved in one recording, to screen it."""

Promise = tuple[float, Hypothesis]
"""Nats that a hypothesis promises over the leader, and the hypothesis."""


def told_apart(question: Question, contenders: Contenders, offers: Sequence[Candidate]) -> Contenders:
    """The leader with what is a recording's own, and all that was tried; as it was where there is one recording."""
    count = len(question.recording.sources)
    if count < 2:
        return contenders
    leader, tried = _with_differences(question, contenders.leader, offers, count)
    return replace(contenders, leader=leader, tried=[*contenders.tried, *tried])


def told_apart_to_the_end(
    question: Question, contenders: Contenders, offers: Sequence[Candidate], tell: Callable[[str], None]
) -> Contenders:
    """The same, and what recordings share searched on with that, until nothing changes."""
    rounds = DIFFERENCE_ROUNDS if len(question.recording.sources) > 1 else 0
    for _ in range(rounds):
        tell("what differs between the recordings?")
        found = told_apart(question, contenders, offers)
        if found.leader is contenders.leader:
            break
        contenders = stepwise(question, found, offers, tell)
    return contenders


def _with_differences(
    question: Question, leader: Fit, offers: Sequence[Candidate], count: int
) -> tuple[Fit, list[Fit]]:
    """The leader with values of recordings' own as long as these pay, and all that was tried."""
    problem = question.everything
    settings, tried = problem.run.settings.differences, [leader]
    most = problem.run.budget.spent + settings.budget
    best = _as_own(problem, leader, count)
    for _ in range(settings.most):
        if problem.run.budget.spent > most:
            break
        children = _children(problem, best, offers, count)
        better = [child for child in children if _stands(question, child, best)]
        tried += children
        if not better:
            break
        found = likeliest(problem, better)
        order = Order(found.hypothesis, found.starts, schedules.FINISH, schedules.FINAL, near=True)
        best = _alike_again(problem, fit_order(problem, order))
        best = _exchanged(problem, best, offers)
    return best, tried[1:]


def _stands(question: Question, child: Fit, leader: Fit) -> bool:
    """Whether it pays, and held-out windows do not contradict it; a few of them may say nothing of it."""
    problem, held_out = question.everything, question.held_out
    if not pays(problem, child, leader):
        return False
    if not len(held_out.windows):
        return True
    before, after = (held_out_objective(held_out, f.hypothesis) for f in (leader, child))
    won = gain(problem, child, on_its_grid(problem, leader, child))
    if after - before < CONTRADICTING_LOSS * won:
        return True
    names = child.hypothesis.names, leader.hypothesis.names
    problem.run.trace.note(*names, False, "held-out windows contradict", gain=before - after)
    return False


def _children(problem: Problem, leader: Fit, offers: Sequence[Candidate], count: int) -> list[Fit]:
    """The leader with a value of one recording's own more, of those that promise most, fitted."""
    part, seen = on_some_windows(problem, leader, for_screening(problem))
    directions = Directions(part, seen)
    promises = [*_of_the_account(directions, count), *_of_one_recording(directions, offers, count)]
    more, least = len(problem.windows) / len(part.windows), LEAST_GAIN_OF_A_TERM
    promises = sorted((p for p in promises if more * p[0] > least), key=lambda p: -p[0])
    chosen = [hypothesis for _, hypothesis in promises[:DIFFERENCES_FITTED]]
    orders = [Order(hypothesis, leader.starts, schedules.GLANCE, schedules.ROUGH) for hypothesis in chosen]
    return fit_near(problem, orders, schedules.SETTLE, schedules.ROUGH)


def _of_the_account(directions: Directions, count: int) -> list[Promise]:
    """Each term of the account with its values in one recording, where others go on sharing theirs."""
    leader = directions.parent.hypothesis
    out: list[Promise] = []
    for index, (term, declared) in enumerate(zip(leader.terms, leader.declared, strict=True)):
        shared = any(owner_of(p.name) is None for p in declared)
        free = [k for k in range(count) if k not in term.owners]
        if shared and len(free) < 2:
            continue  # what nobody shares would be left
        if shared and count == 2:
            free = free[1:]  # of two, one's own is the other's
        alone = not shared and len(free) == 1  # what nobody else has as its own is shared
        for owner in [None] if alone else free:
            child = _where_it_is_not(leader, index) if owner is None else leader.with_own(index, owner)
            thetas = _moved(child, index, owner)
            out.append((float(directions.gains(child, thetas).max()), child.having(thetas[0])))
    return out


def _where_it_is_not(leader: Hypothesis, index: int) -> Hypothesis:
    """One term, which some recordings have as their own, in all others, too; it begins with doing nothing there."""
    declared = {base_name(p.name): p.none for p in leader.declared[index]}
    return leader.with_shared(index, list(declared.values()))


def _moved(child: Hypothesis, index: int, owner: int | None) -> FloatArray:
    """(C, P) the child's values, one of those that are new moved by a part of what it does in each."""
    share, out = MOVED_TO_SCREEN, []
    before = sum(len(group) for group in child.declared[:index])
    for place, p in enumerate(child.declared[index]):
        if owner_of(p.name) != owner:
            continue
        theta = child.theta
        step = share * max(abs(theta[before + place] - p.none), p.step or p.scale)
        theta[before + place] += step if theta[before + place] + step <= p.high else -step
        out.append(theta)
    return np.array(out)


def _of_one_recording(directions: Directions, offers: Sequence[Candidate], count: int) -> list[Promise]:
    """One more term each, that acts in one recording alone."""
    leader = directions.parent.hypothesis
    asked = _asked(offers, leader)
    return [
        (nats, child_of(leader, candidate, start, recording))
        for recording in range(count)
        for nats, candidate, start in screened(directions, asked, owner=recording)
    ]


def _as_own(problem: Problem, leader: Fit, count: int) -> Fit:
    """The leader, in which what acts since the last recording, or about since then, is that recording's own."""
    for index, term in enumerate(leader.hypothesis.terms):
        since = term.gate.since_episode
        if since is None or term.gate != Gate(since_episode=since) or not _may_do_nothing(leader, index):
            continue
        acts = problem.windows.episode >= since
        own_rows = [problem.windows.sources == k for k in range(count)]
        whole = [k for k, rows in enumerate(own_rows) if rows.any() and acts[rows].all()]
        if whole != [count - 1]:
            continue
        own = leader.hypothesis.gated(index, Gate()).with_own(index, count - 1).without_shared(index)
        order = Order(own, leader.starts, schedules.REFIT, schedules.CLOSE, near=True)
        leader = likeliest(problem, [leader, fit_order(problem, order)])
    return leader


def _may_do_nothing(leader: Fit, index: int) -> bool:
    """Whether all recordings share a term's values, and there are some at which it does nothing."""
    term, declared = leader.hypothesis.terms[index], leader.hypothesis.declared[index]
    return not term.owners and not any(p.falls for p in declared)


def _alike_again(problem: Problem, leader: Fit) -> Fit:
    """The leader without values of a recording's own that no longer pay: another one has taken their place."""
    while True:
        parts = [part for i in range(len(leader.hypothesis.terms)) for part in _less(leader.hypothesis, i)]
        fits = fit_all(
            problem, [Order(part, leader.starts, schedules.REFIT, schedules.CLOSE) for part in parts]
        )
        spare = [f for f in fits if not pays(problem, leader, f)]
        if not spare:
            return leader
        leader = min(spare, key=lambda f: f.objective)


def _less(hypothesis: Hypothesis, index: int) -> list[Hypothesis]:
    """One term with less that is a recording's own, or nothing but that; without the term where nothing is left."""
    declared = hypothesis.declared[index]
    parts = [hypothesis.without_own(index, recording) for recording in hypothesis.terms[index].owners]
    shared = [p for p in declared if owner_of(p.name) is None]
    if shared and parts and not any(p.falls for p in shared):
        parts.append(hypothesis.without_shared(index))
    return [part if part.declared[index] else hypothesis.without(index) for part in parts]


def _exchanged(problem: Problem, leader: Fit, offers: Sequence[Candidate]) -> Fit:
    """The leader with another effect in the place of one that a recording has alone, where that says as much with less.

    A gain and a damping of one day may be its mass; what two laws say of one place in two recordings may be one law.
    """
    children = [h for i in range(len(leader.hypothesis.terms)) for h in _instead(problem, leader, i, offers)]
    orders = [Order(child, leader.starts, schedules.GLANCE, schedules.ROUGH) for child in children]
    fits = fit_near(problem, orders, schedules.SETTLE, schedules.ROUGH)
    near = sorted((f for f in fits if f.objective < leader.objective + AS_WELL), key=_objective)
    leaned = [_alike_again(problem, f) for f in near[:SIMPLIFIED]]
    best = likeliest(problem, [leader, *leaned])
    nats = scores(problem, [best, leader])
    return best if nats[0] > nats[1] + LEAST_ADVANCE else leader


def _objective(fit: Fit) -> float:
    return fit.objective


def _instead(problem: Problem, leader: Fit, index: int, offers: Sequence[Candidate]) -> list[Hypothesis]:
    """What may stand in the place of one term, if one recording has it alone."""
    hypothesis = leader.hypothesis
    term, declared = hypothesis.terms[index], hypothesis.declared[index]
    if len(term.owners) != 1 or any(owner_of(p.name) is None for p in declared):
        return []
    (owner,) = term.owners
    part, seen = on_some_windows(problem, leader, for_screening(problem))
    directions = Directions(part, left_open(part, seen, index))
    asked = [c for c in _asked(offers, hypothesis) if c.identity != term.identity]
    found = screened(directions, asked, owner=owner)[:SUBSTITUTES_FITTED]
    rest = hypothesis.without(index)
    same = [c for c in offers if (c.identity, c.variant) == (term.identity, term.variant)]
    return [child_of(rest, c, start, owner) for _, c, start in found] + [
        _law_of_all(hypothesis, index, other, start)
        for other, beside in enumerate(hypothesis.terms)
        if other != index and beside.on == term.on and not beside.owners
        for start in (starts_of(same[0]) if same else ())
    ]


def _law_of_all(hypothesis: Hypothesis, index: int, other: int, start: Sequence[float]) -> Hypothesis:
    """One recording's effect as one of all, with values of its own there, in the place of another effect."""
    return hypothesis.with_shared(index, start).without(other)


def _asked(offers: Sequence[Candidate], leader: Hypothesis) -> list[Candidate]:
    """What one recording may have alone: no effect of the account, and one that may do nothing in all others."""
    return [
        c
        for c in offers
        if c.identity not in leader.claims and not c.only_gated and not any(p.falls for p in c.declared)
    ]
