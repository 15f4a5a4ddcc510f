"""The sheets of the returns: one per set of starts, with the thesis's figures."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from gpsim.reports import thesis
from gpsim.reports.loop_report import START_SETS, LoopReport
from gpsim.reports.sheets import Cell, Sheet, fixed, known, plus_minus, row, span, whole_percent

SHORT_OF_TARGET = 0.9
"""A seed is marked when its mean is below this share of what Target earns on the same starts over all seeds."""

EXPECTED_TO_SUCCEED = ("GP-Mean", "GP-Sample", "Effects", "Target")


def return_sheets(report: LoopReport) -> list[Sheet]:
    """A sheet for every set of starts that the summary holds."""
    return [_sheet(report, key) for key in START_SETS if report.summary.get(key)]


def reference(report: LoopReport, starts: str) -> float:
    """What there is to reach on a set of starts: Target's mean, or all there is when Target is missing."""
    mean = report.stats(starts, "Target").get("mean")
    return float(mean) if known(mean) else report.best_return


def failing(report: LoopReport, starts: str) -> dict[str, list[tuple[int, float]]]:
    """Policy to (seed, mean) of its seeds that fall short, of the policies that are expected to succeed.

    They are measured against all there is, not against Target, so that a failing Target is named too.
    """
    found = {}
    for policy in (name for name in report.policies if name in EXPECTED_TO_SUCCEED):
        means = report.stats(starts, policy).get("by_seed") or []
        low = [
            (seed, float(mean))
            for seed, mean in zip(report.seeds, means, strict=False)
            if known(mean) and mean < SHORT_OF_TARGET * report.best_return
        ]
        if low:
            found[policy] = low
    return found


def _sheet(report: LoopReport, starts: str) -> Sheet:
    several = len(report.seeds) > 1
    compare = starts != "returns_all"  # the thesis leaves starts that cannot be solved out
    full = bool(report.returns)
    columns = ["Policy"]
    columns += ["Thesis"] if compare else []
    columns += ["Mean ± std", "95 % interval", "IQM", "IQM's 95 % interval"]
    columns += ["Full episodes"] if full else []
    columns += [f"Seed {seed}" for seed in report.seeds] if several else []
    rows = []
    for policy in report.policies:
        stats = report.stats(starts, policy)
        cells: list[Cell | str] = [Cell(policy, name=policy)]
        cells += [_thesis(policy)] if compare else []
        cells += [
            plus_minus(stats.get("mean"), stats.get("std")),
            span(stats.get("interval")),
            fixed(stats.get("iqm")),
            span(stats.get("iqm_interval")),
        ]
        cells += [whole_percent(report.full_share(starts, policy)) if stats.get("episodes") else "–"] if full else []
        cells += _by_seed(report, starts, stats) if several else []
        rows.append(row(*cells))
    return Sheet(_title(report, starts), tuple(columns), tuple(rows), note=_note(report, starts))


def _thesis(policy: str) -> str:
    figure = thesis.RETURNS.get(policy)
    return f"{figure.mean} ± {figure.std}" if figure else "–"


def _by_seed(report: LoopReport, starts: str, stats: Mapping[str, Any]) -> list[Cell | str]:
    means = list(stats.get("by_seed") or [])
    means += [None] * (len(report.seeds) - len(means))
    short = SHORT_OF_TARGET * reference(report, starts)
    return [Cell(fixed(mean), marked=known(mean) and mean < short) for mean in means[: len(report.seeds)]]


def _title(report: LoopReport, starts: str) -> str:
    share = (report.summary.get("share") or {}).get(starts)
    count = len(report.starts[starts]) if starts in report.starts else None
    words = START_SETS[starts]
    if starts == "returns_all":
        return f"Return on the target, {words}" + (f" ({count})" if count else "")
    of = f" of {count}" if count else ""
    return f"Return on the target, {words}" + (f" ({whole_percent(share)}{of})" if known(share) else "")


def _note(report: LoopReport, starts: str) -> str:
    if starts not in report.start_sets:
        return "No start belongs to this set."
    notes = []
    if len(report.seeds) > 1:
        notes.append(f"Marked: seeds below {SHORT_OF_TARGET:.0%} of Target's mean.".replace("%", " %"))
    for policy, seeds in failing(report, starts).items():
        listed = ", ".join(f"{seed} ({fixed(mean)})" for seed, mean in seeds)
        words = "seed" if len(seeds) == 1 else "seeds"
        notes.append(f"{policy} falls short with {words} {listed}.")
    return " ".join(notes)
