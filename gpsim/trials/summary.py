"""From the scores of all trials to figures with intervals: strata, headlines, confusion, misses; and the goals."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from gpsim.trials.figures import FIGURES, answered
from gpsim.trials.intervals import (
    Score,
    flat,
    median,
    rate,
    rates_by,
    share_interval,
    tally,
)

SCHEMA = "gpsim.prove/1"
SIZES = ("single", "pair", "triple")
NEAR_OWN = 1.1  # held-out error relative to the true model


def summarise(scores: Sequence[Score]) -> dict[str, Any]:
    """The content of prove.json, without what the caller knows of how it was run.

    The top level holds the headline strata: standard recordings whose effects are visible, and the rough worlds, the
    robots, the machines, the whole robots, what floats or stands, the curves, the plans and the newer families by
    themselves. `all` holds every plain world; `strata` the same figures by noise, strength, velocities, system, engine,
    excitation and visibility.
    """
    groups = {name: [s for s in scores if _group(s) == name] for name in (*FIGURES, "words")}
    plain = [s for s in scores if _group(s) not in FIGURES]
    standard = [s for s in plain if not s["long"] and _group(s) != "words"]
    words = [s for s in groups["words"] if not s["long"]]
    headline = [s for s in standard if s["visible"] or s["stratum"] == "none"]
    figures = block(headline) | {name: of(groups[name]) for name, of in FIGURES.items() if groups[name]}
    figures |= {"words": _words([s for s in words if s["visible"]])} if words else {}
    return {
        "schema": SCHEMA,
        **figures,
        "goals": goals(figures),
        "all": block(standard),
        "long": block([s for s in plain if s["long"]]),
        "identifiable": block([s for s in headline if s["identifiable"]]),
        "strata": {
            name: {
                str(v): block([s for s in part if key(s) == v])
                for v in sorted({key(s) for s in part}, key=str)
            }
            for name, (part, key) in _strata(standard, headline).items()
        },
        "families": _by_family(headline, "single"),
        "kinds": _by_kind(headline),
        "confusion": confusion(headline),
        "rivals": _rivals(standard),
        "misses": [s["trial"] for s in plain if not s["right"]],
        "failed": [s["trial"] for s in scores if s["verdict"] == "failed"],
        "contradictions": {s["trial"]: s["contradictions"] for s in scores if s.get("contradictions")},
        "not_scored": [s["trial"] for s in scores if not s.get("scored", True)],
    }


def _group(score: Score) -> str:
    """The part of the summary that a world stands in by itself, or its stratum."""
    return "mjcf" if "robot" in score else str(score["stratum"])


def block(scores: Sequence[Score]) -> dict[str, Any]:
    """The figures of a set of trials, in the contract's form; parts without a trial are left out."""
    out: dict[str, Any] = {"n": len(scores)}
    for size in SIZES:
        part = [s for s in scores if s["stratum"] == size]
        if part:
            out[size] = rate([s["right"] for s in part], "right") | {
                "leading_right": sum(bool(s["leading_right"]) for s in part),
                "families_right": sum(bool(s["families_right"]) for s in part),
                "failed": _failed(part),
            }
    with_effects = [s for s in scores if s["stratum"] in SIZES]
    decided = [s for s in answered(with_effects) if s["identifiable"]]
    counted = {
        "verdict_right": ([s["verdict_right"] for s in scores], "right"),
        "families_right": ([s["families_right"] for s in with_effects], "right"),
        "undecided": ([s["verdict"] in ("ambiguous", "partial", "unknown") for s in decided], "count"),
    }
    out |= {name: rate(hits, count) for name, (hits, count) in counted.items() if hits}
    if with_effects:
        out["location"] = location_figures(with_effects)
    if nothing := [s for s in scores if s["stratum"] == "none"]:
        # One that failed is neither an alarm nor quiet.
        alarms = rate([s.get("false_alarm") for s in answered(nothing)], "false_alarms")
        alarms["share_false"] = alarms.pop("share")
        quiet = sum(s["verdict"] == "none" for s in nothing)
        out["none"] = alarms | {"said_so": quiet, "failed": _failed(nothing)}
    if outside := [s for s in scores if s["stratum"] == "unknown" and s["identifiable"]]:
        wrong = rate([s.get("named_wrong") for s in answered(outside)], "named_wrong")
        out["unknown"] = rate([s.get("said_so") for s in outside], "said_so") | {
            "named_wrong": wrong["named_wrong"],
            "share_named_wrong": wrong["share"],
            "interval_named_wrong": wrong["interval"],
            "failed": _failed(outside),
        }
    out |= parameter_figures([s.get("parameters", []) for s in with_effects])
    worst = [w for s in with_effects if (w := worst_fit(s)) is not None]
    if worst:
        within = rate([w <= NEAR_OWN for w in worst], "within")
        out["fit"] = within | {"share_within": within["share"]} | median("median", [[w] for w in worst], 6)
    if seconds := [float(s["seconds"]) for s in scores]:
        out["seconds"] = median("median", [[t] for t in seconds], 2) | {"max": round(max(seconds), 2)}
    return out


