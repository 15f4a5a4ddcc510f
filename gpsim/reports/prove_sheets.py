"""A proof's tables: the page and the terminal show the same sheets.

Its special worlds (rough logs, robots, whole machines, whole robots, what floats, curves) are groups with the same
tables each: the figures with their intervals, the same by stratum, and counts by family.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from importlib import resources
from typing import Any

from gpsim.recordings import parse_yaml
from gpsim.reports.sheets import MISSING, Cell, Sheet, fixed, sheet, significant
from gpsim.trials.summary import GOALS, bounds_of

Json = Mapping[str, Any]
VERDICTS = ("named", "ambiguous", "partial", "unknown", "none", "failed")
INTERVAL = "95 %"
SIZES = ("single", "pair", "triple")
FAILED = (*SIZES, "none", "unknown")
COUNTED = {
    **dict.fromkeys((*SIZES, "location"), "right"),
    "none": "false_alarms", "unknown": "said_so", "undecided": "count", "fit": "within",
}  # fmt: skip
ROBOTS_COUNTED = {
    "single_right": ("singles_right", "singles"), "pair_right": ("pairs_right", "pairs"),
    "false_alarms": ("alarms", "nulls"),
}  # fmt: skip
MACHINES_COUNTED = {
    "told": "counting", "sized": "parameters", "coverage_90": "parameters", "rollouts_within": "rollouts_within_of",
    "black_box_better": "black_box_better_of",
}  # fmt: skip
"""Figure -> of how many it is a share, where that is not the number of machines."""
RIVALS = {
    "before": "base as it is",
    "tuned": "base, parameters tuned",
    "gp": "base + GP (the thesis)",
    "after": "base + named effects",
    "after_gp": "base + named effects + GP",
}
NAMERS = {
    "sindy": "PySINDy, what is missing",
    "diagnose_on_the_same": "gpsim diagnose, what is missing",
    "sindy_nothing": "PySINDy, that nothing is",
    "diagnose_on_the_same_nothing": "gpsim diagnose, that nothing is",
}


def _percent(share: float | None, digits: int = 1) -> str:
    return MISSING if share is None else fixed(100 * share, digits)


def _bounds(edges: Sequence[float] | None, times: float = 100.0, digits: int = 1) -> str:
    """An interval, in per cent unless other `times` are asked for."""
    return MISSING if edges is None else "-".join(fixed(times * edge, digits) for edge in edges)


def _within(bounds: Sequence[float] | None, median: bool = False) -> str:
    """An interval: of a share with three decimals, of a median with three digits."""
    if not bounds:
        return MISSING
    return "-".join(significant(edge) if median else fixed(edge, 3) for edge in bounds)


def _cells(said: str, b: Json) -> tuple[str, ...]:
    """A figure of a block, and its interval where it has one, as a column of GROUPS says."""
    kind, key, *more = said.split()
    every = b[more[0]] if kind in ("of", "ratio") else None
    if kind == "of":
        return (f"{b[key]}/{every}", _bounds(b[f"interval_{more[1]}"])) if every else (MISSING, MISSING)
    if kind == "share":
        return _percent(b[key]), _bounds(b[f"interval_{key}"])
    if kind == "mean":
        return fixed(b[key], 2), _bounds(b[f"interval_{key}"], 1.0, 2)
    alone: Mapping[str, Callable[[Any], str]] = {
        "count": str,
        "percent": lambda value: _percent(value, *map(int, more)),
        "number": lambda value: fixed(value, 2),
        "significant": significant,
        "median": lambda value: fixed((value or {}).get("median")),
        "ratio": lambda value: f"{value}/{every}",
    }
    return (alone[kind](b[key]),)


GROUPS: Mapping[str, Json] = parse_yaml(
    resources.files("gpsim.reports").joinpath("templates", "prove_groups.yaml").read_text(encoding="utf-8")
)
WITH_INTERVAL = ("share", "mean", "of")  # kinds of columns


def proof_sheets(content: Json) -> list[Sheet]:
    """Goals, what stands beside them, rivals, strata, families and kinds."""
    first = (goals_sheet, shares_sheet, medians_sheet, rivals_sheet, namers_sheet)
    return [
        *(make(content) for make in first), *group_sheets(content), plan_sheet(content), *strata_sheets(content),
        families_sheet(content), kinds_sheet(content),
    ]  # fmt: skip


def terminal_sheets(content: Json) -> list[Sheet]:
    """Those that a terminal shows: of the rough worlds what was said where what was called for.

    Of the groups verdicts, figures of robots and curves, of machines by class.
    """
    parts = {part: list(_part_sheets(part, content[part])) for part in GROUPS if content.get(part)}
    shown = {part: slice(1) for part in GROUPS} | {"rough": slice(-2, -1), "machines": slice(2)}
    brief = [made for part, sheets in parts.items() for made in sheets[shown[part]]]
    others = (plan_sheet(content), rivals_sheet(content), namers_sheet(content))
    return [made for made in (goals_sheet(content), *brief, *others) if made.rows]


def group_sheets(content: Json) -> list[Sheet]:
    """The tables of every group of which a world was revealed."""
    return [made for part in GROUPS if content.get(part) for made in _part_sheets(part, content[part])]


def _part_sheets(part: str, block: Json) -> Iterator[Sheet]:
    """The tables of one group."""
    group = GROUPS[part]
    title, more = group["title"], group.get("with_intervals", False)
    if turned := group.get("turned"):
        blocks = {"all": block, **block["strata"][turned["by"]]}
        figures = (
            (label, *(_cells(said, b)[0] for b in blocks.values()))
            for label, said in turned["figures"].items()
        )
        yield sheet(title, ("", *blocks), figures, note=turned["note"])
    if part == "machines":
        yield _verdicts_sheet(title, block["verdicts"])
    yield _figures(group, title + ", with intervals" * more, {"all": block}, group["note"])
    for name, blocks in block["strata"].items():
        yield _figures(group, f"{title} by {name}", blocks)
    if part == "rough":
        yield _verdicts_sheet(title, block["verdicts"])
    for families, counted in group["families"].items():
        yield _families(f"{title}: {families}", counted, more, block["families"])
    if "joints" in block:
        yield _families(f"{title}: rows right by joint", "right", more, block["joints"])
    if "spurious_families" in block:
        found = sorted(block["spurious_families"].items(), key=lambda item: -item[1])
        columns = ("", next(iter(group["columns"])))
        yield sheet(f"{title}: claimed and not there", columns, ((n, str(count)) for n, count in found))


def _verdicts_sheet(title: str, verdicts: Mapping[str, Json]) -> Sheet:
    """What was said (columns) where what was called for (rows)."""

    def cells(wanted: str, said: Json) -> list[Cell]:
        right = wanted.split(" or ")
        return [Cell(str(said.get(v, "")), marked=bool(said.get(v)) and v not in right) for v in VERDICTS]

    rows = ((Cell(wanted), *cells(wanted, said)) for wanted, said in verdicts.items())
    return sheet(f"{title}: right verdict (rows) and reported verdict (columns)", ("", *VERDICTS), rows)


def _figures(group: Json, title: str, blocks: Mapping[str, Json], note: str = "") -> Sheet:
    said = group["columns"].items()
    heads = [h for head, how in said for h in (head, INTERVAL)[: 1 + how.startswith(WITH_INTERVAL)]]
    rows = ((n, *(c for _, how in said for c in _cells(how, block))) for n, block in blocks.items())
    return sheet(title, ("", *heads), rows, note=note)


def _families(title: str, counted: str, with_intervals: bool, families: Mapping[str, Json]) -> Sheet:
    more = [INTERVAL] * with_intervals
    told = families.items()
    rows = ((n, f"{f[counted]}/{f['n']}", *(_bounds(f["interval"]) for _ in more)) for n, f in told)
    return sheet(title, ("", counted, *more), rows)


def goals_sheet(content: Json) -> Sheet:
    """What has to be reached and what was, wherever the proof has worlds that it is about."""

    def cells(name: str, goal: Json) -> tuple[Cell | str, ...]:
        part, key = name.split(".")
        block = content.get(part, {})
        bounds = _within(bounds_of(block, key), key.startswith("median"))
        got = Cell(significant(goal["got"]), marked=goal["reached"] is False)
        return GOALS[name].label, goal["wanted"], got, bounds, _counted(part, key, block)

    return sheet(
        "Goals, on visible worlds of 2 000 to 12 000 transitions",
        ("", "wanted", "got", INTERVAL, "count"),
        (cells(name, goal) for name, goal in content["goals"].items() if goal["got"] is not None),
        note="outside: of the catalogue; near: at most 1.1 times the true model's own one-step error; rough: "
        "on rough worlds; machines: whole ones; whole robots: all joints at once; afloat: what floats or "
        "stands; curves: laws of no family; "
        "!: missed, also by the interval of a share or of a mean",
    )


def _counted(part: str, key: str, block: Json) -> str:
    """What a figure counts: some of so many worlds, or so many where it is no count."""
    if part == "mjcf" and key in ROBOTS_COUNTED:
        some, every = ROBOTS_COUNTED[key]
        return f"{block[some]}/{block[every]}"
    if part in ("whole", "afloat") and key != "spurious":
        return f"{block[f'{key}_count']}/{block[f'{key}_of']}"
    if part == "curves" or (part == "machines" and key != "spurious"):
        of = block[MACHINES_COUNTED.get(key, "n") if part == "machines" else "n"]
        of -= block["failed"] if (part, key) == ("curves", "named_wrong") else 0
        return f"{round(block[key] * of)}/{of}"
    count = block.get("named_wrong" if key == "share_named_wrong" else COUNTED.get(part, ""))
    of = block.get("n", MISSING)
    if key == "share_named_wrong" and block:
        of -= block["failed"]
    return str(of) if count is None else f"{count}/{of}"


def shares_sheet(content: Json) -> Sheet:
    """The parts that a right answer consists of, each by itself, and how many diagnoses failed."""
    location = content.get("location", {})
    parts = {
        "verdict right": content.get("verdict_right"),
        "families right, wherever they act": content.get("families_right"),
        "location: rate right": location.get("rate_right"),
        "location: place right": location.get("place_right"),
        "location: gates right": location.get("gate_right"),
    }
    failed = [f"{name} {content[name]['failed']}" for name in FAILED if content.get(name, {}).get("failed")]
    rows = (
        (label, significant(p["share"]), _within(p["interval"]), f"{p['right']}/{p['n']}")
        for label, p in parts.items()
        if p
    )
    note = (
        f"failed diagnoses: {', '.join(failed) or 'none'}; they count as wrong, but not for false alarms, "
        f"wrong names and undecided worlds"
    )
    return sheet("Part by part, on the same worlds", ("", "share", INTERVAL, "count"), rows, note=note)


def medians_sheet(content: Json) -> Sheet:
    """Sizes of errors: medians and their bootstrap intervals."""
    location, parameters = content.get("location", {}), content.get("parameters")
    parts = {
        "region, IoU": (location.get("iou"), "median"),
        "onset, error over the recording's duration": (location.get("onset_error"), "median"),
        "parameters, error over the value": (parameters, "median_relative_error"),
        "parameters, error relative to their effect": (parameters, "median_error_of_effect"),
        "held-out error relative to the true model": (content.get("fit"), "median"),
    }
    rows = (
        (
            label,
            significant(p[key]),
            _within(p[f"interval_{key}"], True),
            significant(p.get("mean")),
            str(p["n"]),
        )
        for label, (p, key) in parts.items()
        if p
    )
    return sheet("Sizes of errors", ("", "median", INTERVAL, "mean", "count"), rows)


def rivals_sheet(content: Json) -> Sheet:
    """Held-out one-step errors by several means."""
    found = [(words, r) for kind, r in content["rivals"].items() if (words := RIVALS.get(kind))]
    rows = (
        (words, str(r["n"]), significant(r["median"]), _within(r["interval_median"], True), *_shared(r))
        for words, r in found
    )
    return sheet(
        "Held-out one-step error relative to the true model, worst rate",
        ("", "worlds", "median ratio", INTERVAL, "% within 1.1", INTERVAL),
        rows,
        note="all worlds with a mismatch, visible or not, including those outside the catalogue",
    )


def plan_sheet(content: Json) -> Sheet:
    """What each excitation decides, of the worlds that any decides; no rows where there are no such worlds."""
    plans, note = content.get("plans") or {"kinds": {}}, ""
    rows = [
        (
            kind, f"{k['resolved']}/{k['n']}", _within(k["interval"]), significant(k["median_seconds"]),
            str(k["left"]),
        )
        for kind, k in plans["kinds"].items()
    ]  # fmt: skip
    if rows:
        note = (
            f"A slow recording left {plans['open']} of {plans['drawn']} worlds undecided. In {plans['listed']} of "
            f"these, the truth was among the explanations. A second recording decided {plans['n']}: fitted to both "
            "recordings, the right explanation then led by odds above ten."
        )
    columns = ("next recording", "resolved", INTERVAL, "seconds, median", "left the box")
    return sheet("The next recording", columns, rows, note=note)


def namers_sheet(content: Json) -> Sheet:
    """Who names more, where PySINDy's library holds the truth."""
    found = content["rivals"]
    return sheet(
        "Namers, where PySINDy's library holds the truth",
        ("", "worlds", "% right", INTERVAL),
        ((label, str(found[k]["n"]), *_shared(found[k])) for k, label in NAMERS.items() if k in found),
        note="mechanical systems with every effect in its library and acting everywhere, visible or not",
    )


