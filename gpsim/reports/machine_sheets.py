"""A proof's tables of whole machines: figures, classes and other strata, verdicts, effects told by family."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

from gpsim.reports.rough_sheets import bounds, percent, verdicts_sheet
from gpsim.reports.sheets import Sheet, fixed, row, significant

Json = Mapping[str, Any]
COLUMNS = (
    "", "machines", "told %", "95 %", "not there, a world", "95 %", "sizes right %", "rollouts within 1.3 %", "95 %",
    "median ratio", "black box better %", "verdict right %", "95 %", "coverage %", "95 %", "failed", "seconds",
)  # fmt: skip
FIGURES: Mapping[str, Callable[[Json], str]] = {
    "machines": lambda b: str(b["n"]),
    "effects that count, told %": lambda b: percent(b["told"]),
    "told and not there, a machine": lambda b: fixed(b["spurious"], 2),
    "sizes right %": lambda b: percent(b["sized"]),
    "held-out rollouts within 1.3 %": lambda b: percent(b["rollouts_within"]),
    "their median ratio": lambda b: significant(b["median_rollouts"]),
    "a black box is better %": lambda b: percent(b["black_box_better"]),
    "verdict right %": lambda b: percent(b["verdict_right"]),
    "90 % intervals cover %": lambda b: percent(b["coverage_90"]),
    "failed": lambda b: str(b["failed"]),
    "seconds, median": lambda b: fixed((b["seconds"] or {}).get("median")),
}
NOTE = (
    "told: effects that could be seen and make 1 % of the mismatch or stand out of the noise, by their own names or by "
    "ones that explain as much; rollouts: held-out error over that of the true model fitted to the same episodes"
)


def machine_sheets(content: Json) -> list[Sheet]:
    """None where no machine was revealed."""
    machines = content.get("machines")
    if not machines:
        return []
    sheets = [classes_sheet(machines), verdicts_sheet("Whole machines", machines["verdicts"])]
    sheets.append(_figures("Whole machines, with intervals", {"all": machines}))
    sheets += [_figures(f"Whole machines by {name}", blocks) for name, blocks in machines["strata"].items()]
    return [*sheets, _families(machines), _spurious(machines)]


def classes_sheet(machines: Json) -> Sheet:
    """The figures (rows) of all machines and of each class (columns): what fits a terminal."""
    blocks = {"all": machines, **machines["strata"]["class"]}
    rows = [row(label, *(say(block) for block in blocks.values())) for label, say in FIGURES.items()]
    return Sheet("Whole machines", ("", *blocks), tuple(rows), note=NOTE)


def _figures(title: str, blocks: Mapping[str, Json]) -> Sheet:
    rows = [
        row(
            name,
            str(b["n"]),
            percent(b["told"]),
            bounds(b["interval_told"]),
            fixed(b["spurious"], 2),
            bounds(b["interval_spurious"], 1.0, 2),
            percent(b["sized"]),
            percent(b["rollouts_within"]),
            bounds(b["interval_rollouts_within"]),
            significant(b["median_rollouts"]),
            percent(b["black_box_better"]),
            percent(b["verdict_right"]),
            bounds(b["interval_verdict_right"]),
            percent(b["coverage_90"]),
            bounds(b["interval_coverage_90"]),
            str(b["failed"]),
            fixed((b["seconds"] or {}).get("median")),
        )
        for name, b in blocks.items()
    ]
    return Sheet(title, COLUMNS, tuple(rows))


def _families(machines: Json) -> Sheet:
    rows = [
        row(name, f"{f['told']}/{f['n']}", bounds(f["interval"])) for name, f in machines["families"].items()
    ]
    return Sheet("Whole machines: effects that count, told", ("", "told", "95 %"), tuple(rows))


def _spurious(machines: Json) -> Sheet:
    found: Sequence[tuple[str, int]] = sorted(
        machines["spurious_families"].items(), key=lambda item: -item[1]
    )
    rows = [row(name, str(count)) for name, count in found]
    return Sheet("Whole machines: told and not there", ("", "machines"), tuple(rows))
