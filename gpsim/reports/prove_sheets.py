"""A proof's tables: the page and the terminal show the same sheets."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from gpsim.reports.prove_groups import brief_sheets, group_sheets
from gpsim.reports.sheets import MISSING, Cell, Sheet, fixed, sheet, significant
from gpsim.trials.goals import GOALS, bounds_of

Json = Mapping[str, Any]
SIZES = ("single", "pair", "triple")
COUNTED = {
    "single": "right",
    "pair": "right",
    "triple": "right",
    "location": "right",
    "none": "false_alarms",
    "unknown": "said_so",
    "undecided": "count",
    "fit": "within",
}
ROBOTS_COUNTED = {
    "single_right": ("singles_right", "singles"),
    "pair_right": ("pairs_right", "pairs"),
    "false_alarms": ("alarms", "nulls"),
}
MACHINES_COUNTED = {
    "told": "counting",
    "sized": "parameters",
    "coverage_90": "parameters",
    "rollouts_within": "rollouts_within_of",
    "black_box_better": "black_box_better_of",
}
"""Figure -> of how many it is a share, where that is not the number of machines."""
FAILED = (*SIZES, "none", "unknown")
RIVALS = {
    "before": "base as it is",
    "tuned": "base, parameters tuned",
    "gp": "base + GP (the thesis)",
    "after": "base + named effects",
    "after_gp": "base + named effects + GP",
}


def proof_sheets(content: Json) -> list[Sheet]:
    """Goals, what stands beside them, rivals, strata, families and kinds."""
    first = (goals_sheet, shares_sheet, medians_sheet, rivals_sheet, namers_sheet)
    return [
        *(make(content) for make in first),
        *(made for make in (group_sheets, plan_sheets, strata_sheets) for made in make(content)),
        families_sheet(content),
        kinds_sheet(content),
    ]


def terminal_sheets(content: Json) -> list[Sheet]:
    """Those that a terminal shows: of the rough worlds what was said where what was called for."""
    sheets = [
        goals_sheet(content),
        *brief_sheets(content),
        *plan_sheets(content),
        rivals_sheet(content),
        namers_sheet(content),
    ]
    return [made for made in sheets if made.rows]


def goals_sheet(content: Json) -> Sheet:
    """What has to be reached and what was, wherever the proof has worlds that it is about."""

    def cells(name: str, goal: Json) -> tuple[Cell | str, ...]:
        part, key = name.split(".")
        block = content.get(part, {})
        bounds = _within(bounds_of(block, key), key.startswith("median"))
        got = Cell(significant(goal["got"]), marked=goal["reached"] is False)
        return GOALS[name].label, goal["wanted"], got, bounds, _number(part, key, block)

    return sheet(
        "What it must reach, on visible worlds of 2 000 to 12 000 transitions",
        ("", "wanted", "got", "95 %", "count"),
        (cells(name, goal) for name, goal in content["goals"].items() if goal["got"] is not None),
        note="outside: of the catalogue; near: at most 1.1 times the true model's own one-step error; rough: "
        "on rough worlds; machines: whole ones; whole robots: all joints at once; afloat: what floats or "
        "stands; curves: laws of no family; "
        "!: missed, also by the interval of a share or of a mean",
    )


def _number(part: str, key: str, block: Json) -> str:
    """What a figure counts: some of so many worlds, or so many where it is no count."""
    if part == "mjcf" and key in ROBOTS_COUNTED:
        some, every = ROBOTS_COUNTED[key]
        return f"{block[some]}/{block[every]}"
    if part in ("whole", "afloat") and key != "spurious":
        return f"{block[f'{key}_count']}/{block[f'{key}_of']}"
    if part == "machines" and key != "spurious":
        every = block[MACHINES_COUNTED.get(key, "n")]
        return f"{round(block[key] * every)}/{every}"
    if part == "curves":
        every = block["n"] - (block["failed"] if key == "named_wrong" else 0)
        return f"{round(block[key] * every)}/{every}"
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
    return sheet(
        "Part by part, on the same worlds",
        ("", "share", "95 %", "count"),
        (
            (label, significant(part["share"]), _within(part["interval"]), f"{part['right']}/{part['n']}")
            for label, part in parts.items()
            if part
        ),
        note=f"failed diagnoses: {', '.join(failed) or 'none'}; they count as wrong, and are left out of the shares "
        "of which less is better: false alarms, wrong names, undecided worlds",
    )


def medians_sheet(content: Json) -> Sheet:
    """Sizes of errors: medians and their bootstrap intervals."""
    location, parameters = content.get("location", {}), content.get("parameters")
    parts = {
        "region, IoU": (location.get("iou"), "median"),
        "onset, error over the recording's duration": (location.get("onset_error"), "median"),
        "parameters, error over the value": (parameters, "median_relative_error"),
        "parameters, error over what it changes": (parameters, "median_error_of_effect"),
        "held-out error over the true model's own": (content.get("fit"), "median"),
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
    return sheet("Sizes of errors", ("", "median", "95 %", "mean", "count"), rows)


def rivals_sheet(content: Json) -> Sheet:
    """Held-out one-step errors by several means."""
    found = [(words, r) for kind, r in content["rivals"].items() if (words := RIVALS.get(kind))]
    rows = (
        (words, str(r["n"]), significant(r["median"]), _within(r["interval_median"], True), *_shared(r))
        for words, r in found
    )
    return sheet(
        "Held-out one-step error over the true model's own, worst rate",
        ("", "worlds", "median ratio", "95 %", "% within 1.1", "95 %"),
        rows,
        note="all worlds with a mismatch, visible or not, those outside the catalogue among them",
    )


def plan_sheets(content: Json) -> list[Sheet]:
    """What each excitation decides, of the worlds that any decides."""
    plans = content.get("plans")
    if not plans:
        return []
    rows = (
        (
            kind,
            f"{k['resolved']}/{k['n']}",
            _within(k["interval"]),
            significant(k["median_seconds"]),
            str(k["left"]),
        )
        for kind, k in plans["kinds"].items()
    )
    note = (
        f"of {plans['drawn']} worlds a slow recording left {plans['open']} open, the truth among the explanations of "
        f"{plans['listed']}; some second recording of the same length decided {plans['n']}: all explanations fitted to "
        "both, the right one ahead by odds above ten"
    )
    columns = ("next recording", "resolved", "95 %", "seconds, median", "left the box")
    return [sheet("The next recording", columns, rows, note=note)]


def namers_sheet(content: Json) -> Sheet:
    """Who names more, where PySINDy's library holds the truth."""
    names = {
        "sindy": "PySINDy, what is missing",
        "diagnose_on_the_same": "gpsim diagnose, what is missing",
        "sindy_nothing": "PySINDy, that nothing is",
        "diagnose_on_the_same_nothing": "gpsim diagnose, that nothing is",
    }
    found = content["rivals"]
    return sheet(
        "Namers, where PySINDy's library holds the truth",
        ("", "worlds", "% right", "95 %"),
        ((label, str(found[k]["n"]), *_shared(found[k])) for k, label in names.items() if k in found),
        note="mechanical systems with every effect a term of its library and acting everywhere, visible or not",
    )


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


