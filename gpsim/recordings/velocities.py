"""Velocities offline: smooth, then differentiate, with honest edges."""

from __future__ import annotations

from collections.abc import Sequence
from math import ceil

import numpy as np
from scipy.ndimage import gaussian_filter1d

from gpsim.channels import FloatArray
from gpsim.errors import UsageError
from gpsim.recordings.mapping import ImportMapping, Smoothing
from gpsim.recordings.raw import Topic

MOST_SAMPLES = 20_000_000  # of one piece or one log: 1 kHz for five hours
TRUNCATE = 4.0  # the Gaussian kernel ends at this many sigma


def reach(smoothing: Smoothing, derivative: bool) -> int:
    """Samples at either end that a full window cannot serve."""
    if smoothing.method == "savgol":
        return smoothing.window // 2
    kernel = ceil(TRUNCATE * smoothing.sigma) if smoothing.method == "gaussian" else 0
    return kernel + (1 if derivative else 0)


def even_grid(t: FloatArray) -> FloatArray:
    """Times (M,) from t[0] to t[-1] [s] in equal steps, as near as can be to the median interval of t."""
    usual = float(np.median(np.diff(t)))
    if (t[-1] - t[0]) / usual > MOST_SAMPLES:
        raise UsageError(
            f"{t[-1] - t[0]:.6g} s without a gap at a usual step of {usual:.3g} s are more than {MOST_SAMPLES:.0e} "
            "samples, too many to differentiate; a smaller gap_limit cuts them"
        )
    steps = max(1, round((t[-1] - t[0]) / usual))
    return np.linspace(t[0], t[-1], steps + 1)


def smoothed(values: FloatArray, smoothing: Smoothing) -> FloatArray:
    """Values (N,) on an even grid, smoothed; the ends by a line or polynomial fitted inside the data."""
    return _filtered(values, 1.0, smoothing, derivative=False)


def derivative(values: FloatArray, step: float, smoothing: Smoothing) -> FloatArray:
    """The rate of change (N,) per second of samples on an even grid of `step` [s].

    gaussian: Gaussian smoothing of sigma samples, then central differences; savgol: the derivative of the
    polynomial fitted in each window (Savitzky and Golay 1964); none: central differences. The first and last
    `reach` samples come from a one-sided fit; nothing is reflected.
    """
    return _filtered(values, step, smoothing, derivative=True)


def _filtered(values: FloatArray, step: float, smoothing: Smoothing, derivative: bool) -> FloatArray:
    edge = reach(smoothing, derivative)
    if len(values) < 2:
        return np.zeros_like(values) if derivative else values.copy()
    if smoothing.method == "savgol":
        from scipy.signal import savgol_coeffs  # here: half a second that most commands need not wait for

        kernel = savgol_coeffs(smoothing.window, smoothing.order, deriv=int(derivative), delta=step)
        inner = np.convolve(values, kernel, mode="same") if len(values) >= smoothing.window else values * 0.0
    else:
        inner = values
        if smoothing.method == "gaussian":
            inner = gaussian_filter1d(values, smoothing.sigma, mode="nearest", truncate=TRUNCATE)
        inner = np.gradient(inner, step) if derivative else inner
    inner = np.asarray(inner, dtype=np.float64).copy()
    # A piece that no window fits into is one-sided throughout.
    for i in sorted({*range(min(edge, len(values))), *range(max(len(values) - edge, 0), len(values))}):
        inner[i] = _one_sided(values, i, step, smoothing, derivative)
    return inner


def _one_sided(values: FloatArray, i: int, step: float, smoothing: Smoothing, derivative: bool) -> float:
    """A line (gaussian, none) or polynomial (savgol) through the samples that exist around sample i."""
    half = max(2, reach(smoothing, derivative=True))
    low, high = max(0, i - half), min(len(values), i + half + 1)
    x = np.arange(low, high) - float(i)
    weight = np.exp(-0.25 * (x / smoothing.sigma) ** 2) if smoothing.method == "gaussian" else np.ones(len(x))
    order = min(smoothing.order if smoothing.method == "savgol" else 1, len(x) - 1)
    powers = np.vander(x, order + 1, increasing=True)
    fit = np.linalg.lstsq(powers * weight[:, None], values[low:high] * weight, rcond=None)[0]
    return float(fit[1] / step if derivative else fit[0])


def finds_all(mapping: ImportMapping, topics: Sequence[Topic]) -> bool:
    """Whether every topic and field that the mapping names is there; channels without a topic want a single one."""
    only = topics[0].name if len(topics) == 1 else None
    held = {topic.name: {*topic.fields, *topic.texts} for topic in topics if not topic.fault}
    wanted = [
        (source.topic or only, source.fields) for source in (*mapping.state, *mapping.action) if source.fields
    ]
    if mapping.episodes.column is not None:
        wanted.append((mapping.episodes.topic or only, (mapping.episodes.column,)))
    for fields in mapping.episodes.variants.values():
        wanted += [(only, (field,)) for field in fields.values()]
    if mapping.time is not None:
        wanted += [(topic, mapping.time.fields) for topic, _ in tuple(wanted)]
    return all(topic in held and held[topic].issuperset(fields) for topic, fields in wanted)
