"""The account with one law plainer: a gate, or what a law says beyond its special case, must matter as an effect must.

Beside physics that nobody names a region is easily found that mends some of it, and a law with one more parameter is
nearer to it than its special case: Stribeck friction that falls over twice the usual speed stands for dry friction and
something else.
"""

from __future__ import annotations

from collections.abc import Sequence

from gpsim.diagnosis.attribution.attribution import Attribution
from gpsim.diagnosis.attribution.roles import matters
from gpsim.diagnosis.fitting import Candidate, Fit, Hypothesis, Order, Problem, fit, fit_all
from gpsim.diagnosis.selection import plain_forms
from gpsim.diagnosis.settings import schedules
from gpsim.effects import Gate


def plainer(problem: Problem, leader: Fit, found: Attribution, offers: Sequence[Candidate]) -> Fit | None:
    """The account in which what matters least is plainer, all fitted anew; None where all of it matters.

    offers: the laws that may stand in the place of those of which they are special cases.
    """
    which = _gates(leader.hypothesis)
    fits: list[Fit] = list(problem.run.side_by_side(_open, [(problem, leader, i) for i in which]))
    forms = plain_forms(leader.hypothesis, offers)
    fits += fit_all(problem, [Order(f, leader.starts, schedules.REFIT, schedules.ROUGH) for f in forms])
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
