"""The figures of whole machines: effects told, told and not there, sizes, held-out rollouts, verdicts, coverage."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from gpsim.trials.statistics.intervals import mean_interval, median_interval, rate, share_interval

Score = Mapping[str, Any]
WITHIN = 1.3  # times the true model's own error after a rollout
CLEARLY = 0.95  # of the effects' error, that a black box must stay below to be better
STRATA: Mapping[str, Callable[[Score], str]] = {
    "class": lambda s: str(s["kind"]),
    "recordings": lambda s: str(s["recordings"]),
    "effects that count": lambda s: str(s["counting"]),
    "velocities": lambda s: str(s["velocities"] or "none"),
    "noise": lambda s: str(s["noise_level"]),
    "excitation": lambda s: str(s["excitation"]),
}


def machine_figures(scores: Sequence[Score]) -> dict[str, Any]:
    """Those of all machines, by strata and by family, and what was said where what was called for."""
    by = {
        name: {v: machine_block([s for s in scores if key(s) == v]) for v in sorted({key(s) for s in scores})}
        for name, key in STRATA.items()
    }
    table: dict[str, Counter[str]] = {}
    for s in scores:
        table.setdefault(" or ".join(s["verdicts"]), Counter())[str(s["verdict"])] += 1
    return {
        **machine_block(scores),
        "strata": by,
        "families": _families(scores),
        "spurious_families": _spurious(scores),
        "verdicts": {wanted: dict(sorted(said.items())) for wanted, said in sorted(table.items())},
        "misses": [s["trial"] for s in scores if not s["right"]],
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
        "rollouts_within": rate(_near(scores), "within"),
        "black_box_better": rate(
            [s["black_box"] < CLEARLY for s in answered if s["black_box"] is not None], "better"
        ),
    }
    covered = [[bool(p["covered"]) for p in s["parameters"]] for s in scores]
    count, spurious = sum(map(len, covered)), [float(s["spurious"]) for s in answered]
    ratios = [[float(s["rollouts"])] for s in answered if s["rollouts"] is not None]
    errors = [p["error_of_effect"] for s in scores for p in s["parameters"] if p["has_scale"]]
    seconds = [float(s["seconds"]) for s in scores]
    out: dict[str, Any] = {
        "n": len(scores),
        "told": told["share"],
        "interval_told": told["interval"],
        "counting": told["n"],
        "spurious": float(np.mean(spurious)) if spurious else None,
        "interval_spurious": mean_interval(spurious),
    }
    for name, part in parts.items():
        out |= {name: part["share"], f"interval_{name}": part["interval"], f"{name}_of": part["n"]}
    return out | {
        "coverage_90": sum(map(sum, covered)) / count if count else None,
        "interval_coverage_90": share_interval(covered),
        "parameters": count,
        "median_error_of_effect": float(np.median(errors)) if errors else None,
        "median_rollouts": float(np.median(ratios)) if ratios else None,
        "interval_median_rollouts": median_interval(ratios),
        "right": sum(bool(s["right"]) for s in scores),
        "failed": len(scores) - len(answered),
        "seconds": {"median": float(np.median(seconds)), "max": max(seconds)} if seconds else None,
    }


def _near(scores: Sequence[Score]) -> list[bool]:
    """Whether held-out rollouts are near the true model's; nothing of those where none could be compared."""
    return [
        s["verdict"] != "failed" and s["rollouts"] <= WITHIN
        for s in scores
        if s["verdict"] == "failed" or s["rollouts"] is not None
    ]


def _families(scores: Sequence[Score]) -> dict[str, Any]:
    """Effects that count by family and class of machine: whether they were told."""
    hits: dict[str, list[bool]] = {}
    for s in scores:
        for t in s["effects_told"]:
            if t["counts"]:
                hits.setdefault(f"{s['kind']}: {t['family']} on {t['on']}", []).append(bool(t["told"]))
    return {name: rate(there, "told") for name, there in sorted(hits.items())}


def _spurious(scores: Sequence[Score]) -> dict[str, int]:
    """What was told and is not there, by family and class of machine."""
    found = Counter(f"{s['kind']}: {f} on {on}" for s in scores for f, on in s.get("spurious_names", ()))
    return dict(sorted(found.items()))
