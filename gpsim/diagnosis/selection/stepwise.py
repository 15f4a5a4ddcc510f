"""Improving a hypothesis on all training windows: one more term, another one in the place of each, finer edges.

The search looks at few windows and follows the best single term; what it overlooks is either weak, and shows with
more data, or was taken by a term that is not quite right, and shows when that one is taken out again.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace

from gpsim.diagnosis.fitting import (
    Candidate,
    Directions,
    Fit,
    Hypothesis,
    Order,
    Problem,
    child_of,
    fit,
    fit_all,
    fit_near,
    fit_order,
    is_row,
    rescored,
    scores,
    screened,
    whiteness,
)
from gpsim.diagnosis.run import kept
from gpsim.diagnosis.selection.acceptance import may_pay, pays
from gpsim.diagnosis.selection.beam import most_promising
from gpsim.diagnosis.selection.change_points import begun_later
from gpsim.diagnosis.selection.elimination import (
    FINE_SPACING,
    doubtful,
    for_screening,
    lean,
    likeliest,
    on_some_windows,
    only_noise,
    simplest,
    whole_robot,
)
from gpsim.diagnosis.selection.gates import (
    FINEST_SPACING,
    PROMISING_GATES,
    gated_children,
    may_be_limited,
    moments,
    region_channels,
    with_edges,
    with_refined_edges,
)
from gpsim.diagnosis.selection.lack_of_fit import lack_of_fit
from gpsim.diagnosis.selection.reconsidered import reconsidered
from gpsim.diagnosis.selection.refit import Contenders
from gpsim.diagnosis.selection.substitution import AS_WELL, left_open, specialised, substitutes
from gpsim.diagnosis.settings import schedules
from gpsim.diagnosis.setup import Question
from gpsim.effects import RISE, Effect, LooksAt, closed, effect_of

AGAIN_BUDGET = 4e7
"""Effort of searching on without a term that support took out, each time [simulated rows] (by hand, for a minute of
one core at most; 2e8 rows take about twenty seconds)."""
GATE_WINDOWS = 40  # windows, of the usual length, on which every term is looked at behind gates
ADDED = 3  # terms that are fitted on all windows to be added
GATED = 3  # terms behind a gate that are fitted on all windows to be added
SIMPLIFIED = 3  # rivals of a round of which what they do not need is taken out
LEAST_GAIN_OF_A_TERM = 3.0
"""Linear gain, on all windows, that a term must promise, for it to be fitted [nats]."""
GATED_BELOW = 1e-3
"""P-value of whiteness below which every term is looked at behind gates, not only the leader's own."""
LOCAL_RATIO = 3.0
"""Times the gain of the best term that acts everywhere: a smooth law that promises more asks for gates."""
LEAST_ADVANCE = 0.1  # gain by which another leader must be better [nats]
FINE_PREFERENCE_OF_A_LEADER = 15.0
"""Loss at which a leader is still integrated finely rather than in coarse steps [nats]."""
TERMS_ON_TRIAL = 2  # terms in a row that are taken though they do not pay until the next one does

ROBOT_GAIN = (
    20.0  # nats that a term promises beside all of a robot's rows, or it is not fitted: each fit is dear
)


def stepwise(
    question: Question,
    contenders: Contenders,
    offers: Sequence[Candidate],
    tell: Callable[[str], None],
    gates: bool = True,
    replacing: bool = True,
) -> Contenders:
    """The leader with terms added, gated, substituted and eliminated as long as that pays, and all that was tried.

    gates: whether also regions and onsets are looked for; replacing: whether something else may stand for a term.
    """
    leader, tried = improved(question.everything, contenders.leader, offers, tell, gates, replacing)
    return replace(contenders, leader=leader, tried=[*contenders.tried, *tried])


