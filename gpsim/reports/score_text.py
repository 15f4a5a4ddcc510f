"""A score as a short table: before, after and with a Gaussian process, by rate and by channel."""

from __future__ import annotations

import math
from collections.abc import Sequence

from gpsim.diagnosis.report import Score, Scored

HEAD = ("", "unit", "base", "+ effects", "+ GP", "of the base's (90 %)")


def score_lines(score: Score) -> list[str]:
    """The table, a line each, and what it does not say by itself."""
    rows = [_row(f"{name}, one step", errors) for name, errors in score.one_step.items()]
    rows += [_row(f"{name}, after {score.horizon_s:.3g} s", errors) for name, errors in score.rollout.items()]
    said = [
        f"{score.transitions} transitions; errors of {score.steps} single steps and {score.rollouts} rollouts:"
    ]
    said += _table([HEAD, *rows])
    worth = None if score.explained is None else score.explained.rollout
    if worth is not None:
        low, high = worth.low, worth.high
        between = "" if low is None or high is None else f" ({100 * low:.0f} to {100 * high:.0f})"
        said.append(f"the effects explain {100 * worth.share:.0f} %{between} of the mismatch here")
    if score.thinned > 1:
        said.append(f"one of {score.thinned} samples was read, commands averaged between")
    if score.without_gp:
        said.append(f"no Gaussian process: {score.without_gp}")
    return said


def errors_lines(rows: Sequence[tuple[str, str, float, float]], steps: int, rollouts: int) -> list[str]:
    """A table of (what, unit, error of the base, error of the corrected), a line each."""
    told = [(name, unit, _number(base, 3), _number(after, 3)) for name, unit, base, after in rows]
    return [
        f"errors of {steps} single steps and {rollouts} rollouts:",
        *_table([("", "unit", "base", "corrected"), *told]),
    ]


def _row(name: str, errors: Scored) -> tuple[str, ...]:
    over = errors.over_before
    share = "diverged" if over.value is None else f"{100 * over.value:.3g} %"
    if over.low is not None and over.high is not None:
        share += f" ({100 * over.low:.3g} to {100 * over.high:.3g})"
    gp = "-" if errors.after_gp is None else _number(errors.after_gp, 3)
    return name, errors.unit, _number(errors.before, 3), _number(errors.after, 3), gp, share


def _number(value: float, digits: int) -> str:
    return f"{value:.{digits}g}" if math.isfinite(value) else "diverged"


def _table(rows: Sequence[Sequence[str]]) -> list[str]:
    widths = [max(len(row[i]) for row in rows) for i in range(len(rows[0]))]
    return ["  ".join(map(_aligned, row, widths, range(len(row)))).rstrip() for row in rows]


def _aligned(cell: str, width: int, column: int) -> str:
    """Names and units to the left, numbers to the right."""
    return cell.ljust(width) if column < NAMED else cell.rjust(width)


NAMED = 2  # columns of words