def location_figures(scores: Sequence[Score]) -> dict[str, Any]:
    """Rate, place and gates all right; each of them; and how well the gates fit where there are any."""
    out = rate([s.get("location_right") for s in scores], "right")
    for part in ("rate_right", "place_right", "gate_right"):
        out[part] = rate([s.get(part) for s in scores], "right")
    for figure in ("iou", "onset_error"):
        values = [float(s[figure]) for s in scores if figure in s]
        if values:
            out[figure] = {"n": len(values), "mean": float(np.mean(values))}
            out[figure] |= median("median", [[v] for v in values], 6)
    return out


def parameter_figures(worlds: Sequence[Sequence[Mapping[str, Any]]]) -> dict[str, Any]:
    """Errors and coverage of all parameters of rightly named effects, world by world; nothing where there are none.

    Errors are relative to the value, and, `of_effect`, to how far the value is from what changes nothing.
    """
    count = len(flat(worlds))
    if not count:
        return {}
    covered = [[bool(p["covered"]) for p in world] for world in worlds]
    errors, of_effect = (
        [[p[error] for p in world if p["has_scale"]] for world in worlds]
        for error in ("relative_error", "error_of_effect")
    )
    quartiles = [float(q) for q in np.quantile(flat(errors), [0.25, 0.75])] if flat(errors) else None
    return {
        "parameters": {
            "n": count,
            **median("median_relative_error", errors, 6),
            "quartiles": quartiles,
            **median("median_error_of_effect", of_effect, 6),
            "coverage_90": sum(flat(covered)) / count,
            "interval": share_interval(covered),
        }
    }


def _failed(scores: Sequence[Score]) -> int:
    return len(scores) - len(answered(scores))


def worst_fit(score: Score, kind: str = "after") -> float | None:
    """A model's held-out error relative to the true model, in the rate where it is worst.

    Infinite where the diagnosis failed or what it corrected ran away; None where nothing was measured.
    """
    if score["verdict"] == "failed":
        return math.inf
    return max((kinds.get(kind, math.inf) for kinds in score.get("fit", {}).values()), default=None)


def confusion(scores: Sequence[Score]) -> dict[str, dict[str, int]]:
    """True family (or kind, or nothing) -> what was said first -> count, over worlds with at most one effect."""
    return tally(_told(s) for s in scores if s["stratum"] in ("single", "none", "unknown"))


def _told(s: Score) -> tuple[str, str]:
    truth = s["truth"][0][0] if s["truth"] else "nothing"
    said = sorted({family for family, _ in s["said"]})
    if s["leading_right"] and said != [truth]:
        said = [EQUIVALENT]
    word = s["verdict"] if s["verdict"] in ("unknown", "failed") else "nothing"
    return truth, " + ".join(said) if said and s["verdict"] != "unknown" else word


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


