"""The figures of rough worlds: main effects found, verdicts right, spurious headline effects, coverage."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from gpsim.trials.statistics.intervals import interval, mean_interval, rate

Score = Mapping[str, Any]
STRATA: Mapping[str, Callable[[Score], str]] = {
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
    by = {
        name: {v: rough_block([s for s in scores if key(s) == v]) for v in sorted({key(s) for s in scores})}
        for name, key in STRATA.items()
    }
    by["defect"] = {d: rough_block([s for s in scores if d in s["defects"]]) for d in defects}
    table: dict[str, Counter[str]] = {}
    for s in scores:
        table.setdefault(STRATA["called for"](s), Counter())[str(s["verdict"])] += 1
    return {
        **rough_block(scores),
        "strata": by,
        "families": _families(scores),
        "verdicts": {wanted: dict(sorted(said.items())) for wanted, said in sorted(table.items())},
        "misses": [s["trial"] for s in scores if not s["right"]],
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
    seconds = [float(s["seconds"]) for s in scores]
    return {
        "n": len(scores),
        "headline_found": found / main if main else None,
        "interval_headline_found": interval(round(found), main),
        "verdict_right": verdict["share"],
        "interval_verdict_right": verdict["interval"],
        "spurious": float(np.mean(spurious)) if spurious else None,
        "interval_spurious": mean_interval(spurious),
        "coverage_90": coverage["share"],
        "interval_coverage_90": coverage["interval"],
        "spurious_asserted": float(np.mean(asserted)) if asserted else None,
        "right": sum(bool(s["right"]) for s in scores),
        "main": main,
        "parameters": len(covered),
        "median_relative_error": float(np.median(errors)) if errors else None,
        "failed": len(scores) - len(answered),
        "seconds": {"median": float(np.median(seconds)), "max": max(seconds)} if seconds else None,
    }


def _families(scores: Sequence[Score]) -> dict[str, Any]:
    """Main effects by family: whether they, or a whole equivalent, were among the headline."""
    hits: dict[str, list[bool]] = {}
    for s in scores:
        for family, on in s["truth"]:
            hits.setdefault(family, []).append(s["found"] == 1.0 or [family, on] in s["said"])
    return {family: rate(there, "found") for family, there in sorted(hits.items())}
