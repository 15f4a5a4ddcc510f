"""What a coarse grid leaves over passes for physics: a simpler hypothesis may be as good on a finer one.

A late command that changes inside a substep leaves an error in the position; two sensors that are late by as much leave
none, and are the same physics in more words.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from gpsim.diagnosis.fitting import Fit, Order, Problem, fit_all, rescored
from gpsim.diagnosis.selection.elimination import simplest

TRIED = 3  # simpler hypotheses, the best


def simplest_on_fine_grid(problem: Problem, best: Fit, fits: Sequence[Fit]) -> tuple[Fit, Fit]:
    """The best, or one of `fits` with fewer parameters that a fine grid makes as good: as it is, and on that grid."""
    fewer = _best_of_each(best, fits)
    if not fewer:
        return best, best
    settings = problem.run.settings.discretisation
    grid = replace(problem, substeps=settings.most_finer * problem.substeps)
    finely = fit_all(grid, [Order(f.hypothesis, f.starts, 8, near=True) for f in fewer])
    gained = [
        (before, after)
        for before, after in zip(fewer, finely, strict=True)
        if after.objective < rescored(problem, before).objective - settings.finer_gain
    ]
    if not gained:
        return best, best
    leader = fit_all(grid, [Order(best.hypothesis, best.starts, 8, near=True)])[0]
    chosen = simplest(grid, [leader, *(after for _, after in gained)])
    return next(((before, after) for before, after in gained if after is chosen), (best, best))


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
    return chosen[:TRIED]
