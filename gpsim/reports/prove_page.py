"""A proof as a page and as a text to publish: its tables, the confusion matrix, every miss in words."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from gpsim.reports.canvas import page_of, resource
from gpsim.reports.prove_sheets import GROUPS, proof_sheets
from gpsim.reports.sheets import Cell, Sheet, printable, row, sheet
from gpsim.trials.summary import EQUIVALENT

Json = Mapping[str, Any]
MOST_NAMED = 10
WORDS = {
    "rough": "rough ones",
    "machines": "whole machines",
    "plans": "worlds for plans that some second recording decides",
    "mjcf": "robots by their MuJoCo models",
    "whole": "whole robots",
    "afloat": "robots that float or stand",
    "curves": "laws of one input outside the catalogue",
}
"""The groups of special worlds, as a page counts them."""
_TAG = re.compile(r"<(?=[A-Za-z/!?])")  # what Markdown hands on as HTML


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


def beside(content: Json) -> list[str]:
    """What is not in the tables, a line each: trials that were not diagnosed or could not be scored."""

    def named(trials: Sequence[str]) -> str:
        return ", ".join(trials[:MOST_NAMED]) + (", ..." if len(trials) > MOST_NAMED else "")

    missing, unscored = content["undiagnosed"], content["not_scored"]
    others = sum(content.get(part, {}).get("n", 0) for part in GROUPS)
    others += content.get("plans", {}).get("drawn", 0)
    published = len(missing) + content["all"]["n"] + content["long"]["n"] + others
    lines = []
    if missing:
        lines.append(
            f"{len(missing)} of {published} published trials were not diagnosed and do not count: {named(missing)}"
        )
    if unscored:
        lines.append(f"{len(unscored)} could not be scored and count as wrong: {named(unscored)}")
    return lines


def confusion_sheet(content: Json) -> Sheet:
    """True family against what was said, worlds with at most one effect; `unknown` asserts no name."""
    said = sorted({name for counts in content["confusion"].values() for name in counts})

    def cells(truth: str, counts: Json) -> list[Cell]:
        right = (truth, "unknown", EQUIVALENT)
        return [Cell(str(counts.get(n, "")), marked=bool(counts.get(n)) and n not in right) for n in said]

    rows = ((truth, *cells(truth, counts)) for truth, counts in content["confusion"].items())
    return sheet("True (rows) and reported (columns), worlds with at most one effect", ("", *said), rows)


def miss_rows(scores: Sequence[Json]) -> list[dict[str, str]]:
    """One line a miss, for the page."""
    return [_miss(s) for s in scores if not s["right"]]


def _miss(s: Json) -> dict[str, str]:
    def claims(effects: Sequence[Sequence[str]]) -> str:
        return " + ".join(f"{family} on {on}" for family, on in effects)

    def size(part: Json) -> str:
        if "told" not in part:
            return "(body)"
        return f"{part['value']:.4g} for {part['true']:.4g}" if part["told"] else "(not found)"

    velocities = s["velocities"]
    if not velocities:
        velocities = "positions only" if "robot" in s or s["stratum"] == "whole" else "pose only"
    world = f"{s['system']}, {s['noise_level']} noise, {velocities}, {s['excitation']}"
    world += ", ".join(["" if s["visible"] else ", not visible", *s["defects"]])
    # Of a rough world and a machine: the verdict called for, and what their own effects explain.
    called = f"{' or '.join(s['verdicts'])} (explained {s['explained']:.2f}): " if "explained" in s else ""
    share = s.get("said_explained")
    said = f"{s['verdict']}{'' if share is None else f' ({share:.2f})'}: {claims(s['said']) or 'nothing'}"
    # Of a whole robot, and of what floats, the rows, bodies and effects that are wrong.
    parts = [part for kind in ("rows", "bodies", "parts") for part in s.get(kind, ())]
    wrong = [f"{p['family']} on {p['on']} {size(p)}" for p in parts if p["counts"] > p["right"]]
    return {
        "trial": str(s["trial"]),
        "stratum": str(s["stratum"]),
        "world": world,
        "truth": called + (" + ".join(_true_effect(e) for e in s["effects"]) or "nothing"),
        "said": said + (f"; wrong: {', '.join(wrong)}" if wrong else ""),
        "equivalents": "; ".join(claims(c) for c in s["equivalents"]),
        "error": str(s["error"] or ""),
    }


def _true_effect(effect: Json) -> str:
    numbers = ", ".join(f"{k} {v:.4g}" for k, v in effect["parameters"].items())
    where = "".join(f", {k} in [{low:.3g}, {high:.3g}]" for k, (low, high) in effect["region"].items())
    when = f", since {effect['since']:.6g} s" if effect["since"] is not None else ""
    return f"{effect['family']} on {effect['on']} ({numbers}{where}{when})"


def record(content: Json) -> str:
    """The text, from the content of prove.json."""
    commits = ", ".join(str(commit) for commit in content["diagnosed_under"])
    words = {"all": "worlds of 2 000 to 12 000 transitions", "long": "longer ones", **WORDS}
    counts = {what: content.get(part, {}).get("n", 0) for part, what in words.items()}
    worlds = ", ".join(f"{count} {what}" for what, count in counts.items() if count) or "no worlds"
    head = f"{worlds}, seed {content['seed']}; diagnosed with commit: {commits}."
    sections = (section(f"## {sheet.title}", sheet) for sheet in record_sheets(content))
    return "\n\n".join([head, *beside(content), *sections]) + "\n"


def record_sheets(content: Json) -> list[Sheet]:
    """Every table of a proof that has rows: from the content of prove.json, or of a record that holds its tables."""
    if "tables" in content:
        return [_told(table) for table in content["tables"]]
    misses = [
        row(
            m["trial"], f"{m['stratum']}: {m['world']}", m["truth"], f"{m['said']} {m['error']}".strip(),
            m["equivalents"],
        )
        for m in content.get("every_miss", ())  # proofs of earlier versions list the trials alone
    ]  # fmt: skip
    columns = ("trial", "world", "truth", "said", "listed equivalents")
    every = Sheet("Every miss", columns, tuple(misses), labels=len(columns))
    return [sheet for sheet in (*proof_sheets(content), every) if sheet.rows]


def section(heading: str, sheet: Sheet) -> str:
    """A table in Markdown below its heading, and what is to be said of it."""

    def line(cells: Iterable[str]) -> str:
        """Every cell in one line, in which neither a bar ends it nor a tag begins."""
        flat = (" ".join(printable(text).split("\n")) for text in cells)
        return "| " + " | ".join(_TAG.sub(r"\\<", text).replace("|", "\\|") for text in flat) + " |"

    rule = ["---"] * sheet.labels + ["---:"] * (len(sheet.columns) - sheet.labels)
    rows = ((f"**{cell.text}** !" if cell.marked else cell.text for cell in cells) for cells in sheet.rows)
    lines = [line(sheet.columns), line(rule), *map(line, rows)]
    return "\n\n".join([heading, "\n".join(lines), *([sheet.note] if sheet.note else [])])


def _told(table: Json) -> Sheet:
    """A table as a record holds it: a cell is its text, or `text` and whether it is `missed`."""
    rows = (
        [Cell(c) if isinstance(c, str) else Cell(c["text"], marked=c["missed"]) for c in cells]
        for cells in table["rows"]
    )
    note = " ".join(text for text in (table.get("about", ""), table["note"]) if text)
    return sheet(table["title"], table["columns"], rows, labels=table["labels"], note=note)
