"""The figures of rough worlds, robots, whole machines and curves, each with its interval, by strata and by family."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from gpsim.trials.statistics.blocks import (
    Score,
    by_strata,
    mean_of,
    median_of,
    missed,
    rates_of,
    seconds_of,
    verdicts_of,
)
from gpsim.trials.statistics.intervals import interval, mean_interval, median_interval, rate, share_interval

ROUGH_STRATA: Mapping[str, Callable[[Score], str]] = {
    "called for": lambda s: " or ".join(s["verdicts"]),
    "main effects": lambda s: str(s["main"]),
    "system": lambda s: str(s["system"]),
    "velocities": lambda s: str(s["velocities"] or "pose only"),
    "noise": lambda s: str(s["noise_level"]),
    "excitation": lambda s: str(s["excitation"]),
}


def rough_figures(scores: Sequence[Score]) -> dict[str, Any]:
    """Those of all worlds, by strata and by defect of the log, and what was said where what was called for."""
    defects = sorted({defect for s in scores for defect in s["defects"]})
    by = by_strata(scores, ROUGH_STRATA, rough_block)
    by["defect"] = {d: rough_block([s for s in scores if d in s["defects"]]) for d in defects}
    return {
        **rough_block(scores),
        "strata": by,
        "families": _found(scores),
        "verdicts": verdicts_of(scores),
        "misses": missed(scores),
    }


def rough_block(scores: Sequence[Score]) -> dict[str, Any]:
    """The figures of a set of rough worlds, each with its 95 % interval; None where there is nothing to count.

    A failed diagnosis finds nothing and its verdict is wrong; it does not count among the spurious effects, of which
    less is better. Equivalents of another size count in proportion.
    """
    answered = [s for s in scores if s["verdict"] != "failed"]
    main, found = sum(s["main"] for s in scores), sum(s["found"] * s["main"] for s in scores)
    covered = [bool(p["covered"]) for s in scores for p in s["parameters"]]
    verdict = rate([bool(s["verdict_right"]) for s in scores], "right")
    coverage = rate(covered, "covered")
    spurious, asserted = ([float(s[k]) for s in answered] for k in ("spurious", "asserted"))
    errors = [p["relative_error"] for s in scores for p in s["parameters"] if p["has_scale"]]
    return {
        "n": len(scores),
        "headline_found": found / main if main else None,
        "interval_headline_found": interval(round(found), main),
        "verdict_right": verdict["share"],
        "interval_verdict_right": verdict["interval"],
        "spurious": mean_of(spurious),
        "interval_spurious": mean_interval(spurious),
        "coverage_90": coverage["share"],
        "interval_coverage_90": coverage["interval"],
        "spurious_asserted": mean_of(asserted),
        "right": sum(bool(s["right"]) for s in scores),
        "main": main,
        "parameters": len(covered),
        "median_relative_error": median_of(errors),
        "failed": len(scores) - len(answered),
        "seconds": seconds_of(scores),
    }


def _found(scores: Sequence[Score]) -> dict[str, Any]:
    """Main effects by family: whether they, or a whole equivalent, were among the headline."""
    hits: dict[str, list[bool]] = {}
    for s in scores:
        for family, on in s["truth"]:
            hits.setdefault(family, []).append(s["found"] == 1.0 or [family, on] in s["said"])
    return rates_of(hits, "found")


ROBOT_SIZES = ("single", "pair")
ROBOT_STRATA: Mapping[str, Callable[[Score], str]] = {
    "robot": lambda s: str(s["system"]),
    "velocities": lambda s: str(s["velocities"] or "positions only"),
    "excitation": lambda s: str(s["excitation"]),
    "strength": lambda s: str(s["strength"] or "nothing missing"),
    "noise known": lambda s: "yes" if s["noise_known"] else "no",
}


def robot_figures(scores: Sequence[Score]) -> dict[str, Any]:
    """Those of all worlds, by strata, and of single effects by family."""
    by = by_strata(scores, ROBOT_STRATA, robot_block)
    return {
        **robot_block(scores),
        "strata": by,
        "families": _singles(scores),
        "misses": missed(scores),
    }


def robot_block(scores: Sequence[Score]) -> dict[str, Any]:
    """The figures of a set of robots' worlds, each with its 95 % interval; None where there is nothing to count.

    A failed diagnosis of a world with effects is wrong; of one without it is no alarm, and is left out of their share.
    """
    out: dict[str, Any] = {"n": len(scores)}
    for size in ROBOT_SIZES:
        part = [s for s in scores if s["stratum"] == size]
        found = rate([bool(s["right"]) for s in part], "right")
        out |= {f"{size}s": len(part), f"{size}s_right": found["right"], f"{size}_right": found["share"]}
        out[f"interval_{size}_right"] = found["interval"]
    nothing = [s for s in scores if s["stratum"] == "none" and s["verdict"] != "failed"]
    alarms = rate([bool(s.get("false_alarm")) for s in nothing], "alarms")
    values = [list(s.get("parameters", ())) for s in scores]
    errors = [[float(p["relative_error"]) for p in world if p["has_scale"]] for world in values]
    covered = [[bool(p["covered"]) for p in world] for world in values]
    count = sum(map(len, covered))
    flat = [e for world in errors for e in world]
    return out | {
        "nulls": len(nothing),
        "alarms": alarms["alarms"],
        "false_alarms": alarms["share"],
        "interval_false_alarms": alarms["interval"],
        "parameters": count,
        "median_relative_error": median_of(flat),
        "interval_median_relative_error": median_interval(errors),
        "coverage_90": sum(map(sum, covered)) / count if count else None,
        "interval_coverage_90": share_interval(covered),
        "right": sum(bool(s["right"]) for s in scores),
        "interval_right": interval(sum(bool(s["right"]) for s in scores), len(scores)),
        "failed": sum(s["verdict"] == "failed" for s in scores),
        "seconds": seconds_of(scores),
    }


def _singles(scores: Sequence[Score]) -> dict[str, Any]:
    singles = [s for s in scores if s["stratum"] == "single"]
    names = sorted({s["truth"][0][0] for s in singles})
    return {
        name: rate([bool(s["right"]) for s in singles if s["truth"][0][0] == name], "right") for name in names
    }


WITHIN = 1.3  # times the true model's own error after a rollout
CLEARLY = 0.95  # of the effects' error, that a black box must stay below to be better
MACHINE_STRATA: Mapping[str, Callable[[Score], str]] = {
    "class": lambda s: str(s["kind"]),
    "recordings": lambda s: str(s["recordings"]),
    "effects that count": lambda s: str(s["counting"]),
    "velocities": lambda s: str(s["velocities"] or "none"),
    "noise": lambda s: str(s["noise_level"]),
    "excitation": lambda s: str(s["excitation"]),
}


def machine_figures(scores: Sequence[Score]) -> dict[str, Any]:
    """Those of all machines, by strata and by family, and what was said where what was called for."""
    by = by_strata(scores, MACHINE_STRATA, machine_block)
    return {
        **machine_block(scores),
        "strata": by,
        "families": _told(scores),
        "spurious_families": _spurious(scores),
        "verdicts": verdicts_of(scores),
        "misses": missed(scores),
    }


def machine_block(scores: Sequence[Score]) -> dict[str, Any]:
    """The figures of a set of machines, each with its 95 % interval; None where there is nothing to count.

    A failed diagnosis tells nothing, its verdict is wrong and its rollouts are not near; it is left out of the shares
    of which less is better.
    """
    answered = [s for s in scores if s["verdict"] != "failed"]
    told = rate([t["told"] for s in scores for t in s["effects_told"] if t["counts"]], "told")
    parts = {
        "sized": rate([bool(p["sized"]) for s in scores for p in s["parameters"]], "sized"),
        "verdict_right": rate([bool(s["verdict_right"]) for s in scores], "right"),
        "rollouts_within": rate(near(scores), "within"),
        "black_box_better": rate(
            [s["black_box"] < CLEARLY for s in answered if s["black_box"] is not None], "better"
        ),
    }
    covered = [[bool(p["covered"]) for p in s["parameters"]] for s in scores]
    count, spurious = sum(map(len, covered)), [float(s["spurious"]) for s in answered]
    ratios = [[float(s["rollouts"])] for s in answered if s["rollouts"] is not None]
    errors = [p["error_of_effect"] for s in scores for p in s["parameters"] if p["has_scale"]]
    out: dict[str, Any] = {
        "n": len(scores),
        "told": told["share"],
        "interval_told": told["interval"],
        "counting": told["n"],
        "spurious": mean_of(spurious),
        "interval_spurious": mean_interval(spurious),
    }
    for name, part in parts.items():
        out |= {name: part["share"], f"interval_{name}": part["interval"], f"{name}_of": part["n"]}
    return out | {
        "coverage_90": sum(map(sum, covered)) / count if count else None,
        "interval_coverage_90": share_interval(covered),
        "parameters": count,
        "median_error_of_effect": median_of(errors),
        "median_rollouts": median_of([one for world in ratios for one in world]),
        "interval_median_rollouts": median_interval(ratios),
        "right": sum(bool(s["right"]) for s in scores),
        "failed": len(scores) - len(answered),
        "seconds": seconds_of(scores),
    }


def near(scores: Sequence[Score]) -> list[bool]:
    """Whether held-out rollouts are near the true model's; nothing of those where none could be compared."""
    return [
        s["verdict"] != "failed" and s["rollouts"] <= WITHIN
        for s in scores
        if s["verdict"] == "failed" or s["rollouts"] is not None
    ]


