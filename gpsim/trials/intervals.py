"""Shares, means and medians of scores with their 95 % intervals, and the same by name and by strata."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from gpsim.channels import FloatArray, IntArray

Score = Mapping[str, Any]
LEVEL = 0.95
RESAMPLES, SEED = 1000, 0


def rate(hits: Sequence[object], name: str) -> dict[str, Any]:
    """n, the count under `name`, its share, and the Wilson interval; no share of nothing."""
    count, n = sum(map(bool, hits)), len(hits)
    return {"n": n, name: count, "share": count / n if n else None, "interval": interval(count, n)}


def interval(count: int, n: int) -> list[float] | None:
    """The Wilson score interval of a share (Wilson 1927)."""
    if n == 0:
        return None
    from scipy.stats import binomtest  # here: pages without shares need not wait for it

    found = binomtest(count, n).proportion_ci(LEVEL, method="wilson")
    return [round(float(found.low), 4), round(float(found.high), 4)]


def share_interval(worlds: Sequence[Sequence[bool]]) -> list[float] | None:
    """The percentile bootstrap interval of the share of hits among all values; None where there are none.

    Worlds are drawn, as for a median: what goes wrong in a world goes wrong in all its values. Where all are hits, or
    none is, no draw differs from another: that is Wilson's interval of as many worlds.
    """
    worlds = [hits for hits in worlds if len(hits)]
    if not worlds:
        return None
    count, n = (np.array([f(hits) for hits in worlds]) for f in (sum, len))
    if count.sum() in (0, n.sum()):
        return interval(len(worlds) if count.any() else 0, len(worlds))
    often = _draws(len(worlds))
    return [round(edge, 4) for edge in _edges(often @ count / (often @ n))]


def mean_interval(values: Sequence[float]) -> list[float] | None:
    """The percentile bootstrap interval of the mean of a count a world; None where there are none.

    Where all are zero no draw differs: up to the Wilson interval's share of worlds that could have had one.
    """
    if not len(values):
        return None
    if not np.any(values):
        return interval(0, len(values))
    often = _draws(len(values))
    return [round(edge, 4) for edge in _edges(often @ np.asarray(values, dtype=np.float64) / len(values))]


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
    # (RESAMPLES, values) how many draws lie up to each value
    below = np.cumsum(_draws(len(worlds))[:, owner[order]], axis=1)
    middle = np.argmax(2 * below >= below[:, -1:], axis=1)
    return _edges(values[order][middle])


def share(name: str, hits: Sequence[bool]) -> dict[str, Any]:
    """A share under `name`, and its interval."""
    found = rate(hits, name)
    return {name: found["share"], f"interval_{name}": found["interval"]}


def mean(name: str, values: Sequence[float]) -> dict[str, Any]:
    """A mean under `name`, and its interval; each None of nothing."""
    return {name: float(np.mean(values)) if values else None, f"interval_{name}": mean_interval(values)}


def median(name: str, worlds: Sequence[Sequence[float]], digits: int | None = None) -> dict[str, Any]:
    """The median of all values of all worlds under `name`, and its interval, of so many digits; None of nothing."""
    found, bounds = median_of(flat(worlds)), median_interval(worlds)
    if digits is not None and found is not None and bounds is not None:
        found, bounds = round(found, digits), [round(edge, digits) for edge in bounds]
    return {name: found, f"interval_{name}": bounds}


def median_of(values: Sequence[float]) -> float | None:
    """None of nothing."""
    return float(np.median(values)) if values else None


def coverage(worlds: Sequence[Sequence[bool]]) -> dict[str, Any]:
    """The share of all parameters that their intervals cover, and its interval."""
    covered = flat(worlds)
    of_all = sum(covered) / len(covered) if covered else None
    return {"coverage_90": of_all, "interval_coverage_90": share_interval(worlds)}


def flat(worlds: Sequence[Sequence[Any]]) -> list[Any]:
    """All values of all worlds."""
    return [value for world in worlds for value in world]


def rates_by(pairs: Iterable[tuple[str, object]], name: str) -> dict[str, Any]:
    """The rate of every name that stands with hits."""
    hits: dict[str, list[object]] = {}
    for family, hit in pairs:
        hits.setdefault(family, []).append(hit)
    return {family: rate(there, name) for family, there in sorted(hits.items())}


def tally(pairs: Iterable[tuple[str, str]]) -> dict[str, dict[str, int]]:
    """How often what stands second was said of what stands first."""
    table: dict[str, Counter[str]] = {}
    for first, second in pairs:
        table.setdefault(first, Counter())[second] += 1
    return {first: dict(sorted(row.items())) for first, row in sorted(table.items())}


def _draws(worlds: int) -> IntArray:
    """(RESAMPLES, worlds): how often each world is drawn."""
    return np.random.default_rng(SEED).multinomial(worlds, np.full(worlds, 1 / worlds), RESAMPLES)


def _edges(resampled: FloatArray) -> list[float]:
    """Where the middle LEVEL of a figure's resamples begins and ends; infinite ones are figures, too."""
    edges = np.quantile(resampled, [(1 - LEVEL) / 2, (1 + LEVEL) / 2], method="nearest")
    return [float(edge) for edge in edges]
