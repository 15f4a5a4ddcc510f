"""Support: a slight effect, or one behind a gate, must hold in two halves of the samples where it acts.

A search over regions, onsets and small corrections finds what mends a nuisance of one stretch. What is physics does so
again in the other half: each half's own estimate is within a few standard errors of the other's, and each is better
explained with it than without.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from gpsim.channels import BoolArray, FloatArray, IntArray
from gpsim.diagnosis.attribution.attribution import Attribution, attribute
from gpsim.diagnosis.attribution.less import accounts_without, fit_without, without_all
from gpsim.diagnosis.attribution.plainer import plainer
from gpsim.diagnosis.attribution.roles import matters, sure_terms
from gpsim.diagnosis.attribution.twins import unsure_twins
from gpsim.diagnosis.fitting import Candidate, Fit, Hypothesis, Problem, curvature, fit, is_row, start_slopes
from gpsim.diagnosis.report import Share
from gpsim.diagnosis.selection import lean, required_in, whole_robot
from gpsim.diagnosis.settings import Settings, schedules
from gpsim.diagnosis.setup import Question
from gpsim.effects import closed

HARMS = 0.003
"""Of the mismatch, that more is explained without an effect that does harm (as much as is needed)."""
SPARE = 0.5
"""Times what the account leaves: an effect that is needed by less, and explains much, is one that others share (by
hand: the mass of the open cart-pole rig, without which rollouts end further off, is needed by two thirds of what is
left; on rough worlds of seeds 31 and 51 what stood beside the true law, by less than half)."""
GROWS = 1.5
"""Times the squared error of some channel: an effect without which it surely grows by that does no harm and is not
spare (a machine of seed 77: a cart and a pole that falls; dry friction without which the cart's error is 13 times as
large was spare by its share of the whole, which the pole decides)."""
ACTS = 0.05  # of the most that it changes in any window: it acts in windows where it changes more
SURELY = 20.0
"""Nats that a body or a motor of a whole robot is worth to the windows, that stays though no rollout shows it: as many
as bring it in (a link 12 % too heavy, of Panda in seed 3050, without which the load in its hand is 5 % too heavy)."""
FEWEST_WINDOWS_OF_A_HALF = 4  # a half must have, else it cannot be asked [windows]
APART = 3.0  # of both halves together, by which their estimates may differ [standard errors]

TINY = 1e-300  # guards a division by what windows do not know


def supported(
    question: Question, leader: Fit, null: Fit, structured: bool, offers: Sequence[Candidate] = ()
) -> Fit:
    """The leader without terms that do harm, or that a part of the recording alone supports, or gates without need.

    structured: whether the leader leaves something that chance would not; then a region, an onset or a law's further
    parameter is easily found that mends some of it. offers: what a law may be a plainer form of.
    """
    problem, before = question.everything, leader
    while leader.hypothesis.terms:
        found = attribute(question, leader, null)
        plain = plainer(problem, leader, found, offers) if structured else None
        if plain is not None:
            names = (leader.hypothesis.names, plain.hypothesis.names)
            problem.run.trace.note(*names, False, "a plainer law does as well")
            leader = lean(problem, plain)  # what paid by its gate alone does not pay without it
            continue
        less = partial(fit_without, problem, leader, null)
        parts = accounts_without(problem, leader, null)
        free = [i for i, part in enumerate(parts) if not required_in(problem, leader, part)]
        robot = whole_robot(problem, leader.hypothesis)
        unseen = _unseen(problem, leader, found, _of_no_joint(leader, free) if robot else free)
        if len(unseen) > 1:
            fewer = without_all(problem, leader, unseen)
            names = (leader.hypothesis.names, fewer.hypothesis.names)
            problem.run.trace.note(*names, False, "no rollout shows them")
            leader = fewer
            continue
        said = _unsupported(problem, leader, found, less, free, structured)
        if said is None:
            return leader if leader is before or robot else lean(problem, leader)
        index, why = said
        names = (leader.hypothesis.names, parts[index].names)
        problem.run.trace.note(*names, False, why)
        leader = less(index)
    return leader


def _unsupported(
    problem: Problem,
    leader: Fit,
    found: Attribution,
    less: Callable[[int], Fit],
    free: Sequence[int],
    structured: bool,
) -> tuple[int, str] | None:
    """Which of the terms `free` to go goes first, and why; None where all may stay."""
    settings, needed = problem.run.settings, [part.share for part in found.needed]

    def least(which: Sequence[int], why: str) -> tuple[int, str]:
        return min(which, key=lambda i: needed[i]), why

    twins = [i for i in unsure_twins(problem, leader) if i in free]
    if twins:
        cheapest = min(twins, key=lambda i: less(i).objective)
        return cheapest, "a gain and the inertia that it moves: the recording shows their ratio"
    asked = [i for i in free if found.grows[i] < GROWS]  # no channel surely needs it
    harm = [i for i in asked if needed[i] < -HARMS and _most(found.needed[i]) < 0.0]
    if whole_robot(problem, leader.hypothesis):
        structured, free = False, _of_no_joint(leader, free)
    if harm:
        return least(harm, "held-out rollouts are better without it")
    hidden = _unseen(problem, leader, found, free)
    if hidden:
        return least(hidden, "no rollout shows it")
    mends = [i for i in free if structured and _mends(leader, found, i, settings)]
    if mends:
        return least(mends, "behind a gate it mends what is left")
    spare = [i for i in asked if structured and _spare(found, i, settings)]
    if spare:
        return least(spare, "others explain what it explains")
    odd = [i for i in free if structured and found.roles[i] == "slight" and _implausible(leader, i, settings)]
    if odd:
        return least(odd, "slight, and no machine has such a size")
    strange = [i for i in asked if structured and _stands_in(leader, found, i)]
    if strange:
        return least(strange, "slight, unusual, and less than what is left")
    doubtful = [i for i in free if _doubtful(leader.hypothesis, found, i)]
    answers = problem.run.side_by_side(holds_in_halves, [(problem, leader, less(i), i) for i in doubtful])
    fails = [i for i, holds in zip(doubtful, answers, strict=True) if not holds]
    return least(fails, "one half alone supports it") if fails else None


def _of_no_joint(leader: Fit, free: Sequence[int]) -> list[int]:
    """Without what every joint of a robot has: that stands by what it costs to leave out, which was asked before."""
    return [i for i in free if not is_row(leader.hypothesis.terms[i].effect)]


def _unseen(problem: Problem, leader: Fit, found: Attribution, free: Sequence[int]) -> list[int]:
    """Terms of a simulator that owns its steps that no rollout shows, never all that there are."""
    own_step, sure = closed(problem.simulator) is not None, sure_terms(problem, leader, SURELY)
    hidden = [i for i in free if own_step and i not in sure and _hidden(found, i, problem.run.settings)]
    return hidden if len(hidden) < len(leader.hypothesis.terms) else hidden[:1]


def _hidden(found: Attribution, index: int, settings: Settings) -> bool:
    """Whether a slight term explains no more than a model's own step may do to a law that jumps."""
    return found.roles[index] == "slight" and found.importance[index].share < settings.closed_step.shows


