"""A proof's tables of its rough worlds: figures, strata, what was said where what was called for, families."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

from gpsim.reports.sheets import MISSING, Cell, Sheet, fixed, row

Json = Mapping[str, Any]
COLUMNS = (
    "", "worlds", "main effects found %", "95 %", "verdict right %", "95 %", "spurious a world", "95 %", "coverage %",
    "95 %", "failed", "seconds",
)  # fmt: skip
VERDICTS = ("named", "ambiguous", "partial", "unknown", "none", "failed")


def rough_sheets(content: Json) -> list[Sheet]:
    """None where no rough world was revealed."""
    rough = content.get("rough")
    if not rough:
        return []
    note = "main effects of the catalogue among nuisances outside it, in logs as they are; headline effects count"
    sheets = [replace(_figures("Rough worlds", {"all": rough}), note=note)]
    sheets += [_figures(f"Rough worlds by {name}", blocks) for name, blocks in rough["strata"].items()]
    return [*sheets, verdicts_sheet("Rough worlds", rough["verdicts"]), _families(rough)]


def _figures(title: str, blocks: Mapping[str, Json]) -> Sheet:
    rows = [
        row(
            name,
            str(b["n"]),
            percent(b["headline_found"]),
            bounds(b["interval_headline_found"]),
            percent(b["verdict_right"]),
            bounds(b["interval_verdict_right"]),
            fixed(b["spurious"], 2),
            bounds(b["interval_spurious"], 1.0, 2),
            percent(b["coverage_90"]),
            bounds(b["interval_coverage_90"]),
            str(b["failed"]),
            fixed((b["seconds"] or {}).get("median")),
        )
        for name, b in blocks.items()
    ]
    return Sheet(title, COLUMNS, tuple(rows))


def verdicts_sheet(title: str, verdicts: Mapping[str, Json]) -> Sheet:
    """What was said (columns) where what was called for (rows)."""
    rows = [
        row(
            wanted,
            *(
                Cell(str(said.get(v, "")), marked=bool(said.get(v)) and v not in wanted.split(" or "))
                for v in VERDICTS
            ),
        )
        for wanted, said in verdicts.items()
    ]
    return Sheet(f"{title}: verdict called for (rows) and said (columns)", ("", *VERDICTS), tuple(rows))


def _families(rough: Json) -> Sheet:
    rows = [row(name, f"{f['found']}/{f['n']}") for name, f in rough["families"].items()]
    return Sheet("Rough worlds: main effects found by family", ("", "found"), tuple(rows))


def percent(share: float | None) -> str:
    """A share in percent."""
    return MISSING if share is None else fixed(100 * share)


def bounds(bounds: Sequence[float] | None, times: float = 100.0, digits: int = 1) -> str:
    """An interval, in percent unless other `times` are asked for."""
    return MISSING if bounds is None else "-".join(fixed(times * edge, digits) for edge in bounds)
