"""Effects that the user requires: in every account from the start, and told where they do nothing."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from gpsim.diagnosis.fitting import Candidate, Directions, Fit, Hypothesis, Problem, child_of, fit, screened
from gpsim.diagnosis.settings import schedules
from gpsim.diagnosis.setup import Question

NOTHING_GAINED = 2.0
"""For each of its parameters, below which an effect that the user requires does nothing [nats]."""


def with_required(problem: Problem, found: Fit, offers: Sequence[Candidate]) -> Fit:
    """The fit with every required effect that it lacks, each where it promises most, and all fitted."""
    known = problem.run.known
    while lacking := known.lacking(found.hypothesis.claims):
        family, _, on = lacking[0].partition(" on ")
        there = [c for c in offers if c.family == family and on in ("", c.place.on) and not c.only_gated]
        _, best, start = screened(Directions(problem, found), there)[0]
        child = child_of(found.hypothesis, best, start)
        problem.run.trace.note(child.names, found.hypothesis.names, True, "required")
        found = fit(problem, child, found.starts, iterations=schedules.SETTLE)
    return found


def does_nothing(leader: Fit, part: Fit) -> bool:
    """Whether the leader without a required effect, `part`, is as good but for what chance gains."""
    free = len(leader.hypothesis.parameters) - len(part.hypothesis.parameters)
    return part.objective - leader.objective < NOTHING_GAINED * free


def required_in(problem: Problem, leader: Fit, part: Hypothesis) -> bool:
    """Whether a part of the leader lacks what is required and the leader has."""
    known = problem.run.known
    return len(known.lacking(part.claims)) > len(known.lacking(leader.hypothesis.claims))


def without_idle(question: Question, leader: Fit) -> Question:
    """The question in which nothing is required any more that the leader lacks: it did nothing."""
    run = question.everything.run
    idle = run.known.lacking(leader.hypothesis.claims)
    if not idle:
        return question
    left = tuple(name for name in run.known.require if name not in idle)
    run = run.knowing(replace(run.known, require=left))
    everything, searched, held_out = (
        replace(p, run=run) for p in (question.everything, question.searched, question.held_out)
    )
    return replace(question, everything=everything, searched=searched, held_out=held_out, idle=idle)
