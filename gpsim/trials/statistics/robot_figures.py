"""The figures of robots' worlds: singles, pairs, false alarms, parameters, coverage, seconds; by robot and family."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from gpsim.trials.statistics.intervals import interval, median_interval, rate, share_interval

Score = Mapping[str, Any]
SIZES = ("single", "pair")
STRATA: Mapping[str, Callable[[Score], str]] = {
    "robot": lambda s: str(s["system"]),
    "velocities": lambda s: str(s["velocities"] or "positions only"),
    "excitation": lambda s: str(s["excitation"]),
    "strength": lambda s: str(s["strength"] or "nothing missing"),
    "noise known": lambda s: "yes" if s["noise_known"] else "no",
}


def robot_figures(scores: Sequence[Score]) -> dict[str, Any]:
    """Those of all worlds, by strata, and of single effects by family."""
    by = {
        name: {v: robot_block([s for s in scores if key(s) == v]) for v in sorted({key(s) for s in scores})}
        for name, key in STRATA.items()
    }
    return {
        **robot_block(scores),
        "strata": by,
        "families": _families(scores),
        "misses": [s["trial"] for s in scores if not s["right"]],
    }


def robot_block(scores: Sequence[Score]) -> dict[str, Any]:
    """The figures of a set of robots' worlds, each with its 95 % interval; None where there is nothing to count.

    A failed diagnosis of a world with effects is wrong; of one without it is no alarm, and is left out of their share.
    """
    out: dict[str, Any] = {"n": len(scores)}
    for size in SIZES:
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
    seconds = [float(s["seconds"]) for s in scores]
    return out | {
        "nulls": len(nothing),
        "alarms": alarms["alarms"],
        "false_alarms": alarms["share"],
        "interval_false_alarms": alarms["interval"],
        "parameters": count,
        "median_relative_error": float(np.median(flat)) if flat else None,
        "interval_median_relative_error": median_interval(errors),
        "coverage_90": sum(map(sum, covered)) / count if count else None,
        "interval_coverage_90": share_interval(covered),
        "right": sum(bool(s["right"]) for s in scores),
        "interval_right": interval(sum(bool(s["right"]) for s in scores), len(scores)),
        "failed": sum(s["verdict"] == "failed" for s in scores),
        "seconds": {"median": float(np.median(seconds)), "max": max(seconds)} if seconds else None,
    }


def _families(scores: Sequence[Score]) -> dict[str, Any]:
    singles = [s for s in scores if s["stratum"] == "single"]
    names = sorted({s["truth"][0][0] for s in singles})
    return {
        name: rate([bool(s["right"]) for s in singles if s["truth"][0][0] == name], "right") for name in names
    }
