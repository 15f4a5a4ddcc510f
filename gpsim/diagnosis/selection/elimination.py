"""Leaving out what is not needed: terms, gates, and laws of which a special case does as well."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from gpsim.diagnosis.fitting import (
    FREE_ROW,
    Fit,
    Hypothesis,
    Order,
    Problem,
    correlation_time,
    expected,
    fit_all,
    fit_order,
    is_row,
    quadratic,
    rescored,
    scores,
    whiteness,
)
from gpsim.diagnosis.run import kept
from gpsim.diagnosis.selection.acceptance import LEAST_PART, pays
from gpsim.diagnosis.selection.gate_edges import placed
from gpsim.diagnosis.selection.gates import NEAR_REACH
from gpsim.diagnosis.settings import schedules
from gpsim.effects import Gate, closed
from gpsim.recordings import evenly

SCREENING_WINDOWS_OF_A_ROBOT = 48
"""Windows of the usual length, on which terms to add or to put in another's place are screened."""
FINE_SPACING = 2e-4  # least spacing of a scan for what is compared with the leader
SCREENING_WINDOWS = 120
"""Windows, of the usual length, on which terms to add or to put in another's place are screened."""
FIRST_LOOK_WINDOWS = 80  # windows, of the usual length, on which a first look shows what may not be needed
MANY_WINDOWS = 1.5  # times as many as these: where there are no more than that, there is no first look
CLEAR_LOSS = 30.0  # loss on those windows that settles that something is needed [nats]
CLEAR_SHARE = 0.2  # share of the variance left over without it that it must remove besides
SMALL_ACCOUNT = 5  # terms of an account of which each is left out by a fit of its own
SURELY_NEEDED = 60.0
"""That leaving a smooth term out of a larger account costs at least where it is needed for sure [nats]."""
SURELY_NEEDED_SHARE = 0.05
"""Of all that is left over, that it must explain besides (more than twice a good share)."""
HOPELESS_LOSS = 600.0  # loss after a few iterations that no further ones make good [nats]
ALIKE = 0.5
"""Nats by which accounts may differ and still be alike: the one of more usual terms stays (on EMPS a bias of the
command and a constant force are the same, and a curve then took the bias for its own)."""
HOPELESS_SHARE = 0.5  # share of the variance left over that what was taken out must have removed besides
EDGE_WORTH = 100.0  # loss that edges which are a little off may make good, moved [nats]
EDGE_BUDGET = 2e7
"""Effort for the edges of one gate where a term is taken out [simulated rows] (by hand, for a minute of one core at
most; 2e8 rows take about twenty seconds)."""


def lean(problem: Problem, leader: Fit) -> Fit:
    """The leader without terms and gates that no longer pay: what stood in for something found since."""
    while True:
        terms = leader.hypothesis.terms
        gated = [i for i, t in enumerate(terms) if t.gate and not t.effect.needs_region]
        less = _fitted_unless_needed(problem, leader, [leader.hypothesis.gated(i, Gate()) for i in gated])
        if len(terms) > 1:
            less += without_a_term(problem, leader)
        less = [f for f in less if not pays(problem, leader, f)]
        if not less:
            return leader
        best = min(f.objective for f in less)
        leader = max(
            (f for f in less if f.objective < best + ALIKE), key=lambda f: _usual_terms(f.hypothesis)
        )


def _usual_terms(hypothesis: Hypothesis) -> int:
    """How many terms are part of the machine that an engineer starts from."""
    return sum(term.effect.usual > 0 for term in hypothesis.terms)


@kept
def without_a_term(problem: Problem, leader: Fit) -> list[Fit]:
    """The leader with one term less each, fitted anew; those that it clearly needs are left out.

    Of a whole robot the others go where the quadratic says, and start states alone are fitted: of the cheapest terms,
    since those that cost more are needed where these are.
    """
    asked, near = doubtful(problem, leader), list[Fit]()
    if whole_robot(problem, leader.hypothesis):
        around = quadratic(problem, leader)
        smooth = [i for i in asked if around.smooth[i]][:CHEAPEST]
        near = [around.refitted(problem, [i], STARTS) for i in smooth]
        asked = [i for i in asked if not around.smooth[i]]
    parts = [leader.hypothesis.without(i) for i in asked]
    return near + _fitted_unless_needed(problem, leader, parts) if parts else near


