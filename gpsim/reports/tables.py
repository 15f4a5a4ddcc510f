"""The report's tables for the terminal."""

from __future__ import annotations

from dataclasses import replace
from textwrap import fill

from rich import box
from rich.table import Table
from rich.text import Text

from gpsim.reports.loop_report import LoopReport
from gpsim.reports.model_sheets import calibration_sheet, gp_warnings, one_step_sheet, rollout_sheet
from gpsim.reports.palette import POLICIES, colours
from gpsim.reports.printable import printable
from gpsim.reports.return_sheets import return_sheets
from gpsim.reports.sheets import Cell, Sheet
from gpsim.reports.success_sheets import success_sheets

HEADER = 12
"""Characters a line of a column's head may hold: heads must not make a table wider than a terminal."""


def terminal_tables(report: LoopReport) -> list[Table]:
    """Returns, one step, calibration and rollouts: the page's numbers; empty tables are left out."""
    sheets = [
        *(success_sheets(report) or return_sheets(report)),
        one_step_sheet(report),
        calibration_sheet(report),
        rollout_sheet(report),
    ]
    colour = colours(report.policies)
    return [terminal_table(part, colour) for sheet in sheets if sheet.rows for part in _parts(sheet)]


def terminal_notes(report: LoopReport) -> list[str]:
    """What the tables do not say by themselves: on what was judged, why a layer is missing, what to be wary of."""
    found = (("judged_on", "judged on {}"), ("not_driven", "{}"), ("measured_on", "measured on {}"))
    said = [words.format(report.summary[key]) for key, words in found if report.summary.get(key)]
    return [*said, *(f"warning: {text}" for text in gp_warnings(report))]


def _parts(sheet: Sheet) -> list[Sheet]:
    """A terminal is narrow: a sheet's tail becomes a table of its own."""
    if not sheet.tail:
        return [sheet]
    cut = len(sheet.columns) - sheet.tail
    body = replace(
        sheet, columns=sheet.columns[:cut], rows=tuple(cells[:cut] for cells in sheet.rows), tail=0, note=""
    )
    tail = Sheet(
        f"{sheet.title}, mean by seed",
        (*sheet.columns[: sheet.labels], *sheet.columns[cut:]),
        tuple((*cells[: sheet.labels], *cells[cut:]) for cells in sheet.rows),
        sheet.labels,
        sheet.note,
    )
    return [body, tail]


def terminal_table(sheet: Sheet, colour: dict[str, str]) -> Table:
    """One sheet as a table of the terminal; `colour` is that of names that have one."""
    table = Table(
        title=Text(printable(sheet.title), "table.title"),
        caption=Text(printable(sheet.note), "table.caption") if sheet.note else None,
        box=box.SIMPLE_HEAD,
        padding=(0, 1, 0, 0),
        pad_edge=False,
        title_justify="left",
        caption_justify="left",
    )
    for index, name in enumerate(sheet.columns):
        label = index < sheet.labels
        table.add_column(
            Text(printable(name if label else fill(name, HEADER))),
            justify="left" if label else "right",
            no_wrap=label,
        )
    for cells in sheet.rows:
        table.add_row(*(_text(cell, colour) for cell in cells))
    return table


def _text(cell: Cell, colour: dict[str, str]) -> Text:
    text = printable(cell.text)
    if cell.below:
        return Text.assemble(text, (f"\n{printable(cell.below)}", "dim"))
    if cell.marked:
        return Text(f"{text} !", style="bold red")
    # Target is nearly black in figures: invisible on a dark terminal.
    if cell.name and cell.name in colour and cell.name != "Target":
        return Text(text, style=colour[cell.name])
    return Text(text, style="bold" if cell.name in POLICIES else "")