def improved(
    problem: Problem,
    leader: Fit,
    offers: Sequence[Candidate],
    tell: Callable[[str], None],
    gates: bool = True,
    replacing: bool = True,
) -> tuple[Fit, list[Fit]]:
    """The leader with terms added, gated and replaced while that pays, and every fit that was tried on the way."""
    settings = problem.run.settings.stepwise
    leader = _finished(problem, _finely(problem, leader))
    leader = lean(problem, with_refined_edges(problem, leader, FINE_SPACING))
    tried: list[Fit] = []
    spent = problem.run.budget.spent
    most = max(min(spent + settings.budget, settings.total_budget), spent + settings.least_budget)
    enough = max(min(most + settings.substitution_budget, settings.total_budget), most)
    if not gates:
        most = enough = spent + AGAIN_BUDGET
    while True:
        tell(f"{leader.hypothesis.label}: is one more missing?")
        leader, children = _extended(problem, leader, offers, most, gates=False)
        tried += _new(children, tried)
        again = _reconsidered(problem, leader, offers) if problem.run.budget.spent < enough else []
        tried += again
        best = simplest(problem, [leader, *again])
        leader = _finished(problem, best) if _advances(problem, best, leader) else leader
        tell(f"{leader.hypothesis.label}: does another one fit as well?")
        others = _all_substitutes(problem, leader, offers, enough) if replacing else []
        near = sorted(
            (f for f in others if f.objective < leader.objective + AS_WELL), key=lambda f: f.objective
        )
        leaned = [lean(problem, f) for f in near[:SIMPLIFIED] if problem.run.budget.spent < enough]
        others += _new(leaned, near)
        tried += others
        best = simplest(problem, [leader, *others])
        if _advances(problem, best, leader):
            leader = _finished(problem, best if any(best is f for f in leaned) else lean(problem, best))
            if problem.run.budget.spent > most:
                if not whole_robot(problem, leader.hypothesis):  # whose twins are told by forces
                    leader, twins = _among_twins(problem, leader, offers)
                    tried += twins
                break
            continue
        if not gates or whole_robot(problem, leader.hypothesis):
            break
        tell(f"{leader.hypothesis.label}: is one more missing somewhere?")  # dear: last
        extended, children = _extended(problem, leader, offers, most, gates=True)
        tried += _new(children, tried)
        if extended is leader:
            break
        leader = extended
    if leader.hypothesis.is_patchwork():
        return leader, tried  # it will not be named
    return with_refined_edges(problem, specialised(problem, leader, offers), FINEST_SPACING), tried


def _new(fits: Sequence[Fit], known: Sequence[Fit]) -> list[Fit]:
    return [f for f in fits if not any(f is g for g in known)]


def _all_substitutes(
    problem: Problem, leader: Fit, offers: Sequence[Candidate], until: float, *, twins: bool = False
) -> list[Fit]:
    """`substitutes` for one term of the leader after the other, until so much effort is spent."""
    count = len(leader.hypothesis.terms)
    asked = range(count) if closed(problem.simulator) is None else doubtful(problem, leader)
    if whole_robot(problem, leader.hypothesis):  # what every joint has stands for nothing else
        terms = leader.hypothesis.terms
        asked = [i for i in asked if not is_row(terms[i].effect) and terms[i].variant != RISE]
        offers = [c for c in offers if not is_row(effect_of(c.family))]
    calls = [(problem, leader, i, _alike(problem, leader, i, offers), twins) for i in asked]
    return [f for found in problem.run.side_by_side(substitutes, calls, until) for f in found]


def _alike(problem: Problem, leader: Fit, index: int, offers: Sequence[Candidate]) -> Sequence[Candidate]:
    """What may stand in a term's place: of a whole robot a body's for a body's, a command's for a command's."""
    if not whole_robot(problem, leader.hypothesis):
        return offers
    kind = _kind(leader.hypothesis.terms[index].effect)
    return [c for c in offers if _kind(effect_of(c.family)) == kind]


def _kind(effect: Effect) -> str:
    return "model" if effect.site == "parameter" else effect.site


def _reconsidered(problem: Problem, leader: Fit, offers: Sequence[Candidate]) -> list[Fit]:
    """What is left of the leader beside the usual machine; of what says no more, also without what does not pay."""
    found, size = reconsidered(problem, leader, offers), len(leader.hypothesis.parameters)
    alike = [f for f in found if len(f.hypothesis.parameters) <= size]
    leaned = [lean(problem, f) for f in alike if f.objective < leader.objective + AS_WELL]
    return [*found, *_new(leaned, found)]


def _among_twins(problem: Problem, leader: Fit, offers: Sequence[Candidate]) -> tuple[Fit, list[Fit]]:
    """The leader or one of its near twins, of which those of the last leader say nothing, and the twins."""
    twins = _all_substitutes(problem, leader, offers, math.inf, twins=True)
    return simplest(problem, [leader, *twins]), twins


def _advances(problem: Problem, best: Fit, leader: Fit) -> bool:
    """Whether it says less than the leader or fits better; what merely says the same otherwise is a rival."""
    if len(best.hypothesis.parameters) < len(leader.hypothesis.parameters):
        return True
    nats = scores(problem, [best, leader])
    return bool(nats[0] > nats[1] + LEAST_ADVANCE)


