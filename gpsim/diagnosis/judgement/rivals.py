"""Rivals: other explanations that a recording cannot tell from the leading one, and how probable each is."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from gpsim.channels import FloatArray
from gpsim.diagnosis.fitting import (
    Fit,
    Order,
    Problem,
    channel_objectives,
    correlation_time,
    fit_all,
    quadratic,
    scores,
)
from gpsim.diagnosis.selection import held_out_fit, pays, whole_robot
from gpsim.diagnosis.settings import schedules
from gpsim.diagnosis.setup import Question

NEARLY_AS_GOOD = 15.0
"""Behind, up to which one is fitted behind the leader's gates: its own were placed less closely [nats]."""
MENDING = 5.0  # ahead, from which a richer fit that does not pay mends the leader's last digits [nats]
FAR_AHEAD = 100.0
"""By which a rival may be ahead on training windows, if held-out ones chose the leader [nats] (a probability is a
number still)."""

ALIKE = 0.02  # of a probability: what differs by less is as likely, and either may lead


class Rivalry(NamedTuple):
    """Rivals, and what else was asked of.

    rivals: other explanations that these data cannot rule out; probabilities: of the leader, then of each of them, what
    is left belongs to explanations that are further behind; idle: fits that are no rivals, though they are ahead or
    near: they merely mend the leader's last digits, a term of theirs does not pay, or they are a rival with something
    added; behind: of the others that are
    near, how many nats they are behind once held-out windows count, too.
    """

    rivals: list[Fit]
    probabilities: list[float]
    idle: list[Fit]
    behind: list[tuple[Fit, float]]


def rivals_of(question: Question, leader: Fit, fits: Sequence[Fit]) -> Rivalry:
    """Other explanations that these data cannot tell from the leader.

    Training and held-out windows count together: all that was recorded has to fail to tell them from the leader.
    """
    others = _others(leader, fits)
    mending = _mending(question.everything, leader, others)
    others = [f for f in others if not any(f is m for m in mending)]
    if not others:
        return Rivalry([], [1.0], mending, [])
    nats = scores(question.everything, [leader, *others])
    later = _later_nats(question, leader)
    rivals: list[Fit] = []
    counted: list[Fit] = []
    idle, weighed = list(mending), []
    run = question.everything.run
    settings = run.settings.rivals
    weights, of_rivals, until = [1.0], [], run.budget.spent + settings.budget
    for i in np.argsort(-nats[1:]):
        rival, by = others[int(i)], float(nats[0] - nats[1 + int(i)])
        near, said = by < settings.tie, False
        if near and not _fresh(rival, rivals):
            idle.append(rival)
            continue
        if near and len(rivals) < settings.most and run.budget.spent < until:
            if not _earned(question.everything, leader, rival):
                idle.append(rival)
                continue
            worse = later(rival)
            said = worse < settings.tie and by + worse < settings.tie
            by = (
                by + worse if worse < settings.tie else max(by + worse, worse)
            )  # held-out windows rule it out
        elif near:  # nobody asked held-out windows: it is not known to be ahead
            by = max(by, 0.0)
        if near:
            weighed.append((rival, by))
        weight = float(np.exp(-max(by, -FAR_AHEAD)))
        if said:
            rivals.append(rival)
            of_rivals.append(weight)
        if said or _fresh(rival, counted):  # what is reported is part of the whole
            counted.append(rival)
            weights.append(weight)
    return Rivalry(rivals, [weight / sum(weights) for weight in (1.0, *of_rivals)], idle, weighed)


def behind_its_gates(problem: Problem, leader: Fit, fits: Sequence[Fit]) -> list[Fit]:
    """Rivals that are a little behind, once more behind the leader's gates: their edges were placed less closely."""
    others = _others(leader, fits)
    gates = {t.gate.looks_at: t.gate for t in leader.hypothesis.terms if t.gate}
    if not gates or not others:
        return []
    settings = problem.run.settings.rivals
    nats = scores(problem, [leader, *others])
    orders = []
    for rival, behind in zip(others, nats[0] - nats[1:], strict=True):
        terms = [
            replace(t, gate=gates.get(t.gate.looks_at, t.gate)) if t.gate else t
            for t in rival.hypothesis.terms
        ]
        if settings.tie <= behind < NEARLY_AS_GOOD and tuple(terms) != rival.hypothesis.terms:
            gated = replace(rival.hypothesis, terms=tuple(terms))
            orders.append(Order(gated, rival.starts, schedules.SETTLE, schedules.CLOSE))
    return fit_all(problem, orders[: settings.most])


