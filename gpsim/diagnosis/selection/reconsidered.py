"""The leader beside all that machines usually have, taken away again: what moves of one term do not reach.

What a search found first stands in for what it had not found yet: a limit that is always met for a gain, two terms for
a mass. Each of them is needed while the other stands, and no exchange of one term pays. With all of the usual machine
beside it, backward elimination lets go of any number of terms while others come in.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from gpsim.diagnosis.fitting import (
    Candidate,
    Fit,
    Hypothesis,
    Order,
    Problem,
    child_of,
    fit_all,
    fit_order,
    scores,
)
from gpsim.diagnosis.selection.elimination import on_some_windows
from gpsim.diagnosis.selection.usual import is_usual, taken_away
from gpsim.diagnosis.settings import schedules
from gpsim.effects import EffectParameter, closed

LOOKED_AT = 72  # windows, of the usual length, on which terms are taken away, as in the first search
KEPT = 2  # accounts of those paths that are fitted on all windows


def reconsidered(problem: Problem, leader: Fit, offers: Sequence[Candidate]) -> list[Fit]:
    """The best accounts that are left of the leader and the usual machine, other than itself, on all windows.

    Also of the leader without its limits, of which the quadratic cannot say that a gain makes up for them. None of an
    account that says nothing, and where every step is dear.
    """
    taken = leader.hypothesis.claims
    usual = [c for c in offers if is_usual(problem, c) and not _jumps(c.declared)]
    if not taken or taken >= {c.identity for c in usual} or closed(problem.simulator) is not None:
        return []
    part, seen = on_some_windows(problem, leader, LOOKED_AT)
    part = replace(part, dry_steps={})
    found = [f for start in _starts(seen.hypothesis) for f in _taken_away(part, seen, start, usual)]
    others = [f for f in found if not f.hypothesis.says_the_same_as(leader.hypothesis)]
    order = np.argsort(-scores(part, others)) if others else ()
    chosen = list[Hypothesis]()
    for i in order:
        hypothesis = others[int(i)].hypothesis
        if len(chosen) < KEPT and not any(hypothesis.says_the_same_as(other) for other in chosen):
            chosen.append(hypothesis)
    for hypothesis in chosen:
        problem.run.trace.note(
            hypothesis.names, leader.hypothesis.names, True, "what is left with all that is usual"
        )
    return fit_all(problem, [Order(h, leader.starts, schedules.REFIT, schedules.ROUGH) for h in chosen])


def _starts(hypothesis: Hypothesis) -> list[Hypothesis]:
    """The account; without its limits and jumps; and without its ratios, too: all that moves together may scale."""
    limits = {i for i, group in enumerate(hypothesis.declared) if _jumps(group)}
    ratios = {i for i, group in enumerate(hypothesis.declared) if any(p.none == 1.0 for p in group)}
    ways = dict.fromkeys(frozenset(gone) for gone in (set[int](), limits, limits | ratios))
    return [hypothesis.without_all(gone) for gone in ways]


def _jumps(declared: Sequence[EffectParameter]) -> bool:
    return any(p.falls or p.step is not None for p in declared)


def _taken_away(part: Problem, seen: Fit, whole: Hypothesis, usual: Sequence[Candidate]) -> list[Fit]:
    """All of it fitted at once, and what is left as terms are taken away."""
    for c in (c for c in usual if c.identity not in whole.claims):
        whole = child_of(whole, c, tuple(max(p.none, p.low) for p in c.declared))
    full = fit_order(part, Order(whole, seen.starts, schedules.REFIT, schedules.ROUGH, near=True))
    return taken_away(part, full)
