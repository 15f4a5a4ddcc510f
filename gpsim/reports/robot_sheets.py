"""A proof's tables of its robots: figures by robot and by other strata, single effects by family."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

from gpsim.reports.sheets import MISSING, Sheet, fixed, row

Json = Mapping[str, Any]
COLUMNS = (
    "", "worlds", "one: right", "95 %", "two: both right", "95 %", "false alarms", "95 %", "parameter error %",
    "coverage %", "95 %", "failed", "seconds",
)  # fmt: skip


def robot_sheets(content: Json) -> list[Sheet]:
    """None where no robot's world was revealed."""
    robots = content.get("mjcf")
    if not robots:
        return []
    note = "the simulator is a MuJoCo model; truth by its accelerations, at a quarter of its step, by another scheme"
    sheets = [replace(_figures("Robots", {"all": robots}), note=note)]
    sheets += [_figures(f"Robots by {name}", blocks) for name, blocks in robots["strata"].items()]
    return [*sheets, _families(robots)]


def _figures(title: str, blocks: Mapping[str, Json]) -> Sheet:
    rows = [
        row(
            name,
            str(b["n"]),
            *_counted(b["singles_right"], b["singles"], b["interval_single_right"]),
            *_counted(b["pairs_right"], b["pairs"], b["interval_pair_right"]),
            *_counted(b["alarms"], b["nulls"], b["interval_false_alarms"]),
            _percent(b["median_relative_error"], 2),
            _percent(b["coverage_90"]),
            _bounds(b["interval_coverage_90"]),
            str(b["failed"]),
            fixed((b["seconds"] or {}).get("median")),
        )
        for name, b in blocks.items()
    ]
    return Sheet(title, COLUMNS, tuple(rows))


def _families(robots: Json) -> Sheet:
    rows = [row(name, f"{f['right']}/{f['n']}") for name, f in robots["families"].items()]
    return Sheet("Robots: single effects by family", ("", "right"), tuple(rows))


def _counted(count: int, of: int, bounds: Sequence[float] | None) -> tuple[str, str]:
    return (f"{count}/{of}", _bounds(bounds)) if of else (MISSING, MISSING)


def _percent(share: float | None, digits: int = 1) -> str:
    return MISSING if share is None else fixed(100 * share, digits)


def _bounds(bounds: Sequence[float] | None) -> str:
    return MISSING if bounds is None else "-".join(fixed(100 * edge) for edge in bounds)
