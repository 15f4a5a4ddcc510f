"""From the scores of all trials to figures with intervals: strata, headlines, confusion, misses."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
from scipy.stats import binomtest

SCHEMA = "gpsim.prove/1"
LEVEL = 0.95
Score = Mapping[str, Any]
SIZES = ("single", "pair", "triple")
GOALS: Mapping[str, tuple[str, float]] = {
    "single.share": (">=", 0.95),
    "pair.share": (">=", 0.88),
    "triple.share": (">=", 0.75),
    "location.share": (">=", 0.97),
    "parameters.median_relative_error": ("<=", 0.05),
    "parameters.coverage_90": (">=", 0.85),
    "none.share_false": ("<=", 0.01),
    "unknown.share": (">=", 0.90),
    "unknown.share_named_wrong": ("<=", 0.03),
    "undecided.share": ("<=", 0.05),
    "fit.share_within": (">=", 0.95),
    "seconds.median": ("<=", 20.0),
    "seconds.max": ("<=", 60.0),
}
"""What the proof has to reach."""
EQUIVALENT = "an equivalent"
NEAR_OWN = 1.1  # held-out error over the true model's own


def summarise(scores: Sequence[Score]) -> dict[str, Any]:
    """The content of prove.json, without what the caller knows of how it was run.

    The top level holds the headline strata: standard recordings whose effects are visible. `all` holds every world;
    `strata` the same figures by noise, strength, velocities, system, engine, excitation and visibility.
    """
    standard = [s for s in scores if not s["long"]]
    headline = [s for s in standard if s["visible"] or s["stratum"] == "none"]
    figures = block(headline)
    return {
        "schema": SCHEMA,
        **figures,
        "goals": goals(figures),
        "all": block(standard),
        "long": block([s for s in scores if s["long"]]),
        "identifiable": block([s for s in headline if s["identifiable"]]),
        "strata": {
            name: {str(value): block([s for s in part if key(s) == value]) for value in _values(part, key)}
            for name, (part, key) in _strata(standard, headline).items()
        },
        "families": _by_family(headline),
        "kinds": _by_kind(headline),
        "confusion": confusion(headline),
        "rivals": _rivals(standard),
        "misses": [s["trial"] for s in scores if not s["right"]],
        "failed": [s["trial"] for s in scores if s["verdict"] == "failed"],
        "not_scored": [s["trial"] for s in scores if not s.get("scored", True)],
    }


def block(scores: Sequence[Score]) -> dict[str, Any]:
    """The figures of a set of trials, in the contract's form; parts without a trial are left out."""
    out: dict[str, Any] = {"n": len(scores)}
    for size in SIZES:
        part = [s for s in scores if s["stratum"] == size]
        if part:
            out[size] = rate([s["right"] for s in part], "right") | {
                "leading_right": sum(bool(s["leading_right"]) for s in part),
                "families_right": sum(bool(s.get("families_right")) for s in part),
            }
    with_effects = [s for s in scores if s["stratum"] in SIZES]
    decided = [s for s in with_effects if s["identifiable"]]
    out |= _optional("undecided", [s["verdict"] in ("ambiguous", "unknown") for s in decided], "count")
    out |= _optional("location", [bool(s.get("location_right")) for s in with_effects], "right")
    nothing = [s for s in scores if s["stratum"] == "none"]
    if nothing:
        false = rate([bool(s.get("false_alarm")) for s in nothing], "false_alarms")
        false["share_false"] = false.pop("share")
        out["none"] = false | {"said_so": sum(s["verdict"] == "none" for s in nothing)}
    outside = [s for s in scores if s["stratum"] == "unknown" and s["identifiable"]]
    if outside:
        wrong = sum(bool(s.get("named_wrong")) for s in outside)
        out["unknown"] = rate([bool(s.get("said_so")) for s in outside], "said_so") | {
            "named_wrong": wrong,
            "share_named_wrong": wrong / len(outside),
            "interval_named_wrong": interval(wrong, len(outside)),
        }
    values = [p for s in with_effects for p in s.get("parameters", [])]
    if values:
        out["parameters"] = parameter_figures(values)
    worst = [w for s in with_effects if (w := worst_fit(s)) is not None]
    if worst:
        near = [w <= NEAR_OWN for w in worst]
        within = rate(near, "within")
        out["fit"] = within | {"share_within": within["share"], "median": float(np.median(worst))}
    seconds = [float(s["seconds"]) for s in scores]
    if seconds:
        out["seconds"] = {"median": round(float(np.median(seconds)), 2), "max": round(max(seconds), 2)}
    return out


def rate(hits: Sequence[bool], name: str) -> dict[str, Any]:
    """n, the count under `name`, its share, and the Wilson interval."""
    count, n = sum(map(bool, hits)), len(hits)
    return {"n": n, name: count, "share": count / n, "interval": interval(count, n)}


def interval(count: int, n: int) -> list[float]:
    """The 95 % Wilson score interval of a share (Wilson 1927)."""
    found = binomtest(count, n).proportion_ci(LEVEL, method="wilson")
    return [round(float(found.low), 4), round(float(found.high), 4)]