@kept
def doubtful(problem: Problem, leader: Fit) -> list[int]:
    """Which terms might not be needed: all of a small account, of a large one those that cost little to leave out.

    What costs far more than a term must bring, by the quadratic around the fit, is needed without a fit that says so.
    The cheapest come first.
    """
    count = len(leader.hypothesis.terms)
    if count <= SMALL_ACCOUNT:
        return list(range(count))
    around = quadratic(problem, leader)
    tau = float(np.maximum(correlation_time(problem, leader.residuals)[problem.observed], 1.0).max())
    needed = max(SURELY_NEEDED * tau, SURELY_NEEDED_SHARE * float(problem.counts.sum()) / 2)
    costs, alike = around.costs(), expected(problem, leader.hypothesis)
    least = [FREE_ROW * tau if i in alike else needed for i in range(count)]
    order = [int(i) for i in np.argsort(costs)]
    return [i for i in order if not (around.smooth[i] and costs[i] > least[i])]


def simplest(problem: Problem, fits: Sequence[Fit]) -> Fit:
    """The best, or one of fewer parameters over which it does not pay: a special case of its law, say."""
    best = likeliest(problem, fits)
    while True:
        size = len(best.hypothesis.parameters)
        fewer = [f for f in fits if f.hypothesis.terms and len(f.hypothesis.parameters) < size]
        simpler = [f for f in fewer if not pays(problem, best, f)]
        if not simpler:
            return best
        best = min(simpler, key=lambda f: f.objective)


def likeliest(problem: Problem, fits: Sequence[Fit]) -> Fit:
    """The best by evidence."""
    return fits[int(scores(problem, list(fits)).argmax())]


def on_some_windows(problem: Problem, at: Fit, most: int) -> tuple[Problem, Fit]:
    """The problem on evenly spread windows, enough for a first look, and the fit's share of it.

    most: windows of the usual length; of longer ones as many as hold as many transitions.
    """
    rows = evenly(len(problem.windows), _windows(problem, most))
    return problem.on(problem.windows.take(rows)), replace(
        at, starts=at.starts[rows], residuals=at.residuals[rows]
    )


def whole_robot(problem: Problem, hypothesis: Hypothesis) -> bool:
    """Whether it is a large account of a simulator whose steps are dear, or one of rows alone: what joints have.

    One fit of it stands for many of its parts, and no gates are looked for.
    """
    if closed(problem.simulator) is None:
        return False
    rows = [is_row(term.effect) and not term.gate for term in hypothesis.terms]
    return len(rows) > SMALL_ACCOUNT or (len(rows) >= ROWS and all(rows))


@kept
def only_noise(problem: Problem, leader: Fit) -> bool:
    """Whether a fit leaves nothing that chance would not."""
    return whiteness(problem, leader)[0] > problem.run.settings.acceptance.structured


CHEAPEST = 5  # terms of a whole robot that are left out by turns (by hand)
STARTS = 3  # steps of a fit of start states by slopes that are known
ROWS = 3  # of them are a machine, identified all at once


def for_screening(problem: Problem) -> int:
    """On how many windows of the usual length every term is screened: fewer where steps are dear."""
    if closed(problem.simulator) is None:
        return SCREENING_WINDOWS
    return SCREENING_WINDOWS_OF_A_ROBOT


def _windows(problem: Problem, usual: int) -> int:
    """How many of the problem's windows hold as many transitions as so many of the usual length."""
    return round(usual * problem.run.settings.windows.length / problem.windows.length)


