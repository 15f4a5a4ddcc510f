"""Small statistics: interquartile mean, bootstrap intervals, normalised errors."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from gpsim.channels import FloatArray


def interquartile_mean(values: FloatArray) -> float:
    """Mean of the middle half (Agarwal et al. 2021, "Deep RL at the edge of the statistical precipice").

    As scipy.stats.trim_mean(values, 0.25), which is too slow for the inside of a bootstrap.
    """
    flat = np.asarray(values, dtype=np.float64).ravel()
    cut = flat.size // 4
    return float(np.partition(flat, (cut, flat.size - cut - 1))[cut : flat.size - cut].mean())


def bootstrap_interval(
    values: FloatArray, statistic: Callable[[FloatArray], float], *, level: float = 0.95, draws: int = 2000
) -> tuple[float, float]:
    """Percentile bootstrap interval of statistic(values) over the rows of `values` (N, ...).

    With seeds as the rows of (seeds, starts), whole seeds are drawn, and the starts that all of them share: a start
    that nobody solves counts once, however many seeds have tried it. The draws are the same at every call.
    """
    rng = np.random.default_rng(0)
    values = np.asarray(values, dtype=np.float64)
    found = np.empty(draws)
    for i in range(draws):
        rows = values[rng.integers(0, len(values), len(values))] if len(values) > 1 else values
        if values.ndim > 1:
            rows = rows[:, rng.integers(0, rows.shape[1], rows.shape[1])]
        found[i] = statistic(rows)
    tail = 50.0 * (1.0 - level)
    low, high = np.percentile(found, [tail, 100.0 - tail])
    return float(low), float(high)


def nrmse(predicted: FloatArray, actual: FloatArray, value_range: float | None = None) -> float:
    """Root mean square error over the range (max - min) of `actual`, or over `value_range`; NaN if that is 0."""
    scale = float(np.ptp(actual)) if value_range is None else value_range
    return float(np.sqrt(np.mean((predicted - actual) ** 2)) / scale) if scale > 0 else float("nan")


def r2(predicted: FloatArray, actual: FloatArray) -> float:
    """Coefficient of determination; NaN where `actual` does not vary."""
    total = float(np.sum((actual - actual.mean()) ** 2))
    return 1.0 - float(np.sum((predicted - actual) ** 2)) / total if total > 0 else float("nan")
