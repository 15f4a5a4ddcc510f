"""The account with one effect less, all others fitted anew."""

from __future__ import annotations

from gpsim.diagnosis.fitting import Fit, Problem, fit
from gpsim.diagnosis.run import kept


@kept
def fits_without(problem: Problem, leader: Fit, null: Fit) -> list[Fit]:
    """(T) fits without each term, integrated by the same scheme on as fine a grid. null: without any."""
    calls = [(problem, leader, null, i) for i in range(len(leader.hypothesis.terms))]
    return problem.run.side_by_side(_without, calls)


def _without(problem: Problem, leader: Fit, null: Fit, index: int) -> Fit:
    less, settings = leader.hypothesis.without(index), problem.run.settings.schedules
    grid = problem.as_finely(less, leader.hypothesis)
    if grid is problem and not less.terms and less.scheme == null.hypothesis.scheme:
        return null
    return fit(grid, less, leader.starts, iterations=settings.refit, tolerance=settings.edge, near=True)
