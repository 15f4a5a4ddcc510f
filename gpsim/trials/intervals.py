"""95 % intervals of shares and of medians."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from scipy.stats import binomtest

LEVEL = 0.95
RESAMPLES, SEED = 1000, 0


def rate(hits: Sequence[bool], name: str) -> dict[str, Any]:
    """n, the count under `name`, its share, and the Wilson interval; no share of nothing."""
    count, n = sum(map(bool, hits)), len(hits)
    return {"n": n, name: count, "share": count / n if n else None, "interval": interval(count, n)}


def interval(count: int, n: int) -> list[float] | None:
    """The Wilson score interval of a share (Wilson 1927)."""
    if n == 0:
        return None
    found = binomtest(count, n).proportion_ci(LEVEL, method="wilson")
    return [round(float(found.low), 4), round(float(found.high), 4)]


def median_interval(worlds: Sequence[Sequence[float]]) -> list[float] | None:
    """The percentile bootstrap interval of the median of all values (Efron 1979); None where there are none.

    Worlds are drawn, not values: those of one world belong together. Infinite values are values.
    """
    worlds = [values for values in worlds if len(values)]
    if not worlds:
        return None
    values = np.concatenate([np.asarray(v, dtype=np.float64) for v in worlds])
    owner = np.repeat(np.arange(len(worlds)), [len(v) for v in worlds])
    order = np.argsort(values)
    often = np.random.default_rng(SEED).multinomial(
        len(worlds), np.full(len(worlds), 1 / len(worlds)), RESAMPLES
    )
    below = np.cumsum(
        often[:, owner[order]], axis=1
    )  # (RESAMPLES, values) how many draws lie up to each value
    middle = np.argmax(2 * below >= below[:, -1:], axis=1)
    medians = values[order][middle]
    edges = np.quantile(medians, [(1 - LEVEL) / 2, (1 + LEVEL) / 2], method="nearest")
    return [float(edge) for edge in edges]
