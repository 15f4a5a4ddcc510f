"""The report as one self-contained HTML page: style and figures inside, no network, no scripts, no dates."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from textwrap import fill
from typing import Any

from rich import box
from rich.table import Table
from rich.text import Text

from gpsim.reports.canvas import POLICIES, colours, data_uri, page_of, resource
from gpsim.reports.gp_figures import figure_calibration, figure_residual_slices
from gpsim.reports.loop_figures import (
    figure_divergence,
    figure_expert_rounds,
    figure_learning_curves,
    figure_returns,
    figure_rollouts,
)
from gpsim.reports.loop_report import LoopReport, printed_table
from gpsim.reports.loop_sheets import cards, paragraph, return_sheets, success_sheets
from gpsim.reports.model_sheets import (
    calibration_sheet,
    fit_sheet,
    gp_warnings,
    one_step_sheet,
    rates,
    rollout_sheet,
    scale_sheet,
)
from gpsim.reports.sheets import Cell, Sheet, printable
from gpsim.reports.trip_figures import figure_steps, figure_trips


def render(report: LoopReport) -> str:
    """The page; equal reports give equal pages."""
    colour = colours([*report.policies, *report.rollouts])
    return page_of(
        "loop_report.html.jinja",
        resource("loop_report.css") + _tints(colour),
        report=report,
        tints={name: f"tint-{i}" for i, name in enumerate(colour)},
        paragraph=paragraph(report),
        cards=cards(report),
        success_sheets=success_sheets(report),
        return_sheets=return_sheets(report),
        one_step=one_step_sheet(report),
        calibration=calibration_sheet(report),
        rollout=rollout_sheet(report),
        fit=fit_sheet(report),
        scales=scale_sheet(report),
        warnings=gp_warnings(report),
        pictures=_pictures(report),
        settings=list(settings(report.settings)),
        diagnosed_by=_diagnosed_by(report),
        thesis_table=printed_table(report.experiment, report.system),
    )


def settings(tree: Mapping[str, Any], prefix: str = "") -> Iterator[tuple[str, str]]:
    """(dotted name, value) of every leaf of a configuration."""
    for key, value in tree.items():
        if isinstance(value, Mapping):
            yield from settings(value, f"{prefix}{key}.")
        else:
            yield (
                f"{prefix}{key}",
                ", ".join(map(str, value)) if isinstance(value, list | tuple) else str(value),
            )


def _diagnosed_by(report: LoopReport) -> str:
    if "diagnosis" in report.given:
        return "the diagnosis that the loop was given"
    if "recording" in report.given:
        return "each seed's diagnosis of the recording that the loop was given"
    return "the diagnosis of each seed's recording"


def _tints(colour: Mapping[str, str]) -> str:
    """The colours as rules of the style sheet: a policy without inline styles has no room for attributes."""
    return "".join(
        f".dot.tint-{i} {{ background: {value}; }} .card.tint-{i} {{ border-left-color: {value}; }}\n"
        for i, value in enumerate(colour.values())
    )


def _pictures(report: LoopReport) -> dict[str, tuple[str, list[str]]]:
    """Figures as sources of images, each with the names in it; the template says what they show."""
    made = {
        "trips": figure_trips(report),
        "steps": figure_steps(report),
        "returns": figure_returns(report) if report.trips is None else None,
        "slices": figure_residual_slices(report),
        "calibration": figure_calibration(report),
        "rollouts": figure_rollouts(report),
        "divergence": figure_divergence(report),
        "learning": figure_learning_curves(report),
        "rounds": figure_expert_rounds(report),
    }
    return {key: (data_uri(f), _shown(report, key)) for key, f in made.items() if f is not None}


def _shown(report: LoopReport, picture: str) -> list[str]:
    """Names of channels and rates that a picture holds."""
    cuts = report.slices.values()
    named = {
        "slices": (name for cut in cuts for name in (cut.rate, cut.channel, *cut.at)),
        "calibration": rates(report),
        "rollouts": report.states,
        "divergence": report.states,
    }
    return list(dict.fromkeys(named.get(picture, ())))


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
