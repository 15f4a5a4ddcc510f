"""A proof as a text to publish: the page's tables and every miss, in Markdown, from prove.json alone."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from typing import Any

from gpsim.reports.printable import printable
from gpsim.reports.prove_sheets import beside, proof_sheets
from gpsim.reports.sheets import Cell, Sheet, row

Json = Mapping[str, Any]
_TAG = re.compile(r"<(?=[A-Za-z/!?])")  # what Markdown hands on as HTML


def record(content: Json) -> str:
    """The text, from the content of prove.json."""
    commits = ", ".join(str(commit) for commit in content["diagnosed_under"])
    head = f"{_worlds(content)}, seed {content['seed']}; diagnosed with commit: {commits}."
    sections = (section(f"## {sheet.title}", sheet) for sheet in record_sheets(content))
    return "\n\n".join([head, *beside(content), *sections]) + "\n"


def record_sheets(content: Json) -> list[Sheet]:
    """Every table of a proof that has rows: from the content of prove.json, or of a record that holds its tables."""
    if "tables" in content:
        return [_told(table) for table in content["tables"]]
    return [sheet for sheet in (*proof_sheets(content), _misses(content)) if sheet.rows]


def section(heading: str, sheet: Sheet) -> str:
    """A table in Markdown below its heading, and what is to be said of it."""
    rule = ["---"] * sheet.labels + ["---:"] * (len(sheet.columns) - sheet.labels)
    lines = [_line(sheet.columns), _line(rule), *(_line(map(_text, cells)) for cells in sheet.rows)]
    return "\n\n".join([heading, "\n".join(lines), *([sheet.note] if sheet.note else [])])


def _worlds(content: Json) -> str:
    """How many of which there are."""
    words = {
        "all": "worlds of 2 000 to 12 000 transitions",
        "long": "longer ones",
        "rough": "rough ones",
        "machines": "whole machines",
        "mjcf": "robots by their MuJoCo models",
    }
    counts = {part: content.get(part, {}).get("n", 0) for part in words}
    return ", ".join(f"{counts[part]} {what}" for part, what in words.items() if counts[part]) or "no worlds"


def _told(table: Json) -> Sheet:
    """A table as a record holds it: a cell is its text, or `text` and whether it is `missed`."""
    rows = tuple(
        tuple(Cell(c) if isinstance(c, str) else Cell(c["text"], marked=c["missed"]) for c in cells)
        for cells in table["rows"]
    )
    note = " ".join(text for text in (table.get("about", ""), table["note"]) if text)
    return Sheet(table["title"], tuple(table["columns"]), rows, labels=table["labels"], note=note)


def _misses(content: Json) -> Sheet:
    rows = [
        row(
            m["trial"],
            f"{m['stratum']}: {m['world']}",
            m["truth"],
            f"{m['said']} {m['error']}".strip(),
            m["equivalents"],
        )
        for m in content.get("every_miss", ())  # proofs of earlier versions list the trials alone
    ]
    columns = ("trial", "world", "truth", "said", "listed equivalents")
    return Sheet("Every miss", columns, tuple(rows), labels=len(columns))


def _line(cells: Iterable[str]) -> str:
    return "| " + " | ".join(map(_in_a_cell, cells)) + " |"


def _in_a_cell(text: str) -> str:
    """One line, in which neither a bar ends the cell nor a tag begins."""
    return _TAG.sub(r"\\<", " ".join(printable(text).split("\n"))).replace("|", "\\|")


def _text(cell: Cell) -> str:
    return f"**{cell.text}** !" if cell.marked else cell.text