def _told(scores: Sequence[Score]) -> dict[str, Any]:
    """Effects that count by family and class of machine: whether they were told."""
    hits: dict[str, list[bool]] = {}
    for s in scores:
        for t in s["effects_told"]:
            if t["counts"]:
                hits.setdefault(f"{s['kind']}: {t['family']} on {t['on']}", []).append(bool(t["told"]))
    return rates_of(hits, "told")


def _spurious(scores: Sequence[Score]) -> dict[str, int]:
    """What was told and is not there, by family and class of machine."""
    found = Counter(f"{s['kind']}: {f} on {on}" for s in scores for f, on in s.get("spurious_names", ()))
    return dict(sorted(found.items()))


CURVE_STRATA: Mapping[str, Callable[[Score], str]] = {
    "system": lambda s: str(s["system"]),
    "velocities": lambda s: str(s["velocities"] or "pose only"),
    "noise": lambda s: str(s["noise_level"]),
    "strength": lambda s: str(s["strength"]),
    "excitation": lambda s: str(s["excitation"]),
}


def curve_figures(scores: Sequence[Score]) -> dict[str, Any]:
    """Those of all worlds with a law of no family, by strata, and by kind of law."""
    kinds = sorted({s["kind"] for s in scores})
    return {
        **curve_block(scores),
        "strata": by_strata(scores, CURVE_STRATA, curve_block),
        "families": {k: rate([bool(s["right"]) for s in scores if s["kind"] == k], "right") for k in kinds},
        "misses": missed(scores),
    }


def curve_block(scores: Sequence[Score]) -> dict[str, Any]:
    """The figures of a set of such worlds, each with its 95 % interval; None where there is nothing to count.

    A failed diagnosis has no curve; it is left out of the wrong names, of which less is better.
    """
    answered = [s for s in scores if s["verdict"] != "failed"]
    parts = {
        "curve_right": rate([bool(s["curve_right"]) for s in scores], "right"),
        "place_right": rate([bool(s["place_right"]) for s in scores], "right"),
        "named_wrong": rate([bool(s["named_wrong"]) for s in answered], "wrong"),
    }
    out: dict[str, Any] = {"n": len(scores)}
    for name, part in parts.items():
        out |= {name: part["share"], f"interval_{name}": part["interval"]}
    return out | {
        "median_off": median_of([float(s["off"]) for s in scores if s["off"] is not None]),
        "right": sum(bool(s["right"]) for s in scores),
        "failed": len(scores) - len(answered),
        "seconds": seconds_of(scores),
    }
