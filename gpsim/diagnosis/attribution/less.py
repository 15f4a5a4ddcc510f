"""The account with one effect less, all others fitted anew."""

from __future__ import annotations

from collections.abc import Sequence

from gpsim.diagnosis.fitting import Fit, Hypothesis, Problem, fit, quadratic
from gpsim.diagnosis.run import kept
from gpsim.diagnosis.selection import SMALL_ACCOUNT, whole_robot
from gpsim.diagnosis.settings import schedules
from gpsim.effects import closed

DEAR_STEPS = 2  # of a fit of start states, by slopes that are known, where every step is dear


@kept
def fits_without(problem: Problem, leader: Fit, null: Fit) -> list[Fit]:
    """(T) fits without each term, integrated by the same scheme on as fine a grid. null: without any."""
    return [fit_without(problem, leader, null, i) for i in range(len(leader.hypothesis.terms))]


def fit_without(problem: Problem, leader: Fit, null: Fit, index: int) -> Fit:
    """The fit without one term."""
    if index in (others := _refitted(problem, leader, null)):
        return others[index]
    steps = DEAR_STEPS if closed(problem.simulator) is not None else schedules.GLANCE
    return quadratic(problem, leader).refitted(problem, [index], steps)


def accounts_without(problem: Problem, leader: Fit, null: Fit) -> list[Hypothesis]:
    """(T) the accounts without each term; where the quadratic says all of it no start states are fitted."""
    others, count = _refitted(problem, leader, null), len(leader.hypothesis.terms)
    smooth = [i for i in range(count) if i not in others]
    accounts = {i: f.hypothesis for i, f in others.items()}
    accounts |= {i: quadratic(problem, leader).without([i]) for i in smooth}
    return [accounts[i] for i in range(count)]


@kept
def _refitted(problem: Problem, leader: Fit, null: Fit) -> dict[int, Fit]:
    """The fits without each term of a small account, or without one whose law jumps."""
    smooth = _smooth_parts(problem, leader)
    others = [i for i in range(len(leader.hypothesis.terms)) if i not in smooth]
    calls = [(problem, leader, null, i) for i in others]
    return dict(zip(others, problem.run.side_by_side(_without, calls), strict=True))


def _smooth_parts(problem: Problem, leader: Fit) -> list[int]:
    """Terms of a whole machine that no law jumps in: without one of them the others go where the quadratic says."""
    count = len(leader.hypothesis.terms)
    if count < 2 or not (count > SMALL_ACCOUNT or whole_robot(problem, leader.hypothesis)):
        return []
    return [i for i, smooth in enumerate(quadratic(problem, leader).smooth) if smooth]


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
