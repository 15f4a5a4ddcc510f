"""A proof as a text to publish: the page's tables and every miss, in Markdown."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from gpsim.reports.printable import printable
from gpsim.reports.prove_misses import miss_rows
from gpsim.reports.prove_sheets import beside, proof_sheets
from gpsim.reports.sheets import Cell, Sheet, row

Json = Mapping[str, Any]
_TAG = re.compile(r"<(?=[A-Za-z/!?])")  # what Markdown hands on as HTML


def record(content: Json, scores: Sequence[Json]) -> str:
    """The text, from the content of prove.json and the scores of all its trials."""
    commits = ", ".join(str(commit) for commit in content["diagnosed_under"])
    head = (
        f"{content['all']['n']} worlds of 2 000 to 12 000 transitions and {content['long']['n']} longer ones, "
        f"{_rough_ones(content)}seed {content['seed']}; diagnosed with commit: {commits}."
    )
    sheets = [sheet for sheet in (*proof_sheets(content), _misses(scores)) if sheet.rows]
    return "\n\n".join([head, *beside(content), *map(_section, sheets)]) + "\n"


def _rough_ones(content: Json) -> str:
    return f"{content['rough']['n']} rough ones, " if "rough" in content else ""


def _misses(scores: Sequence[Json]) -> Sheet:
    rows = [
        row(
            m["trial"],
            f"{m['stratum']}: {m['world']}",
            m["truth"],
            f"{m['said']} {m['error']}".strip(),
            m["equivalents"],
        )
        for m in miss_rows(scores)
    ]
    columns = ("trial", "world", "truth", "said", "listed equivalents")
    return Sheet("Every miss", columns, tuple(rows), labels=len(columns))


def _section(sheet: Sheet) -> str:
    rule = ["---"] * sheet.labels + ["---:"] * (len(sheet.columns) - sheet.labels)
    lines = [_line(sheet.columns), _line(rule), *(_line(map(_text, cells)) for cells in sheet.rows)]
    return "\n\n".join([f"## {sheet.title}", "\n".join(lines), *([sheet.note] if sheet.note else [])])


def _line(cells: Iterable[str]) -> str:
    return "| " + " | ".join(map(_in_a_cell, cells)) + " |"


def _in_a_cell(text: str) -> str:
    """One line, in which neither a bar ends the cell nor a tag begins."""
    return _TAG.sub(r"\\<", " ".join(printable(text).split("\n"))).replace("|", "\\|")


def _text(cell: Cell) -> str:
    return f"**{cell.text}** !" if cell.marked else cell.text