def overtaking(
    problem: Problem, leader: Fit, rivals: Sequence[Fit], probabilities: Sequence[float]
) -> Fit | None:
    """The rival that is to lead, once held-out windows count, too; None where the leader may stay.

    The likeliest leads, or the simplest of those that the data cannot tell from it. probabilities: of the leader, then
    of the rivals.
    """
    if not rivals:
        return None
    best = int(np.argmax(probabilities[1:]))
    ahead = rivals[best]
    own, other = (len(fit.hypothesis.parameters) for fit in (leader, ahead))
    simpler, alike = np.exp(problem.run.settings.rivals.tie), 1.0 + ALIKE
    least = simpler if own < other else alike if own == other else 1.0
    return ahead if probabilities[1 + best] > least * probabilities[0] else None


def likeliest(probabilities: Sequence[float]) -> bool:
    """Whether the first explanation is as likely as any."""
    return max(probabilities) <= (1.0 + ALIKE) * probabilities[0]


def _mending(problem: Problem, leader: Fit, fits: Sequence[Fit]) -> list[Fit]:
    """Those with more parameters that are ahead and do not pay: the leader was preferred for that.

    With clean sensors a richer law mends the last digits of a simpler one.
    """
    if not fits:
        return []
    size, nats = len(leader.hypothesis.parameters), scores(problem, [leader, *fits])
    least = nats[0] + MENDING
    ahead = [f for f, n in zip(fits, nats[1:], strict=True) if n > least]
    return [f for f in ahead if len(f.hypothesis.parameters) > size and not pays(problem, f, leader)]


def _fresh(rival: Fit, said: Sequence[Fit]) -> bool:
    """Whether it is not one of those that were said, with something added."""
    return not any(o.hypothesis.claims <= rival.hypothesis.claims for o in said)


def _others(leader: Fit, fits: Sequence[Fit]) -> list[Fit]:
    """Fits that are not the leading explanation with something added."""
    claims = leader.hypothesis.claims
    if not claims:
        return []
    others = [f for f in fits if not claims <= f.hypothesis.claims and not f.hypothesis.idle]
    if leader.hypothesis.scheme == "fine":  # in coarse steps many a law passes for another
        others = [f for f in others if f.hypothesis.scheme == "fine"]
    return others


def _later_nats(question: Question, leader: Fit) -> Callable[[Fit], float]:
    """By how many nats a fit is behind the leader on held-out windows, which count for as much as they are worth."""
    held_out = question.held_out
    if not len(held_out.windows):
        return lambda fit: 0.0
    tau = np.maximum(correlation_time(question.everything, leader.residuals), 1.0)

    def objectives(found: Fit) -> FloatArray:
        return channel_objectives(held_out, held_out_fit(held_out, found.hypothesis))

    own = objectives(leader)
    return lambda found: float(((objectives(found) - own) / tau).sum())


def _earned(problem: Problem, leader: Fit, rival: Fit) -> bool:
    """Whether every term of a rival that says more than the leader pays; without it, it is another rival."""
    if len(rival.hypothesis.terms) <= len(leader.hypothesis.terms):
        return True
    asked: Sequence[int] = range(len(rival.hypothesis.terms))
    if whole_robot(problem, rival.hypothesis):  # what both have the leader has earned
        theirs = leader.hypothesis.claims
        asked = [i for i in asked if rival.hypothesis.terms[i].identity not in theirs]
        around = quadratic(problem, rival)
        smooth = [i for i in asked if around.smooth[i]]
        if not all(pays(problem, rival, around.refitted(problem, [i], schedules.GLANCE)) for i in smooth):
            return False
        asked = [i for i in asked if i not in smooth]
    parts = [rival.hypothesis.without(i) for i in asked]
    orders = [Order(part, rival.starts, schedules.REFIT, schedules.CLOSE) for part in parts]
    return all(pays(problem, rival, less) for less in fit_all(problem, orders))
