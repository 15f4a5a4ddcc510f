"""The trace of a diagnosis in words: what was looked at, what was taken, by which rule and by how much."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from gpsim.diagnosis.run import Decision
from gpsim.reports.sheets import MISSING

RULE = 29  # columns that a rule's name is given


def trace_lines(decisions: Sequence[Decision]) -> list[str]:
    """A line a decision below the step that made it, in order; what was decided again alike is left out."""
    return list(_lines(decisions))


def _lines(decisions: Sequence[Decision]) -> Iterator[str]:
    step = ""
    told: set[str] = set()
    for decision in decisions:
        if decision.step != step:
            step, told = decision.step, set()
            yield f"{step}"
        line = _line(decision)
        if line not in told:
            told.add(line)
            yield line


def _line(decision: Decision) -> str:
    verb = "taken  " if decision.taken else "refused"
    numbers = f"{_number(decision.gain, '.1f'):>9} nats {_share(decision.share):>7}"
    return f"  {verb} {numbers}  {decision.rule:<{RULE}} {difference(decision.candidate, decision.over)}"


def difference(candidate: Sequence[str], over: Sequence[str]) -> str:
    """What the candidate has more and less than what it is compared with, and what both have."""
    more = [f"+ {term}" for term in candidate if term not in over]
    less = [f"- {term}" for term in over if term not in candidate]
    both = [term for term in candidate if term in over]
    changed = " ".join([*more, *less]) or "the same terms"
    return f"{changed} (beside {', '.join(both)})" if both else changed


def _number(value: float | None, form: str) -> str:
    return MISSING if value is None else format(value, form)


def _share(share: float | None) -> str:
    return MISSING if share is None else f"{100 * share:.3g} %"