def _words(scores: Sequence[Score]) -> dict[str, Any]:
    """Visible worlds of newer families: how many are right, of which family, and how well sizes are known."""
    return rate([s["right"] for s in scores], "right") | {
        "identifiable": rate([s["right"] for s in scores if s["identifiable"]], "right"),
        "families": _by_family(scores, "words"),
        **parameter_figures([s.get("parameters", []) for s in scores]),
    }


def _by_family(scores: Sequence[Score], stratum: str) -> dict[str, Any]:
    return rates_by([(s["truth"][0][0], s["right"]) for s in scores if s["stratum"] == stratum], "right")


def _by_kind(scores: Sequence[Score]) -> dict[str, Any]:
    outside = [s for s in scores if s["stratum"] == "unknown" and s["identifiable"]]
    wrong = rates_by([(s["truth"][0][0], s.get("named_wrong")) for s in outside], "named_wrong")
    said = rates_by([(s["truth"][0][0], s.get("said_so")) for s in outside], "said_so")
    return {name: block | {"named_wrong": wrong[name]["named_wrong"]} for name, block in said.items()}


def _rivals(scores: Sequence[Score]) -> dict[str, Any]:
    """The same worlds by other means: held-out error relative to the true model; and who names what.

    A diagnosis that failed or a model that ran away counts as infinite.
    """
    out: dict[str, Any] = {}
    part = [s for s in scores if s["stratum"] in (*SIZES, "unknown") and worst_fit(s) is not None]
    for kind in ("before", "tuned", "gp", "after", "after_gp"):
        if any(kind in k for s in part for k in s.get("fit", {}).values()):
            worst = [worst_fit(s, kind) for s in part]
            near = rate([w is not None and w <= NEAR_OWN for w in worst], "within")
            out[kind] = near | median("median", [[w] for w in worst if w is not None], 6)
    return out | _namers(scores)


def _namers(scores: Sequence[Score]) -> dict[str, Any]:
    """PySINDy and the diagnosis on the worlds to which PySINDy applies; those with nothing to name apart."""
    out: dict[str, Any] = {}
    for suffix, nothing in (("", False), ("_nothing", True)):
        part = [s for s in scores if s.get("sindy") and (s["stratum"] == "none") == nothing]
        if part:
            out[f"sindy{suffix}"] = rate([s["sindy"]["right"] for s in part], "right")
            out[f"diagnose_on_the_same{suffix}"] = rate([s["right"] for s in part], "right")
    return out


EQUIVALENT = "an equivalent"  # said in place of the truth, and as right


class Goal(NamedTuple):
    """A figure's name in words, and what it must be at least or at most; coverage must not be too high either."""

    label: str
    sign: str
    wanted: float
    most: float | None = None


