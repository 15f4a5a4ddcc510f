"""The figures of whole robots: rows of friction and rotors, bodies, what was said besides, rollouts, intervals."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any

from gpsim.trials.statistics.blocks import Score, by_strata, mean_of, median_of, missed, rates_of, seconds_of
from gpsim.trials.statistics.group_figures import WITHIN, near
from gpsim.trials.statistics.intervals import mean_interval, median_interval, rate, share_interval

SERVOS = "_servos"
STRATA: Mapping[str, Callable[[Score], str]] = {
    "robot": lambda s: str(s["system"]).removesuffix(SERVOS),
    "driven by": lambda s: "position servos" if s["servos"] else "motors",
    "read": lambda s: "speeds, too" if s["velocities"] else "positions in steps, rows lost",
    "bodies off": lambda s: str(len(s["bodies"])),
    "noise known": lambda s: "yes" if s["noise_known"] else "no",
}


def whole_figures(scores: Sequence[Score]) -> dict[str, Any]:
    """Those of all whole robots, by strata, by family and by joint, and what was said and is not there."""
    families: dict[str, list[bool]] = {}
    joints: dict[str, list[bool]] = {}
    for row in _counting(scores, "rows", "bodies"):
        family = "mass of a body" if row["family"] == "parameter_offset" else str(row["family"])
        families.setdefault(family, []).append(bool(row["right"]))
    for s in scores:
        for row in _counting([s], "rows"):
            joint = f"{STRATA['robot'](s)}: {row['on']}"
            joints.setdefault(joint, []).append(bool(row["right"]))
    found = Counter(family for s in scores for family, _ in s["spurious_names"])
    return {
        **whole_block(scores),
        "strata": by_strata(scores, STRATA, whole_block),
        "families": rates_of(families, "right"),
        "joints": rates_of(joints, "right"),
        "spurious_families": dict(sorted(found.items())),
        "misses": missed(scores),
    }


def whole_block(scores: Sequence[Score]) -> dict[str, Any]:
    """The figures of a set of whole robots, each with its 95 % interval; None where there is nothing to count.

    A failed diagnosis has no row and no body right, its verdict is wrong and its rollouts are not near; it says nothing
    that is not there.
    """
    answered = [s for s in scores if s["verdict"] != "failed"]
    parts = {
        "rows_right": rate([bool(r["right"]) for r in _counting(scores, "rows")], "right"),
        "rows_told": rate([bool(r["told"]) for r in _counting(scores, "rows")], "right"),
        "bodies_right": rate([bool(b["right"]) for b in _counting(scores, "bodies")], "right"),
        "rollouts_within": rate(near(scores), "right"),
        "verdict_right": rate([bool(s["verdict_right"]) for s in scores], "right"),
    }
    covered = [[bool(p["covered"]) for p in s["parameters"]] for s in scores]
    count, spurious = sum(map(len, covered)), [float(s["spurious"]) for s in answered]
    ratios = [[float(s["rollouts"])] for s in answered if s["rollouts"] is not None]
    out: dict[str, Any] = {"n": len(scores)}
    for name, part in parts.items():
        out |= {
            name: part["share"],
            f"interval_{name}": part["interval"],
            f"{name}_count": part["right"],
            f"{name}_of": part["n"],
        }
    return out | {
        "spurious": mean_of(spurious),
        "interval_spurious": mean_interval(spurious),
        "coverage_90": sum(map(sum, covered)) / count if count else None,
        "interval_coverage_90": share_interval(covered),
        "coverage_90_count": sum(map(sum, covered)),
        "coverage_90_of": count,
        "rollouts_limit": WITHIN,
        "median_rollouts": median_of([one for world in ratios for one in world]),
        "interval_median_rollouts": median_interval(ratios),
        "right": sum(bool(s["right"]) for s in scores),
        "failed": len(scores) - len(answered),
        "seconds": seconds_of(scores),
    }


def _counting(scores: Sequence[Score], *kinds: str) -> Iterator[Mapping[str, Any]]:
    """Every row, or body, that counts."""
    return (part for s in scores for kind in kinds for part in s[kind] if part["counts"])