def _fitted_unless_needed(problem: Problem, leader: Fit, parts: Sequence[Hypothesis]) -> list[Fit]:
    """The parts fitted on all windows, but for those that a first look at some of them rules out."""
    if len(problem.windows) > MANY_WINDOWS * _windows(problem, FIRST_LOOK_WINDOWS):
        some, seen = on_some_windows(problem, leader, FIRST_LOOK_WINDOWS)
        seen = rescored(some, seen)
        orders = [Order(part, seen.starts, schedules.REFIT, schedules.ROUGH) for part in parts]
        looks = _all_as_finely(some, leader, orders)
        grids = [some.as_finely(look.hypothesis, leader.hypothesis) for look in looks]
        looks = _all_with_moved_edges([(grid, look, seen) for grid, look in zip(grids, looks, strict=True)])
        needed = [_worse(some, look, seen, CLEAR_LOSS, CLEAR_SHARE) for look in looks]
        parts = [look.hypothesis for look, is_needed in zip(looks, needed, strict=True) if not is_needed]
        orders = [Order(part, leader.starts, schedules.REFIT, schedules.CLOSE, near=True) for part in parts]
        return fit_all(problem, orders)
    orders = [Order(part, leader.starts, schedules.TRIAL, schedules.CLOSE) for part in parts]
    begun = _all_as_finely(problem, leader, orders)
    begun = [f for f in begun if not _hopeless(problem, f, leader)]
    unfinished = [f for f in begun if not f.converged or _finer(problem, f, leader)]
    more = [Order(f.hypothesis, f.starts, schedules.SETTLE, schedules.CLOSE, near=True) for f in unfinished]
    fits = fit_all(problem, more)
    ended = [*fits, *(f for f in begun if not any(f is u for u in unfinished))]
    return _all_with_moved_edges([(problem, f, leader) for f in ended])


def _finer(problem: Problem, less: Fit, leader: Fit) -> bool:
    """Whether the leader's grid is finer than the one that a hypothesis with one term less calls for."""
    return problem.as_finely(less.hypothesis, leader.hypothesis) is not problem


def _all_as_finely(problem: Problem, leader: Fit, orders: Sequence[Order]) -> list[Fit]:
    """`fit_all`, each on a grid as fine as the leader's: what its region's finer grid gains is no merit of a term."""
    return problem.run.side_by_side(
        fit_order, [(problem.as_finely(o.hypothesis, leader.hypothesis), o) for o in orders]
    )


def _all_with_moved_edges(calls: Sequence[tuple[Problem, Fit, Fit]]) -> list[Fit]:
    """`_with_moved_edges` of every call; one that is alone in having something to move has all cores to itself."""
    waiting = [_edges_may_help(*call) for call in calls]
    chosen = [call for call, waits in zip(calls, waiting, strict=True) if waits]
    moved = iter(chosen[0][0].run.side_by_side(_with_moved_edges, chosen) if chosen else ())
    return [next(moved) if waits else call[1] for call, waits in zip(calls, waiting, strict=True)]


def _with_moved_edges(problem: Problem, less: Fit, leader: Fit) -> Fit:
    """A fit with one term less and the edges of its gates moved to where they lie best without it.

    An edge that is a little off makes other terms look needed: a region moved by a millimetre is a sensor's bias, or
    something slight.
    """
    budget = EDGE_BUDGET
    for index, term in enumerate(less.hypothesis.terms):
        if term.gate and _edges_may_help(problem, less, leader):
            less = placed(problem, less, index, NEAR_REACH, FINE_SPACING, budget)
    return less


def _edges_may_help(problem: Problem, less: Fit, leader: Fit) -> bool:
    """Whether it has a gate and its edges may make good what it lacks."""
    if not any(term.gate for term in less.hypothesis.terms):
        return False
    gone = leader.hypothesis.claims - less.hypothesis.claims
    shifting = any(t.effect.site == "sensor" for t in leader.hypothesis.terms if t.identity in gone)
    near = shifting or less.objective < leader.objective + EDGE_WORTH
    return near and pays(problem, leader, less)


def _hopeless(problem: Problem, begun: Fit, leader: Fit) -> bool:
    """Whether no further iterations make it good; of one with a gate, whose edges will move, nobody knows."""
    gated = any(term.gate for term in begun.hypothesis.terms)
    return not gated and _worse(problem, begun, leader, HOPELESS_LOSS, HOPELESS_SHARE)


def _worse(problem: Problem, look: Fit, leader: Fit, nats: float, least_share: float) -> bool:
    """Whether it is worse by so many nats, and by a share of what is left and of the mismatch in some channel."""
    removed = look.variance - leader.variance
    least_part = LEAST_PART * problem.mismatch
    large = (removed > least_share * look.variance) & (removed > least_part)
    return bool(large[problem.observed].any()) and look.objective > leader.objective + nats