def _shared(block: Json) -> tuple[str, str]:
    """A share in per cent, and its interval."""
    return _percent(block["share"]), _bounds(block["interval"])


STRATUM = (
    "", "one", "two", "three", "false alarms", "outside: said so", "location", "parameter error %",
    "coverage %", "fit within 1.1", "seconds",
)  # fmt: skip
COUNTS = {**dict.fromkeys(SIZES, "right"), "none": "false_alarms", "unknown": "said_so", "location": "right"}


def strata_sheets(content: Json) -> list[Sheet]:
    """The same figures by stratum; no table where no world counts in it."""
    parts = {"headline": content, "all worlds": content["all"], "identifiable": content["identifiable"]}
    if content["long"]["n"]:
        parts["long recordings"] = content["long"]
    tables = {"All together": parts} if content["all"]["n"] + content["long"]["n"] else {}
    tables |= {f"By {name.replace('_', ' ')}": blocks for name, blocks in content["strata"].items()}
    return [
        sheet(title, STRATUM, (_stratum(name, block) for name, block in blocks.items()))
        for title, blocks in tables.items()
    ]


def _stratum(name: str, block: Json) -> tuple[str, ...]:
    def count(part: str, key: str) -> str:
        found = block.get(part)
        return MISSING if found is None else f"{found[key]}/{found['n']}"

    parameters = block.get("parameters") or {}
    return (
        name,
        *(count(part, key) for part, key in COUNTS.items()),
        *(_percent(parameters.get(key)) for key in ("median_relative_error", "coverage_90")),
        count("fit", "within"),
        fixed(block.get("seconds", {}).get("median")),
    )


def families_sheet(content: Json) -> Sheet:
    """Single effects by what they are."""
    rows = ((n, f"{f['right']}/{f['n']}", _within(f["interval"])) for n, f in content["families"].items())
    return sheet("Visible single effects by family", ("", "right", INTERVAL), rows)


def kinds_sheet(content: Json) -> Sheet:
    """Physics outside the catalogue by what it is."""
    rows = ((n, f"{k['said_so']}/{k['n']}", str(k["named_wrong"])) for n, k in content["kinds"].items())
    return sheet("Outside the catalogue by kind", ("", "said so", "wrong name"), rows)
