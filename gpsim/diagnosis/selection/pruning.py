"""Pruning: terms that do not pay, or that held-out windows speak against, are taken out."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from gpsim.diagnosis.fitting import Fit, Problem, fit, gain, start_slopes
from gpsim.diagnosis.selection.acceptance import on_its_grid, pays
from gpsim.diagnosis.selection.elimination import without_a_term
from gpsim.diagnosis.selection.held_out import contradicted, held_out_fit
from gpsim.diagnosis.selection.refit import CONTRADICTING_LOSS, Contenders, null_of
from gpsim.diagnosis.selection.required import does_nothing, required_in
from gpsim.diagnosis.settings import schedules
from gpsim.diagnosis.setup import Question


def prune_on_held_out(question: Question, contenders: Contenders) -> Contenders:
    """The leader with what it needs alone; the base simulator is integrated as it is from here on."""
    problem, leader, null = question.everything, contenders.leader, contenders.null
    while leader.hypothesis.terms:
        parts = [p for p in without_a_term(problem, leader) if not required_in(problem, leader, p.hypothesis)]
        less = [f for f, needed in zip(parts, _needed(question, leader, parts), strict=True) if not needed]
        if not less:
            break
        leader = min(less, key=lambda f: f.objective)
    leader = _without_idle_requirements(problem, leader)
    if leader.hypothesis.scheme != null.hypothesis.scheme:
        null = null_of(problem, leader.hypothesis.scheme)
    return replace(contenders, leader=leader, null=null)


def _without_idle_requirements(problem: Problem, leader: Fit) -> Fit:
    """The leader without what is required and does nothing: the account says so."""
    for term in leader.hypothesis.terms:
        if not problem.run.known.requires(term.identity):
            continue
        at = next(i for i, t in enumerate(leader.hypothesis.terms) if t.identity == term.identity)
        rest = leader.hypothesis.without(at)
        part = fit(
            problem.as_finely(rest, leader.hypothesis), rest, leader.starts, iterations=schedules.SETTLE
        )
        if does_nothing(leader, part):
            problem.run.trace.note(leader.hypothesis.names, rest.names, False, "required, and does nothing")
            leader = part
    return leader


def _needed(question: Question, leader: Fit, parts: Sequence[Fit]) -> list[bool]:
    """Whether the term that each part lacks pays, and held-out windows do not contradict it.

    A few of them may say nothing of it.
    """
    problem, held_out = question.everything, question.held_out
    paying = [pays(problem, leader, part) for part in parts]
    if not len(held_out.windows) or not any(paying):
        return paying
    asked = [part for part, pay in zip(parts, paying, strict=True) if pay]
    grids = [held_out.as_finely(part.hypothesis, leader.hypothesis) for part in asked]
    slopes = start_slopes(held_out, leader.hypothesis)
    calls = [(grid, part.hypothesis, slopes) for grid, part in zip(grids, asked, strict=True)]
    own, *others = problem.run.side_by_side(held_out_fit, [(held_out, leader.hypothesis, slopes), *calls])
    won = [gain(problem, leader, on_its_grid(problem, part, leader)) for part in asked]
    least = CONTRADICTING_LOSS
    kept = [
        not contradicted(held_out, own, other, by, least * by) for other, by in zip(others, won, strict=True)
    ]
    for part, other, stays in zip(asked, others, kept, strict=True):
        if not stays:
            problem.run.trace.note(
                leader.hypothesis.names,
                part.hypothesis.names,
                False,
                "held-out windows contradict",
                gain=other.objective - own.objective,
            )
    answers = iter(kept)
    return [pay and next(answers) for pay in paying]