def _mends(leader: Fit, found: Attribution, index: int, settings: Settings) -> bool:
    """Whether a term behind a gate matters no more than what the account leaves."""
    gated = bool(leader.hypothesis.terms[index].gate)
    left = 1.0 - found.share.share
    return gated and not matters(found.needed[index], left, settings.attribution)


def _stands_in(leader: Fit, found: Attribution, index: int) -> bool:
    """Whether a slight term, not of the usual machine, may stand for what nobody names: less, and not surely needed.

    Backlash in the steering of the open DART log is needed by a fifth of what is left there, and surely: it stays.
    """
    usual, needed = leader.hypothesis.terms[index].effect.usual > 0, found.needed[index]
    unsure = needed.low is None or needed.low <= 0.0
    return found.roles[index] == "slight" and not usual and unsure and needed.share < 1.0 - found.share.share


def _spare(found: Attribution, index: int, settings: Settings) -> bool:
    """Whether a term explains much and is hardly needed: others do the same, and share with it what is one's.

    Beside physics that nobody names two laws are nearer to it than one.
    """
    left = 1.0 - found.share.share
    much = found.importance[index].share >= settings.attribution.headline
    hardly = _most(found.needed[index]) < SPARE * left
    return much and hardly and not matters(found.needed[index], left, settings.attribution)


def _implausible(leader: Fit, index: int, settings: Settings) -> bool:
    return leader.hypothesis.times_beyond(index) >= settings.verdict.implausible


def _most(share: Share) -> float:
    """What it surely does not exceed: a rollout or two that went wrong must not decide; itself where nobody knows."""
    return share.share if share.high is None else share.high


def _doubtful(hypothesis: Hypothesis, found: Attribution, index: int) -> bool:
    return bool(hypothesis.terms[index].gate) or found.roles[index] == "slight"


def holds_in_halves(problem: Problem, leader: Fit, less: Fit, index: int) -> bool:
    """Whether both halves of the windows in which a term acts say the same of it. less: the fit without it."""
    acts = np.flatnonzero(_acts(problem, leader, less))
    if len(acts) < 2 * FEWEST_WINDOWS_OF_A_HALF:
        return True
    halves = [_half(problem, leader, less, index, rows) for rows in _halves(problem, acts)]
    if not all(better for _, _, better in halves):
        return False
    (one, first, _), (other, second, _) = halves
    apart = np.abs(one - other) / np.sqrt(np.maximum(first + second, TINY))
    return bool((apart < APART).all())


def _acts(problem: Problem, leader: Fit, less: Fit) -> BoolArray:
    """(W,) in which windows what is left differs much with the term and without it."""
    spread = np.sqrt(np.maximum(leader.variance, TINY))
    moved = ((leader.residuals - less.residuals) / spread)[..., problem.observed]
    size = (moved**2).sum(axis=(1, 2))
    return np.asarray(size > ACTS * size.max(initial=0.0))


def _halves(problem: Problem, acts: IntArray) -> tuple[IntArray, IntArray]:
    """The first and the second half in the order of episodes and time."""
    order = np.lexsort((problem.windows.t[acts, 0], problem.windows.episode[acts]))
    middle = len(acts) // 2
    return acts[order[:middle]], acts[order[middle:]]


def _half(
    problem: Problem, leader: Fit, less: Fit, index: int, rows: IntArray
) -> tuple[FloatArray, FloatArray, bool]:
    """The term's estimate there, its variance, and whether these windows are better explained with it.

    All other parameters stand as the whole recording says.
    """
    part = problem.on(problem.windows.take(rows))
    alone = _alone(leader.hypothesis, index)
    starts = leader.starts[rows]
    slopes = start_slopes(part, leader.hypothesis, starts)
    found = fit(part, alone, starts, iterations=schedules.REFIT, near=True, known=slopes)
    bare = fit(part, less.hypothesis.frozen(), less.starts[rows], iterations=schedules.SETTLE, known=slopes)
    better = bare.objective - found.objective > len(alone.parameters)  # Akaike (1974)
    return found.hypothesis.theta, curvature(part, found).variance, bool(better)


def _alone(hypothesis: Hypothesis, index: int) -> Hypothesis:
    """The same terms, of which that one alone is fitted."""
    declared = tuple(group if i == index else () for i, group in enumerate(hypothesis.declared))
    return replace(hypothesis, declared=declared)