STRATUM = (
    "", "one", "two", "three", "false alarms", "outside: said so", "location", "parameter error %",
    "coverage %", "fit within 1.1", "seconds",
)  # fmt: skip


def _stratum(name: str, block: Json) -> tuple[str, ...]:
    counts = [(size, "right") for size in SIZES]
    counts += [("none", "false_alarms"), ("unknown", "said_so"), ("location", "right")]
    return (
        name,
        *(_share(block.get(part), key) for part, key in counts),
        *(_percent(block.get("parameters"), key) for key in ("median_relative_error", "coverage_90")),
        _share(block.get("fit"), "within"),
        fixed(block.get("seconds", {}).get("median")),
    )


def families_sheet(content: Json) -> Sheet:
    """Single effects by what they are."""
    rows = ((n, f"{f['right']}/{f['n']}", _within(f["interval"])) for n, f in content["families"].items())
    return sheet("Visible single effects by family", ("", "right", "95 %"), rows)


def kinds_sheet(content: Json) -> Sheet:
    """Physics outside the catalogue by what it is."""
    rows = ((n, f"{k['said_so']}/{k['n']}", str(k["named_wrong"])) for n, k in content["kinds"].items())
    return sheet("Outside the catalogue by kind", ("", "said so", "wrong name"), rows)


def _share(block: Json | None, name: str) -> str:
    return MISSING if block is None else f"{block[name]}/{block['n']}"


def _percent(block: Json | None, name: str) -> str:
    return MISSING if block is None or block[name] is None else fixed(100 * block[name])


def _within(bounds: Sequence[float] | None, median: bool = False) -> str:
    """An interval: of a share with three decimals, of a median with three digits."""
    if not bounds:
        return MISSING
    return "-".join(significant(edge) if median else fixed(edge, 3) for edge in bounds)


def _shared(block: Json) -> tuple[str, str]:
    """A share in per cent, and its interval."""
    low, high = block["interval"]
    return fixed(100 * block["share"]), f"{fixed(100 * low)}-{fixed(100 * high)}"
