"""From the scores of all trials to figures with intervals: strata, headlines, confusion, misses."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from gpsim.trials.statistics.goals import EQUIVALENT, goals
from gpsim.trials.statistics.group_figures import (
    curve_figures,
    machine_figures,
    robot_figures,
    rough_figures,
)
from gpsim.trials.statistics.intervals import interval, median_interval, rate, share_interval
from gpsim.trials.statistics.plan_figures import plan_figures
from gpsim.trials.statistics.whole_figures import whole_figures

SCHEMA = "gpsim.prove/1"
Score = Mapping[str, Any]
SIZES = ("single", "pair", "triple")
NEAR_OWN = 1.1  # held-out error over the true model's own


def summarise(scores: Sequence[Score]) -> dict[str, Any]:
    """The content of prove.json, without what the caller knows of how it was run.

    The top level holds the headline strata: standard recordings whose effects are visible, and the rough worlds, the
    robots, the machines, the whole robots and the curves by themselves. `all` holds every plain world; `strata` the
    same figures by
    noise, strength, velocities, system, engine, excitation and visibility.
    """
    rough = [s for s in scores if s["stratum"] == "rough"]
    robots = [s for s in scores if "robot" in s]
    machines = [s for s in scores if s["stratum"] == "machines"]
    whole = [s for s in scores if s["stratum"] == "whole"]
    curves = [s for s in scores if s["stratum"] == "curves"]
    plans = [s for s in scores if s["stratum"] == "plans"]
    special = ("rough", "machines", "whole", "curves", "plans")
    plain = [s for s in scores if s["stratum"] not in special and "robot" not in s]
    standard = [s for s in plain if not s["long"]]
    words = [s for s in standard if s["stratum"] == "words"]
    standard = [s for s in standard if s["stratum"] != "words"]
    headline = [s for s in standard if s["visible"] or s["stratum"] == "none"]
    figures = block(headline) | ({"rough": rough_figures(rough)} if rough else {})
    figures |= {"mjcf": robot_figures(robots)} if robots else {}
    figures |= {"machines": machine_figures(machines)} if machines else {}
    figures |= {"whole": whole_figures(whole)} if whole else {}
    figures |= {"curves": curve_figures([s for s in curves if s["visible"]])} if curves else {}
    figures |= {"plans": plan_figures(plans)} if plans else {}
    figures |= {"words": _words([s for s in words if s["visible"]])} if words else {}
    return {
        "schema": SCHEMA,
        **figures,
        "goals": goals(figures),
        "all": block(standard),
        "long": block([s for s in plain if s["long"]]),
        "identifiable": block([s for s in headline if s["identifiable"]]),
        "strata": {
            name: {str(value): block([s for s in part if key(s) == value]) for value in _values(part, key)}
            for name, (part, key) in _strata(standard, headline).items()
        },
        "families": _by_family(headline),
        "kinds": _by_kind(headline),
        "confusion": confusion(headline),
        "rivals": _rivals(standard),
        "misses": [s["trial"] for s in plain if not s["right"]],
        "failed": [s["trial"] for s in scores if s["verdict"] == "failed"],
        "contradictions": {s["trial"]: s["contradictions"] for s in scores if s.get("contradictions")},
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
                "families_right": sum(bool(s["families_right"]) for s in part),
                "failed": _failed(part),
            }
    out |= _optional("verdict_right", [s["verdict_right"] for s in scores], "right")
    with_effects = [s for s in scores if s["stratum"] in SIZES]
    decided = [s for s in with_effects if s["identifiable"] and _answered(s)]
    out |= _optional("families_right", [s["families_right"] for s in with_effects], "right")
    out |= _optional(
        "undecided", [s["verdict"] in ("ambiguous", "partial", "unknown") for s in decided], "count"
    )
    if with_effects:
        out["location"] = location_figures(with_effects)
    nothing = [s for s in scores if s["stratum"] == "none"]
    if nothing:
        out["none"] = _without_mismatch(nothing)
    outside = [s for s in scores if s["stratum"] == "unknown" and s["identifiable"]]
    if outside:
        out["unknown"] = rate([bool(s.get("said_so")) for s in outside], "said_so")
        out["unknown"] |= _wrong_names([s for s in outside if _answered(s)]) | {"failed": _failed(outside)}
    out |= parameter_figures([s.get("parameters", []) for s in with_effects])
    worst = [w for s in with_effects if (w := worst_fit(s)) is not None]
    if worst:
        within = rate([w <= NEAR_OWN for w in worst], "within")
        out["fit"] = within | {"share_within": within["share"]} | _median("median", [[w] for w in worst])
    seconds = [float(s["seconds"]) for s in scores]
    if seconds:
        out["seconds"] = _median("median", [[t] for t in seconds], 2) | {"max": round(max(seconds), 2)}
    return out


def location_figures(scores: Sequence[Score]) -> dict[str, Any]:
    """Rate, place and gates all right; each of them; and how well the gates fit where there are any."""
    out = rate([bool(s.get("location_right")) for s in scores], "right")
    for part in ("rate_right", "place_right", "gate_right"):
        out[part] = rate([bool(s.get(part)) for s in scores], "right")
    for figure in ("iou", "onset_error"):
        values = [float(s[figure]) for s in scores if figure in s]
        if values:
            out[figure] = {"n": len(values), "mean": float(np.mean(values))}
            out[figure] |= _median("median", [[v] for v in values])
    return out


def parameter_figures(worlds: Sequence[Sequence[Mapping[str, Any]]]) -> dict[str, Any]:
    """Errors and coverage of all parameters of rightly named effects, world by world; nothing where there are none.

    Errors are relative to the value, and, `of_effect`, to how far the value is from what changes nothing.
    """
    values = [p for world in worlds for p in world]
    if not values:
        return {}
    covered = [[bool(p["covered"]) for p in world] for world in worlds]
    scaled = [[p for p in world if p["has_scale"]] for world in worlds]
    errors = [p["relative_error"] for world in scaled for p in world]
    return {
        "parameters": {
            "n": len(values),
            **_median("median_relative_error", [[p["relative_error"] for p in world] for world in scaled]),
            "quartiles": [float(q) for q in np.quantile(errors, [0.25, 0.75])] if errors else None,
            **_median("median_error_of_effect", [[p["error_of_effect"] for p in world] for world in scaled]),
            "coverage_90": sum(map(sum, covered)) / len(values),
            "interval": share_interval(covered),
        }
    }


def _without_mismatch(scores: Sequence[Score]) -> dict[str, Any]:
    """False alarms among the worlds that were given an answer: one that failed is neither an alarm nor quiet."""
    answered = [s for s in scores if _answered(s)]
    out = rate([bool(s.get("false_alarm")) for s in answered], "false_alarms")
    out["share_false"] = out.pop("share")
    return out | {"said_so": sum(s["verdict"] == "none" for s in answered), "failed": _failed(scores)}


def _wrong_names(answered: Sequence[Score]) -> dict[str, Any]:
    wrong = sum(bool(s.get("named_wrong")) for s in answered)
    return {
        "named_wrong": wrong,
        "share_named_wrong": wrong / len(answered) if answered else None,
        "interval_named_wrong": interval(wrong, len(answered)),
    }


def _answered(score: Score) -> bool:
    """Whether a diagnosis ended with an answer: shares of which less is better must not gain from failures."""
    return bool(score["verdict"] != "failed")


def _failed(scores: Sequence[Score]) -> int:
    return sum(not _answered(s) for s in scores)


def _median(name: str, worlds: Sequence[Sequence[float]], digits: int = 6) -> dict[str, Any]:
    """A median under `name` and its interval; each None where there is no value."""
    values = [v for world in worlds for v in world]
    bounds = median_interval(worlds)
    return {
        name: round(float(np.median(values)), digits) if values else None,
        f"interval_{name}": None if bounds is None else [round(edge, digits) for edge in bounds],
    }


def worst_fit(score: Score, kind: str = "after") -> float | None:
    """A model's held-out error over the true model's own, in the rate where it is worst.

    Infinite where the diagnosis failed or what it corrected ran away; None where nothing was measured.
    """
    if score["verdict"] == "failed":
        return math.inf
    return max((kinds.get(kind, math.inf) for kinds in score.get("fit", {}).values()), default=None)


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


def _words(scores: Sequence[Score]) -> dict[str, Any]:
    """Visible worlds of newer families: how many are right, of which family, and how well sizes are known."""
    right = rate([s["right"] for s in scores], "right")
    return right | {
        "identifiable": rate([s["right"] for s in scores if s["identifiable"]], "right"),
        "families": _by_family(scores, "words"),
        **parameter_figures([s.get("parameters", []) for s in scores]),
    }


def _by_family(scores: Sequence[Score], stratum: str = "single") -> dict[str, Any]:
    names = sorted({s["truth"][0][0] for s in scores if s["stratum"] == stratum})
    return {
        name: rate(
            [s["right"] for s in scores if s["stratum"] == stratum and s["truth"][0][0] == name], "right"
        )
        for name in names
    }


def _by_kind(scores: Sequence[Score]) -> dict[str, Any]:
    outside = [s for s in scores if s["stratum"] == "unknown" and s["identifiable"]]
    names = sorted({s["truth"][0][0] for s in outside})
    return {
        name: rate([bool(s.get("said_so")) for s in outside if s["truth"][0][0] == name], "said_so")
        | {"named_wrong": sum(bool(s.get("named_wrong")) for s in outside if s["truth"][0][0] == name)}
        for name in names
    }


def _rivals(scores: Sequence[Score]) -> dict[str, Any]:
    """The same worlds by other means: held-out error over the true model's own; and who names what.

    A diagnosis that failed or a model that ran away counts as infinite.
    """
    out: dict[str, Any] = {}
    part = [s for s in scores if s["stratum"] in (*SIZES, "unknown") and worst_fit(s) is not None]
    for kind in ("before", "tuned", "gp", "after", "after_gp"):
        if any(kind in k for s in part for k in s.get("fit", {}).values()):
            worst = [worst_fit(s, kind) for s in part]
            near = rate([w is not None and w <= NEAR_OWN for w in worst], "within")
            out[kind] = near | _median("median", [[w] for w in worst if w is not None])
    return out | _namers(scores)


def _namers(scores: Sequence[Score]) -> dict[str, Any]:
    """PySINDy and the diagnosis on the worlds to which PySINDy applies; those with nothing to name apart."""
    out: dict[str, Any] = {}
    both = [s for s in scores if s.get("sindy")]
    for suffix, part in (
        ("", [s for s in both if s["stratum"] != "none"]),
        ("_nothing", [s for s in both if s["stratum"] == "none"]),
    ):
        if part:
            out[f"sindy{suffix}"] = rate([bool(s["sindy"]["right"]) for s in part], "right")
            out[f"diagnose_on_the_same{suffix}"] = rate([bool(s["right"]) for s in part], "right")
    return out


def _optional(name: str, hits: Sequence[bool], count: str) -> dict[str, Any]:
    return {name: rate(hits, count)} if hits else {}
