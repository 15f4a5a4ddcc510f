"""What the figures of every kind of special worlds have in common."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from gpsim.trials.statistics.intervals import rate

Score = Mapping[str, Any]

Block = Callable[[Sequence[Score]], dict[str, Any]]


def by_strata(
    scores: Sequence[Score], strata: Mapping[str, Callable[[Score], str]], block: Block
) -> dict[str, dict[str, Any]]:
    """The figures of a block for every value of every stratum."""
    return {
        name: {v: block([s for s in scores if key(s) == v]) for v in sorted({key(s) for s in scores})}
        for name, key in strata.items()
    }


def verdicts_of(scores: Sequence[Score]) -> dict[str, dict[str, int]]:
    """What was said where what was called for."""
    table: dict[str, Counter[str]] = {}
    for s in scores:
        table.setdefault(" or ".join(s["verdicts"]), Counter())[str(s["verdict"])] += 1
    return {wanted: dict(sorted(said.items())) for wanted, said in sorted(table.items())}


def rates_of(hits: Mapping[str, Sequence[bool]], name: str) -> dict[str, Any]:
    """Shares by name."""
    return {family: rate(there, name) for family, there in sorted(hits.items())}


def missed(scores: Sequence[Score]) -> list[Any]:
    """The trials that are not right in all."""
    return [s["trial"] for s in scores if not s["right"]]


def seconds_of(scores: Sequence[Score]) -> dict[str, float] | None:
    """Median and longest."""
    seconds = [float(s["seconds"]) for s in scores]
    return {"median": float(np.median(seconds)), "max": max(seconds)} if seconds else None


def median_of(values: Sequence[float]) -> float | None:
    """None of nothing."""
    return float(np.median(values)) if values else None


def mean_of(values: Sequence[float]) -> float | None:
    """None of nothing."""
    return float(np.mean(values)) if values else None