GOALS: Mapping[str, Goal] = {
    "single.share": Goal("one effect: right", ">=", 0.97),
    "pair.share": Goal("two effects: both right", ">=", 0.92),
    "triple.share": Goal("three effects: all right", ">=", 0.85),
    "location.share": Goal("rate, place and gate right", ">=", 0.97),
    "parameters.median_relative_error": Goal("parameters, median error", "<=", 0.05),
    "parameters.coverage_90": Goal("90 % intervals cover", ">=", 0.85, 0.95),
    "none.share_false": Goal("nothing missing: false alarms", "<=", 0.01),
    "unknown.share": Goal("outside: said so", ">=", 0.92),
    "unknown.share_named_wrong": Goal("outside: wrong name, odds > 10", "<=", 0.03),
    "rough.headline_found": Goal("rough: main effects among the headline effects", ">=", 0.90),
    "rough.verdict_right": Goal("rough: verdict right", ">=", 0.85),
    "rough.spurious": Goal("rough: spurious headline effects", "<=", 0.15),
    "rough.coverage_90": Goal("rough: 90 % intervals cover", ">=", 0.85, 0.95),
    "machines.told": Goal("machines: effects that count, found", ">=", 0.85),
    "machines.spurious": Goal("machines: spurious claims per world", "<=", 0.3),
    "machines.sized": Goal("machines: sizes within 15 % or the interval", ">=", 0.85),
    "machines.rollouts_within": Goal("machines: held-out rollouts within 1.3 of the truth", ">=", 0.90),
    "machines.black_box_better": Goal("machines: a black box is better", "<=", 0.05),
    "machines.verdict_right": Goal("machines: verdict right", ">=", 0.85),
    "machines.coverage_90": Goal("machines: 90 % intervals cover", ">=", 0.80, 0.95),
    "mjcf.single_right": Goal("robots: one effect right", ">=", 0.95),
    "mjcf.pair_right": Goal("robots: two effects, both right", ">=", 0.85),
    "mjcf.false_alarms": Goal("robots: nothing missing, false alarms", "<=", 0.02),
    "mjcf.median_relative_error": Goal("robots: parameters, median error", "<=", 0.05),
    "mjcf.coverage_90": Goal("robots: 90 % intervals cover", ">=", 0.85, 0.95),
    "whole.rows_right": Goal("whole robots: rows of friction and rotors right", ">=", 0.85),
    "whole.bodies_right": Goal("whole robots: bodies right or in a combination", ">=", 0.80),
    "whole.spurious": Goal("whole robots: spurious headline effects per robot", "<=", 0.3),
    "whole.rollouts_within": Goal("whole robots: held-out rollouts within 1.3 of the truth", ">=", 0.85),
    "whole.coverage_90": Goal("whole robots: 90 % intervals cover", ">=", 0.85, 0.95),
    "afloat.worlds_right": Goal("afloat: right, without spurious claims", ">=", 0.80),
    "afloat.false_alarms": Goal("afloat: nothing missing, false alarms", "<=", 0.02),
    "afloat.rollouts_within": Goal("afloat: held-out rollouts within 1.3 of the truth", ">=", 0.85),
    "afloat.coverage_90": Goal("afloat: 90 % intervals cover", ">=", 0.85, 0.95),
    "curves.curve_right": Goal("curves: within 10 % of the law's range", ">=", 0.85),
    "curves.place_right": Goal("curves: site and input right", ">=", 0.90),
    "curves.named_wrong": Goal("curves: a law of the catalogue said to hold", "<=", 0.05),
    "plans.resolved": Goal("plans: decided, of worlds that any excitation decides", ">=", 0.85),
    "plans.over_fixed": Goal("plans: median time relative to the best fixed excitation", "<=", 0.5),
    "plans.left": Goal("plans: left the box", "<=", 0.01),
    "undecided.share": Goal("undecided though identifiable", "<=", 0.05),
    "fit.share_within": Goal("held-out error close to the truth", ">=", 0.95),
    "seconds.median": Goal("seconds, median", "<=", 20.0),
    "seconds.max": Goal("seconds, longest", "<=", 60.0),
}
"""Figure (part and key of the summary) -> goal."""


def goals(figures: Mapping[str, Any]) -> dict[str, dict[str, Any]]:
    """Every goal, what was reached, and whether that is enough; None where nothing was measured.

    A share, or a mean count, is enough where its 95 % interval holds what is wanted or lies beyond it.
    """
    out = {}
    for name, goal in GOALS.items():
        part, key = name.split(".")
        block = figures.get(part, {})
        got = block.get(key)
        words = f"{goal.sign} {goal.wanted:g}" if goal.most is None else f"{goal.wanted:g}-{goal.most:g}"
        bounds = None if key.startswith("median") else bounds_of(block, key)
        reached = None if got is None else _reached(goal, got, bounds)
        out[name] = {"wanted": words, "got": got, "reached": reached}
    return out


def bounds_of(block: Mapping[str, Any], key: str) -> list[float] | None:
    """The interval of a figure of a block."""
    own = None if key == "max" else block.get("interval")
    found: list[float] | None = block.get(f"interval_{key.removeprefix('share_')}", own)
    return found


def _reached(goal: Goal, got: float, bounds: Sequence[float] | None) -> bool:
    low, high = (got, got) if bounds is None else (min(bounds[0], got), max(bounds[1], got))
    if goal.most is not None and low > goal.most:
        return False
    return bool(high >= goal.wanted if goal.sign == ">=" else low <= goal.wanted)
