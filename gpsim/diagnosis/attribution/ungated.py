"""The account with one gate less: a region or an onset must matter as an effect must."""

from __future__ import annotations

from collections.abc import Sequence

from gpsim.diagnosis.attribution.attribution import Attribution
from gpsim.diagnosis.attribution.roles import matters
from gpsim.diagnosis.fitting import Fit, Hypothesis, Problem, fit
from gpsim.diagnosis.settings import schedules
from gpsim.effects import Gate


def ungated(problem: Problem, leader: Fit, found: Attribution) -> Fit | None:
    """The account without the gate that matters least, all fitted anew; None where every gate matters.

    Beside physics that nobody names a region is easily found that mends some of it.
    """
    which = _gates(leader.hypothesis)
    fits: Sequence[Fit] = problem.run.side_by_side(_open, [(problem, leader, i) for i in which])
    if not fits:
        return None
    judge, settings = found.judge, problem.run.settings.attribution
    whole, *others = judge.squares([[leader.hypothesis], *([f.hypothesis] for f in fits)])
    overall = judge.mismatch.overall
    lost = [judge.mismatch.share(overall(whole) - overall(other)) for other in others]
    least = min(range(len(fits)), key=lambda i: lost[i].share)
    return None if matters(lost[least], 1.0 - found.share.share, settings) else fits[least]


def _gates(hypothesis: Hypothesis) -> list[int]:
    """Terms behind a gate that would make sense, and be no second of their kind, without it."""
    terms = hypothesis.terms
    everywhere = {(t.family, t.on) for t in terms if not t.gate}
    gated = [i for i, t in enumerate(terms) if t.gate and not t.effect.needs_region]
    return [i for i in gated if (terms[i].family, terms[i].on) not in everywhere]


def _open(problem: Problem, leader: Fit, index: int) -> Fit:
    bare = leader.hypothesis.gated(index, Gate())
    grid = problem.as_finely(bare, leader.hypothesis)
    return fit(grid, bare, leader.starts, iterations=schedules.REFIT, tolerance=schedules.EDGE, near=True)
