"""A proof as a page and as a text to publish: its tables, the confusion matrix, every miss in words."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from gpsim.reports.canvas import page_of, resource
from gpsim.reports.prove_groups import GROUPS
from gpsim.reports.prove_sheets import proof_sheets
from gpsim.reports.sheets import Cell, Sheet, printable, row, sheet
from gpsim.trials.goals import EQUIVALENT

Json = Mapping[str, Any]


MOST_NAMED = 10


def beside(content: Json) -> list[str]:
    """What is not in the tables, a line each: trials that were not diagnosed or could not be scored."""
    missing, unscored = content["undiagnosed"], content["not_scored"]
    others = sum(content.get(part, {}).get("n", 0) for part in GROUPS)
    others += content.get("plans", {}).get("drawn", 0)
    published = len(missing) + content["all"]["n"] + content["long"]["n"] + others
    lines = []
    if missing:
        lines.append(
            f"{len(missing)} of {published} published trials were not diagnosed and do not count: {_named(missing)}"
        )
    if unscored:
        lines.append(f"{len(unscored)} could not be scored and count as wrong: {_named(unscored)}")
    return lines


def _named(trials: Sequence[str]) -> str:
    """A line's worth of them."""
    return ", ".join(trials[:MOST_NAMED]) + (", ..." if len(trials) > MOST_NAMED else "")


def confusion_sheet(content: Json) -> Sheet:
    """True family against what was said, worlds with at most one effect."""
    said = sorted({name for counts in content["confusion"].values() for name in counts})
    rows = (
        (truth, *(Cell(str(counts.get(name, "")), marked=_wrong(truth, name, counts)) for name in said))
        for truth, counts in content["confusion"].items()
    )
    return sheet("True (rows) and said (columns), worlds with at most one effect", ("", *said), rows)


def _wrong(truth: str, said: str, counts: Json) -> bool:
    return name_differs(truth, said) and bool(counts.get(said))


def name_differs(truth: str, said: str) -> bool:
    """Whether a name asserted is not the true one; `unknown` asserts none."""
    return said not in (truth, "unknown", EQUIVALENT)


def miss_rows(scores: Sequence[Json]) -> list[dict[str, str]]:
    """One line a miss, for the page."""
    return [
        {
            "trial": str(s["trial"]),
            "stratum": str(s["stratum"]),
            "world": f"{s['system']}, {s['noise_level']} noise, {s['velocities'] or _unmeasured(s)}, {s['excitation']}"
            + ("" if s["visible"] else ", not visible")
            + (f", {', '.join(s['defects'])}" if s["defects"] else ""),
            "truth": _true_share(s) + (" + ".join(_true_effect(e) for e in s["effects"]) or "nothing"),
            "said": f"{s['verdict']}{_said_share(s)}: "
            + (" + ".join(f"{f} on {on}" for f, on in s["said"]) or "nothing")
            + _wrong_parts(s),
            "equivalents": "; ".join(" + ".join(f"{f} on {on}" for f, on in c) for c in s["equivalents"]),
            "error": str(s["error"] or ""),
        }
        for s in scores
        if not s["right"]
    ]


def _unmeasured(score: Json) -> str:
    return "positions only" if "robot" in score or score["stratum"] == "whole" else "pose only"


def _true_share(score: Json) -> str:
    """Of a rough world and a machine: the verdict called for, and what their own effects explain."""
    if "explained" not in score:
        return ""
    return f"{' or '.join(score['verdicts'])} (explained {score['explained']:.2f}): "


def _wrong_parts(score: Json) -> str:
    """Of a whole robot, and of what floats, the rows, bodies and effects that are wrong."""
    wrong = [
        part
        for kind in ("rows", "bodies", "parts")
        for part in score.get(kind, ())
        if part["counts"] > part["right"]
    ]
    words = [f"{p['family']} on {p['on']} {_size(p)}" for p in wrong]
    return f"; wrong: {', '.join(words)}" if words else ""


def _size(part: Json) -> str:
    if "told" not in part:
        return "(body)"
    return f"{part['value']:.4g} for {part['true']:.4g}" if part["told"] else "(not told)"


def _said_share(score: Json) -> str:
    share = score.get("said_explained")
    return "" if share is None else f" ({share:.2f})"


def _true_effect(effect: Json) -> str:
    numbers = ", ".join(f"{k} {v:.4g}" for k, v in effect["parameters"].items())
    where = "".join(f", {k} in [{low:.3g}, {high:.3g}]" for k, (low, high) in effect["region"].items())
    when = f", since {effect['since']:.6g} s" if effect["since"] is not None else ""
    return f"{effect['family']} on {effect['on']} ({numbers}{where}{when})"


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
    words = {"all": "worlds of 2 000 to 12 000 transitions", "long": "longer ones", **WORDS}
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


WORDS = {
    "rough": "rough ones",
    "machines": "whole machines",
    "plans": "worlds for plans that some second recording resolves",
    "mjcf": "robots by their MuJoCo models",
    "whole": "whole robots",
    "afloat": "robots that float or stand",
    "curves": "laws of one input that no family has",
}
"""The groups of special worlds, as a page counts them."""


def page(content: Json, scores: Sequence[Json]) -> str:
    """The page; it stands beside the folder of diagnoses that it links to."""
    return page_of(
        "prove.html.jinja",
        resource("plain.css"),
        groups=WORDS,
        content=content,
        beside=beside(content),
        sheets=proof_sheets(content),
        confusion=confusion_sheet(content),
        misses=miss_rows(scores),
    )
