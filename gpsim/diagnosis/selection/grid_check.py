"""What a coarse grid leaves over passes for physics: a simpler hypothesis may be as good on a finer one.

A late command that changes inside a substep leaves an error in the position; two sensors that are late by as much leave
none, and are the same physics in more words.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from gpsim.diagnosis.fitting import FINER_GAIN, Fit, Hypothesis, Order, Problem, fit_all, rescored
from gpsim.diagnosis.selection.beam import Found
from gpsim.diagnosis.selection.elimination import lean, simplest, whole_robot
from gpsim.diagnosis.settings import schedules
from gpsim.diagnosis.setup import Question, settled_question
from gpsim.effects import closed

TRIED_FINELY = 3  # hypotheses, simpler than the best, that are tried on the finest grid


def refine_grid(question: Question, found: Found) -> tuple[Question, Found]:
    """The question on as fine a grid as the best of the search needs, and what was found, its best on that grid first.

    Without what only makes up for a coarse grid: what is left then asks for a fine one.
    """
    best = found.fits[0]
    if any(t.gate.region for t in best.hypothesis.terms):
        best = lean(found.problem, best)
    best, on_fine_grid = simplest_on_fine_grid(found.problem, best, found.fits)
    question = settled_question(question, best)
    return question, replace(found, fits=[on_fine_grid, *found.fits])


def simplest_on_fine_grid(problem: Problem, best: Fit, fits: Sequence[Fit]) -> tuple[Fit, Fit]:
    """The best, or one of `fits` with fewer parameters that a fine grid makes as good: as it is, and on that grid."""
    fewer = _best_of_each(best, fits)[:TRIED_FINELY]
    if not fewer or whole_robot(problem, best.hypothesis) or not _grid_matters(problem, [best, *fewer]):
        return best, best
    grid = replace(problem, substeps=problem.most_finer * problem.substeps)
    finely = fit_all(grid, [_order(f) for f in fewer])
    gained = [
        (before, after)
        for before, after in zip(fewer, finely, strict=True)
        if after.objective < rescored(problem, before).objective - FINER_GAIN
    ]
    if not gained:
        return best, best
    leader = fit_all(grid, [_order(best)])[0]
    chosen = simplest(grid, [leader, *(after for _, after in gained)])
    return next(((before, after) for before, after in gained if after is chosen), (best, best))


def _grid_matters(problem: Problem, fits: Sequence[Fit]) -> bool:
    """Whether a finer grid may tell: of a simulator that owns its integration steps are exact enough as they are.

    Unless it steps by a method of its own choice and something remembers commands, which change within a step.
    """
    system = closed(problem.simulator)
    return system is None or (not system.own_grid and any(_remembers(problem, f.hypothesis) for f in fits))


def _remembers(problem: Problem, hypothesis: Hypothesis) -> bool:
    chain = hypothesis.chain(problem.simulator, problem.parameters, problem.dt)
    return chain.actuation.remembers(hypothesis.spread(hypothesis.theta[None], 1)) > 0.0


def _order(found: Fit) -> Order:
    """To fit it once more on a finer grid."""
    return Order(found.hypothesis, found.starts, schedules.SETTLE, schedules.ROUGH, near=True)


def _best_of_each(best: Fit, fits: Sequence[Fit]) -> list[Fit]:
    """The best of what is simpler than the best and acts everywhere, one of the same claims."""
    chosen: list[Fit] = []
    for found in sorted(fits, key=lambda f: f.objective):
        terms = found.hypothesis.terms
        simpler = len(found.hypothesis.parameters) < len(best.hypothesis.parameters)
        fine = found.hypothesis.scheme == best.hypothesis.scheme == "fine"
        new = all(found.hypothesis.claims != f.hypothesis.claims for f in chosen)
        if terms and simpler and fine and new and not any(t.gate for t in terms):
            chosen.append(found)
    return chosen
