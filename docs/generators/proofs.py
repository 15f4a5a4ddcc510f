"""Every reported blind test, from its record: benchmarks/proofs.md, and docs/method/proofs.md, which compares them."""

import json
from pathlib import Path

from gpsim.reports.prove_page import record_sheets, section
from gpsim.reports.prove_sheets import goals_sheet
from gpsim.reports.sheets import fixed, significant
from gpsim.trials.summary import GOALS

from . import MADE

RECORDS = Path(__file__).resolve().parents[2] / "benchmarks" / "proofs"
HEAD = f"""# Blind tests, seed by seed

{MADE.format(source="`benchmarks/proofs/*.json`")}
[The blind test](METHOD/blind_test.md) describes the worlds and the scoring. [Repeat a blind
test](HOW_TO/prove.md#publish-a-record) explains how a record is added.

Each seed was run once, with worlds that were not used for tuning. Its answers were hashed before the first
diagnosis and opened after the last one. An opened seed may be used for tuning, so the next measurement needs a
new seed. The columns therefore use different worlds and slightly different rules, which each section explains."""
NOTE = """\
`!`: that seed missed its goal. Up to seed 2031, the estimate itself had to reach the goal, and the goals were 95, 88
and 75 % of worlds with one, two and three effects, and 90 % outside the catalogue. The section of each seed has the
intervals, all tables and all misses. Times are seconds of one core, with another trial on the other core."""


def proofs_page() -> str:
    """The comparison, then seed by seed, the newest first."""
    return _page(HEAD.replace("METHOD", "../docs/method").replace("HOW_TO", "../docs/how-to"), _proof)


def seeds_page() -> str:
    """The comparison, and where each seed's tables and misses are."""
    head = HEAD.replace("METHOD/", "").replace("HOW_TO", "../how-to")
    return _page(f"{head}\n\n[Every table and every miss of each seed](../../benchmarks/proofs.md).")


def _page(head: str, section_of=None) -> str:
    records = [json.loads(p.read_text(encoding="utf-8")) for p in RECORDS.glob("*.json")]
    records.sort(key=lambda record: -record["seed"])
    parts = [head, "## All of them", _comparison(records), NOTE]
    parts += map(section_of, records) if section_of else []
    return "\n\n".join(parts) + "\n"


def _comparison(records) -> str:
    heads = ["", "asked today", *(f"seed {record['seed']}" for record in records)]
    columns = [_cells(record) for record in records]
    rows = [
        [goal.label, _asked(goal), *(column.get(key, "") for column in columns)]
        for key, goal in GOALS.items()
        if any(key in column for column in columns)
    ]
    first, *lines = [f"| {' | '.join(cells)} |" for cells in (heads, *rows)]
    return "\n".join([first, "|---" * len(heads) + "|", *lines])


def _asked(goal) -> str:
    return f"{goal.sign} {goal.wanted:g}" if goal.most is None else f"{goal.wanted:g}-{goal.most:g}"


def _cells(record) -> dict[str, str]:
    """What a seed reached, by goal."""
    counts = {}
    if "tables" not in record:
        numbers = [cells[-1].text for cells in goals_sheet(record).rows]
        reached = [key for key, goal in record["goals"].items() if goal["got"] is not None]
        counts = dict(zip(reached, numbers, strict=True))
    return {
        key: _reached(key, goal["got"], goal.get("count", counts.get(key, "")))
        + (" !" if goal["reached"] is False else "")
        for key, goal in record["goals"].items()
        if goal["got"] is not None
    }


def _reached(key: str, got: float, count: str) -> str:
    if key.endswith("median_relative_error"):
        return f"{significant(100 * got, 1)} %"
    if key.startswith("seconds"):
        return f"{fixed(got)} s"
    if key.endswith(".spurious"):
        return fixed(got, 2)
    return f"{fixed(100 * got)} % ({count})"


def _proof(record) -> str:
    """One seed: what is to be said of it, and its tables, folded away."""
    about = record.get("about") or [
        f"{record['n']} visible worlds of 2 000 to 12 000 transitions count in the headline."
    ]
    command = record.get("command", f"gpsim prove --seed {record['seed']} --out DIR")
    sheets = record_sheets(record)
    misses = [sheet for sheet in sheets if sheet.title == "Every miss"]
    tables = [sheet for sheet in sheets if sheet not in misses]
    folds = [_fold(f"Every table of seed {record['seed']}", tables)]
    folds += [_fold(f"Every miss of seed {record['seed']}", misses)] if misses else []
    return "\n\n".join([f"## Seed {record['seed']}", f"    {command}", *about, *folds])


def _fold(summary: str, sheets) -> str:
    inner = "\n\n".join(section(f"**{sheet.title}**", sheet) for sheet in sheets)
    return f'<details markdown="1"><summary>{summary}</summary>\n\n{inner}\n\n</details>'