def parameter_figures(values: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """Median relative error and coverage of the 90 % intervals, of all parameters of rightly named effects."""
    errors = [p["relative_error"] for p in values if p["has_scale"]]
    covered = rate([p["covered"] for p in values], "covered")
    low, high = np.quantile(errors, [0.25, 0.75]) if errors else (float("nan"), float("nan"))
    return {
        "n": len(values),
        "median_relative_error": float(np.median(errors)) if errors else None,
        "quartiles": [float(low), float(high)] if errors else None,
        "coverage_90": covered["share"],
        "interval": covered["interval"],
    }


def worst_fit(score: Score) -> float | None:
    """The corrected simulator's held-out error over the true model's own, in the rate where it is worst.

    Infinite where the diagnosis failed or what it corrected ran away; None where nothing was measured.
    """
    if score["verdict"] == "failed":
        return math.inf
    return max((kinds.get("after", math.inf) for kinds in score.get("fit", {}).values()), default=None)


def goals(figures: Mapping[str, Any]) -> dict[str, dict[str, Any]]:
    """Every goal, what was reached, and whether that is enough."""
    out = {}
    for name, (sign, wanted) in GOALS.items():
        part, key = name.split(".")
        got = figures.get(part, {}).get(key)
        reached = None if got is None else bool(got >= wanted if sign == ">=" else got <= wanted)
        out[name] = {"wanted": f"{sign} {wanted:g}", "got": got, "reached": reached}
    coverage = figures.get("parameters", {}).get("coverage_90")
    if coverage is not None:
        out["parameters.coverage_90"] |= {"wanted": "0.85-0.95", "reached": 0.85 <= coverage <= 0.95}
    return out


def confusion(scores: Sequence[Score]) -> dict[str, dict[str, int]]:
    """True family (or kind, or nothing) -> what was said first -> count, over worlds with at most one effect."""
    table: dict[str, Counter[str]] = {}
    for s in scores:
        if s["stratum"] not in ("single", "none", "unknown"):
            continue
        truth = s["truth"][0][0] if s["truth"] else "nothing"
        said = sorted({family for family, _ in s["said"]})
        if s["leading_right"] and said != [truth]:
            said = [EQUIVALENT]
        word = s["verdict"] if s["verdict"] in ("unknown", "failed") else "nothing"
        table.setdefault(truth, Counter())[
            " + ".join(said) if said and s["verdict"] != "unknown" else word
        ] += 1
    return {truth: dict(sorted(row.items())) for truth, row in sorted(table.items())}


def _strata(
    standard: Sequence[Score], headline: Sequence[Score]
) -> dict[str, tuple[Sequence[Score], Callable[[Score], Any]]]:
    return {
        "visible": (standard, lambda s: s["visible"]),
        "noise": (headline, lambda s: s["noise_level"]),
        "strength": ([s for s in headline if s["strength"]], lambda s: s["strength"]),
        "velocities": (headline, lambda s: s["velocities"] or "pose only"),
        "system": (headline, lambda s: s["system"]),
        "engine": (headline, lambda s: s["engine"]),
        "excitation": (headline, lambda s: s["excitation"]),
        "gate": ([s for s in headline if s["stratum"] in SIZES], lambda s: s["gate"]),
        "noise_known": (headline, lambda s: s["noise_known"]),
    }


def _values(scores: Sequence[Score], key: Callable[[Score], Any]) -> list[Any]:
    return sorted({key(s) for s in scores}, key=str)


def _by_family(scores: Sequence[Score]) -> dict[str, Any]:
    names = sorted({s["truth"][0][0] for s in scores if s["stratum"] == "single"})
    return {
        name: rate(
            [s["right"] for s in scores if s["stratum"] == "single" and s["truth"][0][0] == name], "right"
        )
        for name in names
    }


def _by_kind(scores: Sequence[Score]) -> dict[str, Any]:
    outside = [s for s in scores if s["stratum"] == "unknown"]
    names = sorted({s["truth"][0][0] for s in outside})
    return {
        name: rate([bool(s.get("said_so")) for s in outside if s["truth"][0][0] == name], "said_so")
        | {"named_wrong": sum(bool(s.get("named_wrong")) for s in outside if s["truth"][0][0] == name)}
        for name in names
    }


def _rivals(scores: Sequence[Score]) -> dict[str, Any]:
    """The same worlds by other means: held-out error over the true model's own; and who names what."""
    out: dict[str, Any] = {}
    part = [s for s in scores if s["stratum"] in (*SIZES, "unknown") and s.get("fit")]
    for kind in ("before", "tuned", "gp", "after", "after_gp"):
        worst = [
            max(k[kind] for k in s["fit"].values()) for s in part if all(kind in k for k in s["fit"].values())
        ]
        if worst:
            near = rate([w <= NEAR_OWN for w in worst], "within")
            out[kind] = near | {"median": float(np.median(worst))}
    named = [s["sindy"] for s in scores if s.get("sindy")]
    if named:
        same = [s for s in scores if s.get("sindy")]
        out["sindy"] = rate([bool(n["right"]) for n in named], "right")
        out["diagnose_on_the_same"] = rate([bool(s["right"]) for s in same], "right")
    return out


def _optional(name: str, hits: Sequence[bool], count: str) -> dict[str, Any]:
    return {name: rate(hits, count)} if hits else {}
