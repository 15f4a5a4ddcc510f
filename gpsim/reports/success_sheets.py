"""The sheets of a task with a goal: who gets there, in how many steps, over how many metres."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from gpsim.reports.loop_report import LoopReport
from gpsim.reports.sheets import Cell, Sheet, fixed, known, percent, row, whole_percent


def success_sheets(report: LoopReport) -> list[Sheet]:
    """A sheet for every set of starts; equal sets are shown once."""
    if report.trips is None:
        return []
    shown: dict[bytes, str] = {}
    for key in report.start_sets:
        shown.setdefault(report.starts[key].tobytes(), key)
    return [_sheet(report, key) for key in shown.values()]


def stats(report: LoopReport, starts: str, policy: str) -> Mapping[str, Any]:
    """The summary of a policy's trips on a set of starts, keyed as returns are; empty where there is none."""
    found = (report.summary.get(starts.replace("returns", "success")) or {}).get(policy)
    return found or {}


def _sheet(report: LoopReport, starts: str) -> Sheet:
    several = len(report.seeds) > 1
    columns = [
        "Policy",
        "Reached",
        "facing away",
        "facing the goal",
        "Steps",
        "of Target's",
        "Metres",
        "of Target's",
    ]
    columns += [f"Seed {seed}" for seed in report.seeds] if several else []
    rows = []
    for policy in report.policies:
        found = stats(report, starts, policy)
        target = found.get("of_target") or {}
        cells: list[Cell | str] = [
            Cell(policy, name=policy),
            Cell(whole_percent(found.get("rate")), below=_span(found.get("interval"))),
            whole_percent(found.get("behind")),
            whole_percent(found.get("ahead")),
            fixed(found.get("steps")),
            fixed(target.get("steps"), 3),
            fixed(found.get("path"), 2),
            fixed(target.get("path"), 3),
        ]
        cells += [whole_percent(rate) for rate in found.get("by_seed") or []] if several else []
        rows.append(row(*cells))
    return Sheet(
        _title(report, starts),
        tuple(columns),
        tuple(rows),
        note="Steps and metres: means over the trips that reached the goal; of Target's: on the trips that the Target "
        "policy of the same seed completed too.",
        tail=len(report.seeds) if several else 0,
    )


def _span(interval: Any) -> str:
    if not interval or not all(known(value) for value in interval):
        return ""
    return f"{percent(interval[0], 3)} to {percent(interval[1], 3)}"


def _title(report: LoopReport, starts: str) -> str:
    share = (report.summary.get("share") or {}).get(starts)
    same = [key for key in report.start_sets if (report.starts[key] == report.starts[starts]).all()]
    words = "all starts" if "returns_all" in same else report.set_words[starts]
    return f"Goals reached on the target, {words} ({whole_percent(share)} of {len(report.starts[starts])})"