def _extended(
    problem: Problem, leader: Fit, offers: Sequence[Candidate], most: float, *, gates: bool
) -> tuple[Fit, list[Fit]]:
    """The leader with terms added while that pays, and all that was tried; most: effort to stop at.

    gates: also such that act behind a gate, and terms on trial.
    """
    tried: list[Fit] = []
    firm, steps = leader, 0
    while not leader.hypothesis.is_patchwork():
        over = problem.run.budget.spent >= most  # to ask when what there is began costs next to nothing
        if over and (gates or whole_robot(problem, leader.hypothesis)):
            break
        children = (
            begun_later(problem, leader, offers) if over else _children(problem, leader, offers, most, gates)
        )
        tried += children
        better = [child for child in children if pays(problem, child, leader)]
        if not better and gates and steps < TERMS_ON_TRIAL:
            # a slight term may pay once another one has left nothing but noise
            better = [child for child in children if may_pay(problem, child, leader)]
            steps += 1
        if not better:
            break
        leader = _finished(problem, likeliest(problem, better))
        if not over:  # at the end they are refined in any case
            leader = with_refined_edges(problem, leader, FINE_SPACING)
        if steps == 0 or whiteness(problem, leader)[0] > problem.run.settings.acceptance.structured:
            leader = firm = lean(problem, leader)
            steps = 0
        if over:
            break
    return firm, tried


def _finely(problem: Problem, leader: Fit) -> Fit:
    """The leader integrated finely, where that does about as well: a coarse step passes for physics.

    At 10 Hz an Euler step looks like a lateral slip of half a step: one may stand for the other.
    """
    if leader.hypothesis.scheme == "fine":
        return leader
    fine = fit(problem, replace(leader.hypothesis, scheme="fine"), leader.starts)
    return fine if fine.objective < leader.objective + FINE_PREFERENCE_OF_A_LEADER else leader


def _finished(problem: Problem, leader: Fit) -> Fit:
    """The leader followed to its end, also from the start states that were measured.

    It was fitted a little, from where another hypothesis had left the windows: what is right may stand far off there.
    """
    starts = [leader.starts, problem.windows.measured[:, 0]]
    longest, least = schedules.FINISH, schedules.FINAL
    if whole_robot(problem, leader.hypothesis):
        starts.pop()  # from which speeds that nobody measured would have to be found again
        longest, least = schedules.SETTLE, schedules.ROUGH  # where joints stick a fit creeps on without end
    tried = fit_all(problem, [Order(leader.hypothesis, s, schedules.GLANCE, least) for s in starts])
    best = min(tried, key=lambda f: f.objective)
    if not best.converged:
        more = Order(best.hypothesis, best.starts, longest, least, near=True)
        best = fit_order(problem, more)
    return best if best.objective < leader.objective else leader


def _children(
    problem: Problem, leader: Fit, offers: Sequence[Candidate], most: float, gates: bool
) -> list[Fit]:
    """The leader with one term more, or where structure is left with one behind a gate.

    That is where `gates` are asked for and nothing else pays, or where far more is missing than what else pays gains.
    most: the effort after which nothing more is begun.
    """
    settings = problem.run.settings.stepwise
    if whole_robot(problem, leader.hypothesis) and only_noise(problem, leader):
        offers = [c for c in offers if _kind(effect_of(c.family)) == "model"]  # all else would show
    directions, plain = _plain(problem, leader, offers)
    part, seen = directions.problem, directions.parent
    better = [f for f in plain if pays(problem, f, leader)]
    if problem.run.budget.spent > most or whole_robot(problem, leader.hypothesis):
        return plain
    if not (_shows_in_a_place_only(problem, leader, better) if better else gates):  # other gates are dear
        return plain
    structured = whiteness(problem, leader)[0] < GATED_BELOW
    if not structured:
        lack = lack_of_fit(problem, leader)
        structured = lack is not None and lack.significant
    around = None if structured else directions
    calls = [(part, seen, i, offers, around) for i in range(len(leader.hypothesis.terms))]
    gated = [f for found in problem.run.side_by_side(_gated, calls) for f in found]
    if structured and problem.run.budget.spent < most and leader.hypothesis.unusual < settings.most_terms:
        everywhere = most_promising(part, directions, offers, PROMISING_GATES)
        few = Directions(*on_some_windows(part, seen, GATE_WINDOWS))
        gated += gated_children(part, directions, everywhere, offers, few=few)
    elif (
        not leader.hypothesis.terms and closed(problem.simulator) is None
    ):  # what began late and is slight leaves the recording white as a whole
        gated += gated_children(part, directions, plain, offers, moments(part), few=directions)
    gated = with_edges(part, sorted(gated, key=lambda f: f.objective)[:GATED], GATED)
    orders = [Order(f.hypothesis, leader.starts, schedules.REFIT, schedules.ROUGH) for f in gated]
    return plain + fit_all(problem, orders)


