"""The report of a loop as one self-contained HTML page and as tables for the terminal: the same sheets in both.

A figure is a function of the report and an entry of FIGURES; the template says where it stands and what it shows.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from textwrap import fill
from typing import Any

from rich import box
from rich.table import Table
from rich.text import Text

from gpsim.reports import loop_sheets
from gpsim.reports.canvas import POLICIES, colours, data_uri
from gpsim.reports.loop_figures import (
    figure_learning_curves,
    figure_residual_slices,
    figure_returns,
    figure_rollouts,
    figure_trips,
)
from gpsim.reports.loop_report import LoopReport
from gpsim.reports.pages import page_of, resource
from gpsim.reports.sheets import Cell, Sheet, literal, printable

HEADER = 12  # characters a line of a column's head: heads must not make a table wider than a terminal
FIGURES: Mapping[str, Callable[[LoopReport], Any]] = {
    "trips": figure_trips,
    "returns": figure_returns,
    "slices": figure_residual_slices,
    "rollouts": figure_rollouts,
    "learning": figure_learning_curves,
}
"""By their keys in the template; None where there is nothing to draw."""


def render(report: LoopReport) -> str:
    """The page; equal reports give equal pages."""
    colour = colours([*report.policies, *report.rollouts])
    drawn = {key: make(report) for key, make in FIGURES.items()}
    return page_of(
        "loop_report.html.jinja",
        resource("loop_report.css") + _tints(colour),
        report=report,
        tints={name: f"tint-{i}" for i, name in enumerate(colour)},
        of=loop_sheets,
        pictures={key: (data_uri(f), _shown(report, key)) for key, f in drawn.items() if f is not None},
        settings=list(_settings(report.settings)),
    )


def _shown(report: LoopReport, picture: str) -> list[str]:
    """Names of channels and rates that a picture holds, of which long ones are shortened."""
    names = {
        "slices": [name for cut in report.slices.values() for name in (cut.rate, cut.channel, *cut.at)],
        "rollouts": report.states,
    }
    return list(dict.fromkeys(names.get(picture, ())))


def _settings(tree: Mapping[str, Any], prefix: str = "") -> Iterator[tuple[str, str]]:
    """(dotted name, value) of every leaf of a configuration."""
    for key, value in tree.items():
        if isinstance(value, Mapping):
            yield from _settings(value, f"{prefix}{key}.")
        else:
            text = ", ".join(map(str, value)) if isinstance(value, list | tuple) else str(value)
            yield f"{prefix}{key}", text


def _tints(colour: Mapping[str, str]) -> str:
    """The colours as rules of the style sheet: a policy without inline styles has no room for attributes."""
    return "".join(
        f".dot.tint-{i} {{ background: {value}; }} .card.tint-{i} {{ border-left-color: {value}; }}\n"
        for i, value in enumerate(colour.values())
    )


def terminal_tables(report: LoopReport) -> list[Table]:
    """Returns, one step, calibration and rollouts: the page's numbers; empty tables are left out."""
    sheets = [
        *(loop_sheets.success_sheets(report) or loop_sheets.return_sheets(report)),
        loop_sheets.one_step_sheet(report),
        loop_sheets.calibration_sheet(report),
        loop_sheets.rollout_sheet(report),
    ]
    colour = colours(report.policies)
    return [terminal_table(part, colour) for sheet in sheets if sheet.rows for part in _parts(sheet)]


def terminal_notes(report: LoopReport) -> list[str]:
    """What the tables do not say by themselves: on what was judged, why a layer is missing, what to be wary of."""
    found = (("judged_on", "judged on {}"), ("not_driven", "{}"), ("measured_on", "measured on {}"))
    said = [words.format(report.summary[key]) for key, words in found if report.summary.get(key)]
    return [*said, *(f"warning: {text}" for text in loop_sheets.gp_warnings(report))]


def _parts(sheet: Sheet) -> list[Sheet]:
    """A terminal is narrow: a sheet's tail becomes a table of its own."""
    if not sheet.tail:
        return [sheet]
    cut, words = len(sheet.columns) - sheet.tail, sheet.labels
    rows = tuple(cells[:cut] for cells in sheet.rows)
    tail = tuple((*cells[:words], *cells[cut:]) for cells in sheet.rows)
    heads = (*sheet.columns[:words], *sheet.columns[cut:])
    return [
        replace(sheet, columns=sheet.columns[:cut], rows=rows, tail=0, note=""),
        replace(sheet, title=f"{sheet.title}, mean by seed", columns=heads, rows=tail, tail=0),
    ]


def terminal_table(sheet: Sheet, colour: Mapping[str, str]) -> Table:
    """One sheet as a table of the terminal; `colour` is that of names that have one."""
    table = Table(
        title=literal(sheet.title, "table.title"),
        caption=literal(sheet.note, "table.caption") if sheet.note else None,
        box=box.SIMPLE_HEAD,
        padding=(0, 1, 0, 0),
        pad_edge=False,
        title_justify="left",
        caption_justify="left",
    )
    for index, name in enumerate(sheet.columns):
        label = index < sheet.labels
        head = literal(name if label else fill(name, HEADER))
        table.add_column(head, justify="left" if label else "right", no_wrap=label)
    for cells in sheet.rows:
        table.add_row(*(_text(cell, colour) for cell in cells))
    return table


def _text(cell: Cell, colour: Mapping[str, str]) -> Text:
    text = printable(cell.text)
    if cell.below:
        return Text.assemble(text, (f"\n{printable(cell.below)}", "dim"))
    if cell.marked:
        return Text(f"{text} !", style="bold red")
    # Target is nearly black in figures: invisible on a dark terminal.
    if cell.name and cell.name in colour and cell.name != "Target":
        return Text(text, style=colour[cell.name])
    return Text(text, style="bold" if cell.name in POLICIES else "")
