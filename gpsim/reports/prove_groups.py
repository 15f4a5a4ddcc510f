"""A proof's tables of its special worlds: rough logs, robots, whole machines, whole robots, what floats, curves.

Each group has the same tables: its figures with their intervals, the same by stratum, and counts by family.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

from gpsim.reports.sheets import MISSING, Cell, Sheet, fixed, sheet, significant

Json = Mapping[str, Any]
VERDICTS = ("named", "ambiguous", "partial", "unknown", "none", "failed")
INTERVAL = "95 %"


class Column(NamedTuple):
    """A figure of a block under its heads: the figure, and its interval where there are two."""

    heads: tuple[str, ...]
    cells: Callable[[Json], tuple[str, ...]]


def percent(share: float | None, digits: int = 1) -> str:
    """A share in per cent."""
    return MISSING if share is None else fixed(100 * share, digits)


def bounds(edges: Sequence[float] | None, times: float = 100.0, digits: int = 1) -> str:
    """An interval, in per cent unless other `times` are asked for."""
    return MISSING if edges is None else "-".join(fixed(times * edge, digits) for edge in edges)


def _number(head: str, say: Callable[[Json], str]) -> Column:
    return Column((head,), lambda b: (say(b),))


def _share(head: str, key: str) -> Column:
    return Column((head, INTERVAL), lambda b: (percent(b[key]), bounds(b[f"interval_{key}"])))


def _mean(head: str, key: str) -> Column:
    return Column((head, INTERVAL), lambda b: (fixed(b[key], 2), bounds(b[f"interval_{key}"], 1.0, 2)))


def _count(head: str, some: str, every: str, key: str) -> Column:
    def cells(b: Json) -> tuple[str, ...]:
        return (f"{b[some]}/{b[every]}", bounds(b[f"interval_{key}"])) if b[every] else (MISSING, MISSING)

    return Column((head, INTERVAL), cells)


WORLDS, MACHINES = (_number(head, lambda b: str(b["n"])) for head in ("worlds", "machines"))
COVERAGE = _share("coverage %", "coverage_90")
ENDS = (
    _number("failed", lambda b: str(b["failed"])),
    _number("seconds", lambda b: fixed((b["seconds"] or {}).get("median"))),
)


@dataclass(frozen=True)
class Group:
    """The tables of one kind of worlds.

    all_of_them: the title of the figures of all; families: the title of the counts by family, and how a right one is
    called there.
    """

    title: str
    columns: tuple[Column, ...]
    families: tuple[str, str]
    all_of_them: str
    note: str = ""
    with_intervals: bool = False


GROUPS: Mapping[str, Group] = {
    "rough": Group(
        "Rough worlds",
        (
            WORLDS,
            _share("main effects found %", "headline_found"),
            _share("verdict right %", "verdict_right"),
            _mean("spurious a world", "spurious"),
            COVERAGE,
            *ENDS,
        ),
        ("Rough worlds: main effects found by family", "found"),
        "Rough worlds",
        "main effects of the catalogue among nuisances outside it, in logs as they are; headline effects count",
    ),
    "mjcf": Group(
        "Robots",
        (
            WORLDS,
            _count("one: right", "singles_right", "singles", "single_right"),
            _count("two: both right", "pairs_right", "pairs", "pair_right"),
            _count("false alarms", "alarms", "nulls", "false_alarms"),
            _number("parameter error %", lambda b: percent(b["median_relative_error"], 2)),
            COVERAGE,
            *ENDS,
        ),
        ("Robots: single effects by family", "right"),
        "Robots",
        "the simulator is a MuJoCo model; truth by its accelerations, at a quarter of its step, by another scheme",
    ),
    "machines": Group(
        "Whole machines",
        (
            MACHINES,
            _share("told %", "told"),
            _mean("not there, a world", "spurious"),
            _number("sizes right %", lambda b: percent(b["sized"])),
            _share("rollouts within 1.3 %", "rollouts_within"),
            _number("median ratio", lambda b: significant(b["median_rollouts"])),
            _number("black box better %", lambda b: percent(b["black_box_better"])),
            _share("verdict right %", "verdict_right"),
            COVERAGE,
            *ENDS,
        ),
        ("Whole machines: effects that count, told", "told"),
        "Whole machines, with intervals",
        with_intervals=True,
    ),
    "whole": Group(
        "Whole robots",
        (
            _number("robots", lambda b: str(b["n"])),
            _share("rows right %", "rows_right"),
            _number("rows told %", lambda b: percent(b["rows_told"])),
            _share("bodies right %", "bodies_right"),
            _mean("not there, a robot", "spurious"),
            _share("rollouts within 1.3 %", "rollouts_within"),
            _number("median ratio", lambda b: significant(b["median_rollouts"])),
            _share("verdict right %", "verdict_right"),
            COVERAGE,
            *ENDS,
        ),
        ("Whole robots: rows and bodies right by family", "right"),
        "Whole robots, with intervals",
        "rows: friction and rotor of a joint, of those that make 1 % of its torque, within 15 % or the interval; "
        "bodies: by their own name, in a combination that was named, or by torques that are alike",
        with_intervals=True,
    ),
    "afloat": Group(
        "Afloat",
        (
            WORLDS,
            _count("right", "worlds_right_count", "worlds_right_of", "worlds_right"),
            _count("false alarms", "false_alarms_count", "false_alarms_of", "false_alarms"),
            _count("effects right", "effects_right_count", "effects_right_of", "effects_right"),
            _mean("not there, a world", "spurious"),
            _share("rollouts within 1.3 %", "rollouts_within"),
            _number("median ratio", lambda b: significant(b["median_rollouts"])),
            COVERAGE,
            *ENDS,
        ),
        ("Afloat: effects right by family", "right"),
        "Afloat, with intervals",
        "quadrotors and boats, hoppers and dogs, which nothing holds; right: every effect told within 15 % of what it "
        "changes or the interval, and nothing in the headline that is not there",
        with_intervals=True,
    ),
    "curves": Group(
        "Measured curves",
        (
            WORLDS,
            _share("within 10 % of the range %", "curve_right"),
            _share("site and input right %", "place_right"),
            _share("a law said to hold %", "named_wrong"),
            _number("median off %", lambda b: percent(b["median_off"])),
            *ENDS,
        ),
        ("Measured curves: right by kind of law", "right"),
        "Measured curves",
        "laws of one input that no family has; how far the curve is off, over what was visited; right: near it, and no "
        "law of the catalogue is said to hold",
    ),
}
Sayers = Mapping[str, Callable[[Json], str]]
ROLLOUTS: Sayers = {
    "held-out rollouts within 1.3 %": lambda b: percent(b["rollouts_within"]),
    "their median ratio": lambda b: significant(b["median_rollouts"]),
}
JUDGED: Sayers = {
    "verdict right %": lambda b: percent(b["verdict_right"]),
    "90 % intervals cover %": lambda b: percent(b["coverage_90"]),
    "failed": lambda b: str(b["failed"]),
    "seconds, median": lambda b: fixed((b["seconds"] or {}).get("median")),
}
CLASSES: Sayers = {
    "machines": lambda b: str(b["n"]),
    "effects that count, told %": lambda b: percent(b["told"]),
    "told and not there, a machine": lambda b: fixed(b["spurious"], 2),
    "sizes right %": lambda b: percent(b["sized"]),
    **ROLLOUTS,
    "a black box is better %": lambda b: percent(b["black_box_better"]),
    **JUDGED,
}
DRIVES: Sayers = {
    "robots": lambda b: str(b["n"]),
    "rows of friction and rotors right %": lambda b: percent(b["rows_right"]),
    "told by their own names %": lambda b: percent(b["rows_told"]),
    "bodies right %": lambda b: percent(b["bodies_right"]),
    "told and not there, a robot": lambda b: fixed(b["spurious"], 2),
    **ROLLOUTS,
    **JUDGED,
}
FLOATS: Sayers = {
    "worlds": lambda b: str(b["n"]),
    "right": lambda b: f"{b['worlds_right_count']}/{b['worlds_right_of']}",
    "false alarms": lambda b: f"{b['false_alarms_count']}/{b['false_alarms_of']}",
    "effects right": lambda b: f"{b['effects_right_count']}/{b['effects_right_of']}",
    "told and not there, a world": lambda b: fixed(b["spurious"], 2),
    **ROLLOUTS,
    **JUDGED,
}
CLASSES_NOTE = (
    "told: effects that could be seen and make 1 % of the mismatch or stand out of the noise, by their own names or by "
    "ones that explain as much; rollouts: held-out error over that of the true model fitted to the same episodes"
)


def group_sheets(content: Json) -> list[Sheet]:
    """The tables of every group of which a world was revealed."""
    return [made for part in GROUPS if content.get(part) for made in part_sheets(part, content[part])]


def part_sheets(part: str, block: Json) -> Iterator[Sheet]:
    """The tables of one group."""
    group = GROUPS[part]
    if part == "machines":  # its figures by class of machine are what fits a terminal
        yield turned_sheet(group.title, block, "class", CLASSES, CLASSES_NOTE)
        yield verdicts_sheet(group.title, block["verdicts"])
    if part == "afloat":
        yield turned_sheet(group.title, block, "robot", FLOATS, group.note)
    if part == "whole":
        yield turned_sheet(group.title, block, "driven by", DRIVES, group.note)
    yield _figures(group, group.all_of_them, {"all": block}, group.note)
    for name, blocks in block["strata"].items():
        yield _figures(group, f"{group.title} by {name}", blocks)
    if part == "rough":
        yield verdicts_sheet(group.title, block["verdicts"])
    yield _families(group, block["families"])
    if "joints" in block:
        joints = replace(group, families=(f"{group.title}: rows right by joint", "right"))
        yield _families(joints, block["joints"])
    if "spurious_families" in block:
        found = sorted(block["spurious_families"].items(), key=lambda item: -item[1])
        columns = ("", group.columns[0].heads[0])
        yield sheet(f"{group.title}: told and not there", columns, ((n, str(count)) for n, count in found))


def brief_sheets(content: Json) -> list[Sheet]:
    """The tables that a terminal shows of the groups: verdicts, figures of robots and curves, of machines by class."""
    rough, robots, machines, whole, afloat, curves = (
        list(part_sheets(part, content[part])) if content.get(part) else [] for part in GROUPS
    )
    return [*rough[-2:-1], *robots[:1], *machines[:2], *whole[:1], *afloat[:1], *curves[:1]]


def turned_sheet(title: str, block: Json, stratum: str, figures: Sayers, note: str) -> Sheet:
    """The figures (rows) of all worlds of a group and of each value of a stratum (columns)."""
    blocks = {"all": block, **block["strata"][stratum]}
    rows = ((label, *(say(part) for part in blocks.values())) for label, say in figures.items())
    return sheet(title, ("", *blocks), rows, note=note)


def verdicts_sheet(title: str, verdicts: Mapping[str, Json]) -> Sheet:
    """What was said (columns) where what was called for (rows)."""

    def cell(wanted: str, said: Json, verdict: str) -> Cell:
        return Cell(
            str(said.get(verdict, "")), marked=bool(said.get(verdict)) and verdict not in wanted.split(" or ")
        )

    rows = ((Cell(wanted), *(cell(wanted, said, v) for v in VERDICTS)) for wanted, said in verdicts.items())
    return sheet(f"{title}: verdict called for (rows) and said (columns)", ("", *VERDICTS), rows)


def _figures(group: Group, title: str, blocks: Mapping[str, Json], note: str = "") -> Sheet:
    heads = [head for column in group.columns for head in column.heads]
    rows = ((n, *(c for column in group.columns for c in column.cells(block))) for n, block in blocks.items())
    return sheet(title, ("", *heads), rows, note=note)


def _families(group: Group, families: Mapping[str, Json]) -> Sheet:
    (title, counted), more = group.families, [INTERVAL] * group.with_intervals
    rows = (
        (n, f"{f[counted]}/{f['n']}", *(bounds(f["interval"]) for _ in more)) for n, f in families.items()
    )
    return sheet(title, ("", counted, *more), rows)