def _shows_in_a_place_only(problem: Problem, leader: Fit, better: Sequence[Fit]) -> bool:
    """Whether a smooth law of a place promises far more than those terms gain that act everywhere."""
    best = min(better, key=lambda f: f.objective)
    if whiteness(problem, best)[0] > problem.run.settings.acceptance.structured:
        return False
    lack = lack_of_fit(problem, leader)
    gained = leader.objective - best.objective
    if lack is None or not lack.significant or lack.nats < LOCAL_RATIO * gained:
        return False
    return any(channel in lack.on for channel in region_channels(problem))


@kept
def _plain(problem: Problem, leader: Fit, offers: Sequence[Candidate]) -> tuple[Directions, list[Fit]]:
    """What one term more changes on a few windows, and the leader with one that acts everywhere or since a moment."""
    settings = problem.run.settings.stepwise
    part, seen = on_some_windows(problem, leader, for_screening(problem))
    directions = Directions(part, seen)
    later = [] if whole_robot(problem, leader.hypothesis) else begun_later(problem, leader, offers)
    if leader.hypothesis.unusual >= settings.most_terms:
        return directions, later
    taken = leader.hypothesis.claims
    found = screened(directions, [c for c in offers if c.identity not in taken and not c.only_gated])
    more = len(problem.windows) / len(part.windows)
    least = ROBOT_GAIN if whole_robot(problem, leader.hypothesis) else LEAST_GAIN_OF_A_TERM
    chosen = [(c, start) for worth, c, start in found[:ADDED] if more * worth > least]
    promised = more * found[0][0] if found else 0.0
    if any(leader.objective - f.objective > promised and pays(problem, f, leader) for f in later):
        return directions, later
    children = [child_of(leader.hypothesis, c, start) for c, start in chosen]
    if whole_robot(problem, leader.hypothesis):
        children = _worth_a_fit(part, seen, children, ROBOT_GAIN / more)
    orders = [Order(child, leader.starts, schedules.GLANCE, schedules.ROUGH) for child in children]
    return directions, fit_near(problem, orders, schedules.SETTLE, schedules.ROUGH) + later


def _worth_a_fit(part: Problem, seen: Fit, children: Sequence[Hypothesis], least: float) -> list[Hypothesis]:
    """Those that gain so many nats where they are fitted to a part of the windows: what is linear promises too much."""
    before = rescored(part, seen)
    orders = [Order(child, seen.starts, schedules.GLANCE, schedules.ROUGH) for child in children]
    return [f.hypothesis for f in fit_all(part, orders) if before.objective - f.objective > least]


def _gated(
    part: Problem, seen: Fit, index: int, offers: Sequence[Candidate], around: Directions | None
) -> list[Fit]:
    """The leader with a term that acts everywhere put behind a gate, where one promises more.

    around: where nothing but noise is left, what changes around the leader; most gates are ruled out by it.
    """
    term = seen.hypothesis.terms[index]
    same = [c for c in offers if c.place.on == term.on and c.variant == term.variant and c.gateable]
    cases = term.effect.special_cases(term.values)
    itself = [c for c in same if c.family == term.family or (c.only_gated and c.family in cases)]
    if term.gate or not itself:
        return []
    values = tuple(term.values[p.name] for p in itself[0].declared)
    channels: list[LooksAt] | None = None
    if around is not None:
        without = Directions(part, replace(left_open(part, seen, index), variance=seen.variance))
        laws = [(c, cases.get(c.family, values) if c.only_gated else values) for c in itself]
        found = {channel for law in laws for channel in may_be_limited(around, without, *law)}
        channels = [c for c in region_channels(part) if c in found]
        if not channels:
            return []
    less = Order(seen.hypothesis.without(index), seen.starts, schedules.SETTLE, schedules.ROUGH)
    parent = fit_order(part, less)
    whole = child_of(parent.hypothesis, itself[0], values)
    return gated_children(part, Directions(part, parent), [replace(seen, hypothesis=whole)], itself, channels)
