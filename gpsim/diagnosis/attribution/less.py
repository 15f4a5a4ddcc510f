"""The account with one effect less, all others fitted anew."""

from __future__ import annotations

from collections.abc import Sequence

from gpsim.diagnosis.fitting import Fit, Problem, fit, quadratic
from gpsim.diagnosis.run import kept
from gpsim.diagnosis.selection import SMALL_ACCOUNT, whole_robot
from gpsim.diagnosis.settings import schedules
from gpsim.effects import closed

DEAR_STEPS = 2  # of a fit of start states, by slopes that are known, where every step is dear


@kept
def fits_without(problem: Problem, leader: Fit, null: Fit) -> list[Fit]:
    """(T) fits without each term, integrated by the same scheme on as fine a grid. null: without any."""
    count = len(leader.hypothesis.terms)
    large = count > SMALL_ACCOUNT or whole_robot(problem, leader.hypothesis)
    if large and count > 1:  # of a whole machine: the others go where the quadratic says
        dear = closed(problem.simulator) is not None
        around, steps = quadratic(problem, leader), DEAR_STEPS if dear else schedules.GLANCE
        fits = {i: around.refitted(problem, [i], steps) for i in range(count) if around.smooth[i]}
    else:
        fits = {}
    others = [i for i in range(count) if i not in fits]
    refitted = problem.run.side_by_side(_without, [(problem, leader, null, i) for i in others])
    fits |= zip(others, refitted, strict=True)
    return [fits[i] for i in range(count)]


def without_all(problem: Problem, leader: Fit, gone: Sequence[int]) -> Fit:
    """The account without several terms at once, fitted anew."""
    less = quadratic(problem, leader).without(gone)
    return fit(problem, less, leader.starts, iterations=schedules.REFIT, tolerance=schedules.EDGE, near=True)


def _without(problem: Problem, leader: Fit, null: Fit, index: int) -> Fit:
    less = leader.hypothesis.without(index)
    grid = problem.as_finely(less, leader.hypothesis)
    if grid is problem and not less.terms and less.scheme == null.hypothesis.scheme:
        return null
    return fit(grid, less, leader.starts, iterations=schedules.REFIT, tolerance=schedules.EDGE, near=True)
