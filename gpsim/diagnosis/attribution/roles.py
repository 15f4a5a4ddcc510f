"""Roles: which effects are claims, and which are slight corrections beside them."""

from __future__ import annotations

import numpy as np

from gpsim.channels import FloatArray
from gpsim.diagnosis.attribution.shares import LOW, TINY, Mismatch
from gpsim.diagnosis.fitting import Fit, Problem, correlation_time, is_row, quadratic
from gpsim.diagnosis.report import Role, Share
from gpsim.diagnosis.selection import whole_robot
from gpsim.diagnosis.settings import AttributionSettings

NEEDED_OF_LEFT = 5.0
"""Or times what the account leaves, if that is less: with clean sensors little is left (by hand, on 48 rough worlds
of seeds 31 and 51, and EMPS, whose offset is needed by six times what is left)."""
SELDOM = 5
"""Blocks in which an effect decides that is a headline for that: a limit that is seldom reached, say."""
DECIDES = 4.0  # times the squares with it, or those of noise: so large are they without it where it decides
SURE_ROW = 30.0
"""Nats, of residuals that neighbours do not share, by which friction or a rotor of a robot's joint is a headline (by
reason: as many as a term of a large account must cost to be needed for sure, halved, since a row is expected)."""


def role_of(
    importance: Share,
    needed: Share,
    left: float,
    decided: int,
    grows: float,
    settings: AttributionSettings,
) -> Role:
    """A headline is important and needed, or needed and decides in some blocks, however little that is of the whole.

    So is one without which some channel's error surely doubles: where the base simulator is far off in one channel,
    shares of the whole say nothing of the others.

    left: share of the mismatch that the account leaves. What matters less than that may stand in for some of it: real
    physics that nobody names is mended by the next best law. Of a large part of the mismatch it is enough to be needed
    by as much as is left: on a whole machine the other effects make good for much of one that goes. decided: in how
    many blocks it decides; grows: see `growth`.
    """
    if grows >= DECIDES and decided >= SELDOM:
        return "headline"
    surely = needed.share if needed.low is None else needed.low
    large = importance.share >= settings.large and needed.share >= left
    if surely <= 0.0 or not (large or matters(needed, left, settings)):
        return "slight"
    beyond_what_is_left = needed.share >= NEEDED_OF_LEFT * left
    decides = decided >= SELDOM and beyond_what_is_left
    return "headline" if decides or importance.share >= settings.headline else "slight"


def sure_rows(problem: Problem, leader: Fit) -> frozenset[int]:
    """Terms that are friction, a rotor or an offset of a whole robot's joint and that no other term makes good for.

    Rollouts of a bare robot end so far off that viscous friction of a light wrist is no part of that which counts; the
    windows, in which all of them are fitted together, know it well.
    """
    rows = [is_row(t.effect) for t in leader.hypothesis.terms]
    return frozenset(i for i in sure_terms(problem, leader, SURE_ROW) if rows[i])


def sure_terms(problem: Problem, leader: Fit, nats: float) -> frozenset[int]:
    """Smooth terms of a whole robot that windows need by so much, of residuals that neighbours do not share."""
    if not whole_robot(problem, leader.hypothesis):
        return frozenset()
    tau, around = 1.0, quadratic(problem, leader)
    if leader.covariance is None:  # else blocks of rows have said already how much they share
        tau = float(np.maximum(correlation_time(problem, leader.residuals)[problem.observed], 1.0).max())
    sure = np.flatnonzero((around.costs() > nats * tau) & np.array(around.smooth))
    return frozenset(int(i) for i in sure)


def matters(needed: Share, left: float, settings: AttributionSettings) -> bool:
    """Whether an effect is needed by a good part of the mismatch, or by more than what is left of it."""
    return needed.share >= min(settings.needed, NEEDED_OF_LEFT * left)


def deciding(mismatch: Mismatch, squares: FloatArray, without: FloatArray) -> int:
    """In how many blocks an effect decides: without it (B, S) far more is left than with it, and than noise makes."""
    usual = np.maximum(squares, mismatch.floor)
    clearly = without > DECIDES * usual
    return int((clearly & mismatch.counts & (without > 0)).any(axis=1).sum())


def growth(mismatch: Mismatch, squares: FloatArray, without: FloatArray) -> float:
    """By how much, surely, the squared error of some channel grows without an effect: the largest of the channels.

    squares, without: (B, S) what is left with and without it, by block; noise counts as left in both.
    """
    left, less, floor = (mismatch.sums(s) for s in (squares, without, mismatch.floor))
    ratio = np.maximum(less, floor) / np.maximum(np.maximum(left, floor), TINY)
    sure = np.quantile(ratio[1:], LOW, axis=0)
    return float(np.max(sure[mismatch.counts], initial=0.0))
