"""Onsets of terms that act all the time: before which moment each is better left out, from one linearisation.

After the tests for a structural change at an unknown moment, which look at all moments from one fit: Andrews (1993),
"Tests for parameter instability and structural change with unknown change point", Econometrica 61(4). Here what a
change promises is said in nats, start states and all parameters follow it, and the change is the one that a gate makes:
a term is switched off in all windows before the moment.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from gpsim.channels import FloatArray, IntArray
from gpsim.diagnosis.fitting import (
    Candidate,
    Fit,
    Order,
    Problem,
    fit_all,
    jacobians,
    projected,
)
from gpsim.diagnosis.selection.gate_edges import placed
from gpsim.diagnosis.selection.gates import COARSE_SPACING, NEAR_REACH, TRIAL_BUDGET
from gpsim.diagnosis.settings import schedules
from gpsim.effects import Gate

TRIMMED = 0.1
"""Share of the windows, at either end, in which nothing is said to begin (by hand; Andrews (1993) recommends
0.15)."""
LEAST_GAIN_OF_AN_ONSET = 10.0
"""Gain that an onset must promise [nats] (by hand: it is the best of many moments, so more than a term needs)."""
ONSETS_FITTED = 2  # onsets that are fitted, those that promise most
ALIKE_ONSETS = 0.5  # share of the best onset's gain that another must promise, to be fitted

RIDGE = 1e-9  # of a parameter's own information, so that what the windows leave open can be solved for, too


@dataclass(frozen=True)
class Onset:
    """A term behind an onset: the gain [nats] that promises, and all parameters (P,) then."""

    gain: float
    index: int
    gate: Gate
    theta: FloatArray


def begun_later(problem: Problem, leader: Fit, offers: Sequence[Candidate]) -> list[Fit]:
    """The leader with terms that act all the time each behind an onset, where that promises most.

    Terms that no gate may limit are left alone.
    """
    gateable = {c.identity for c in offers if c.gateable and not c.only_gated}
    terms = enumerate(leader.hypothesis.terms)
    open_ones = [i for i, t in terms if not t.gate and not t.variant and t.identity in gateable]
    found = [o for o in onsets(problem, leader, open_ones) if o.gain > LEAST_GAIN_OF_AN_ONSET]
    most = max((o.gain for o in found), default=0.0)
    alike = [o for o in found if o.gain > ALIKE_ONSETS * most]
    best = sorted(alike, key=lambda o: -o.gain)[:ONSETS_FITTED]
    children = [leader.hypothesis.having(o.theta).gated(o.index, o.gate) for o in best]
    fits = fit_all(
        problem, [Order(child, leader.starts, schedules.SETTLE, schedules.ROUGH) for child in children]
    )
    how = (NEAR_REACH, COARSE_SPACING, TRIAL_BUDGET)
    calls = [(problem, f, o.index, *how) for f, o in zip(fits, best, strict=True)]
    return problem.run.side_by_side(placed, calls)


def onsets(problem: Problem, at: Fit, terms: Sequence[int]) -> list[Onset]:
    """When each of these terms best begins, at a moment or, of clocks that begin anew, with an episode.

    None where there are too few windows to say.
    """
    windows = problem.windows
    clocks: list[FloatArray | IntArray] = [windows.t[:, 0]]
    clocks += [windows.episode] if windows.own_clocks else []
    trimmed = TRIMMED
    orders = [_ordered(clock, trimmed) for clock in clocks]
    if not terms or not any(moments for _, moments in orders):
        return []
    hypothesis, theta = at.hypothesis, at.hypothesis.theta
    by_state, by_theta = jacobians(problem, hypothesis, theta, at.starts, at.residuals)
    low, high = np.array([(p.low, p.high) for p in hypothesis.parameters], dtype=float).reshape(-1, 2).T
    found = []
    for index in terms:
        off = _switched_off(problem, at, index) - at.residuals
        columns = np.concatenate([by_theta, off[..., None]], axis=-1)
        informations, gradients = projected(
            problem, at.residuals, by_state, columns, at.variance, np.zeros(len(windows))
        )
        first = sum(len(group) for group in hypothesis.declared[:index])
        own = np.arange(first, first + len(hypothesis.declared[index]))
        for clock, (order, moments) in zip(clocks, orders, strict=True):
            if not moments:
                continue
            gains, steps = _switches(informations[order], gradients[order], moments, own)
            best = int(np.argmax(gains))
            first_one = clock[order[moments[best]]]
            gate = (
                Gate(since_episode=int(first_one))
                if clock is windows.episode
                else Gate(since=float(first_one))
            )
            found.append(Onset(float(gains[best]), index, gate, np.clip(theta + steps[best], low, high)))
    return found


def _ordered(clock: FloatArray | IntArray, trimmed: float) -> tuple[IntArray, list[int]]:
    """The windows in the order of a clock (W,), and the places in it where something may begin.

    trimmed: the share of the windows at either end in which nothing may.
    """
    order = np.argsort(clock, kind="stable")
    count, ticks = len(order), clock[order]
    inner = range(max(1, int(trimmed * count)), count - int(trimmed * count))
    return order, [k for k in inner if ticks[k] > ticks[k - 1]]


def _switched_off(problem: Problem, at: Fit, index: int) -> FloatArray:
    """(W, L + 1, S): the residual without a term, all else as it is, on as fine a grid."""
    without = at.hypothesis.without(index)
    grid = problem.as_finely(without, at.hypothesis)
    return np.asarray(grid.residuals(without, without.theta[None], at.starts[None])[0])


def _switches(
    informations: FloatArray, gradients: FloatArray, moments: Sequence[int], own: IntArray
) -> tuple[FloatArray, FloatArray]:
    """(M,) nats that switching off in all windows before each moment promises, (M, P) how theta follows.

    informations (W, P + 1, P + 1), gradients (W, P + 1): the switch is the last of the parameters; in order of time.
    own: the places in theta of the term's parameters, which move nothing where it is off.
    """
    last, size = np.asarray(moments) - 1, gradients.shape[1] - 1
    acts = np.ones(size + 1)
    acts[own] = 0.0
    before = np.cumsum(informations * np.outer(acts, acts), axis=0)[last]
    pull = np.cumsum(gradients * acts, axis=0)[last]
    all_of, rest = informations.sum(axis=0)[:size, :size], gradients.sum(axis=0)[:size]
    past, passed = np.cumsum(informations, axis=0)[last], np.cumsum(gradients, axis=0)[last]
    scale = np.sqrt(np.maximum(np.diag(all_of), 1e-300))
    whole = all_of - past[:, :size, :size] + before[:, :size, :size]
    left = rest - passed[:, :size] + pull[:, :size] - before[:, :size, size]
    steps = _solved(whole, left, scale)
    gains = pull[:, size] - 0.5 * before[:, size, size] + 0.5 * np.einsum("mp,mp->m", left, steps)
    before_it = 0.5 * float(rest @ _solved(all_of[None], rest[None], scale)[0])
    return np.asarray(gains - before_it), steps


def _solved(matrices: FloatArray, sides: FloatArray, scale: FloatArray) -> FloatArray:
    """(M, P) solutions of (M, P, P) systems of parameters in whatever units."""
    scaled = matrices / np.outer(scale, scale) + RIDGE * np.eye(len(scale))
    return np.asarray(np.linalg.solve(scaled, (sides / scale)[..., None])[..., 0] / scale)
