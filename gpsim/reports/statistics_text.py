"""What only a statistician asks, in lines: every decision of the search, and the errors of a score."""

from __future__ import annotations

from collections.abc import Sequence

from gpsim.diagnosis.run import Decision
from gpsim.findings import Score
from gpsim.reports.quantities import number
from gpsim.reports.sheets import MISSING

RULE = 29  # columns that a rule's name is given
SCORES = ("", "unit", "base", "+ effects", "+ GP", "of the base's (90 %)")


def trace_lines(decisions: Sequence[Decision]) -> list[str]:
    """A line a decision below the step that made it, in order; what was decided again alike is left out."""
    step, told, lines = "", set[str](), list[str]()
    for d in decisions:
        if d.step != step:
            step, told = d.step, set()
            lines.append(step)
        gain = MISSING if d.gain is None else f"{d.gain:.1f}"
        share = MISSING if d.share is None else f"{100 * d.share:.3g} %"
        line = f"  {'taken  ' if d.taken else 'refused'} {gain:>9} nats {share:>7}  {d.rule:<{RULE}} "
        line += difference(d.candidate, d.over)
        if line not in told:
            told.add(line)
            lines.append(line)
    return lines


def difference(candidate: Sequence[str], over: Sequence[str]) -> str:
    """What the candidate has more and less than what it is compared with, and what both have."""
    more = [f"+ {term}" for term in candidate if term not in over]
    less = [f"- {term}" for term in over if term not in candidate]
    both = [term for term in candidate if term in over]
    changed = " ".join([*more, *less]) or "the same terms"
    return f"{changed} (beside {', '.join(both)})" if both else changed


def score_lines(score: Score) -> list[str]:
    """The table, a line each, and what it does not say by itself."""
    named = [(f"{name}, one step", errors) for name, errors in score.one_step.items()]
    named += [(f"{name}, after {score.horizon_s:.3g} s", errors) for name, errors in score.rollout.items()]
    rows = [SCORES]
    for name, errors in named:
        over, gp = errors.over_before, "-" if errors.after_gp is None else number(errors.after_gp)
        share = "diverged" if over.value is None else f"{100 * over.value:.3g} %"
        if over.low is not None and over.high is not None:
            share += f" ({100 * over.low:.3g} to {100 * over.high:.3g})"
        rows.append((name, errors.unit, number(errors.before), number(errors.after), gp, share))
    said = [
        f"{score.transitions} transitions; errors of {score.steps} single steps and {score.rollouts} rollouts:",
        *_table(rows),
    ]
    worth = None if score.explained is None else score.explained.rollout
    if worth is not None:
        low, high = worth.low, worth.high
        between = "" if low is None or high is None else f" ({100 * low:.0f} to {100 * high:.0f})"
        said.append(f"the effects explain {100 * worth.share:.0f} %{between} of the mismatch here")
    if score.thinned > 1:
        said.append(f"one of {score.thinned} samples was used, with averaged commands")
    if score.without_gp:
        said.append(f"no Gaussian process: {score.without_gp}")
    return said


def errors_lines(rows: Sequence[tuple[str, str, float, float]], steps: int, rollouts: int) -> list[str]:
    """A table of (what, unit, error of the base, error of the corrected), a line each."""
    told = [(name, unit, number(base), number(after)) for name, unit, base, after in rows]
    head = f"errors of {steps} single steps and {rollouts} rollouts:"
    return [head, *_table([("", "unit", "base", "corrected"), *told])]


def _table(rows: Sequence[Sequence[str]]) -> list[str]:
    """Names and units to the left, numbers to the right."""
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    return [
        "  ".join(f"{cell:{'<' if i < 2 else '>'}{widths[i]}}" for i, cell in enumerate(cells)).rstrip()
        for cells in rows
    ]
