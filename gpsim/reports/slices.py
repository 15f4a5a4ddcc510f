"""A residual along its most telling input, and the Gaussian process along the same line."""

from __future__ import annotations

import numpy as np

from gpsim.channels import FloatArray, IntArray
from gpsim.corrected import GpCorrection
from gpsim.reports.loop_report import ResidualSlice
from gpsim.residuals import Residuals

BINS = 16
NEAREST = 0.25
"""The share of the training rows, closest to the slice, that count as lying on it."""


def residual_slices(
    residuals: Residuals, correction: GpCorrection, rows: IntArray, *, points: int = 401
) -> dict[str, ResidualSlice]:
    """One slice per rate, each along its most telling input; rows: those that the GP was conditioned on."""
    return {
        name: residual_slice(residuals, correction, rows, name, points=points)
        for name in residuals.rate.names
    }


def residual_slice(
    residuals: Residuals,
    correction: GpCorrection,
    rows: IntArray,
    rate: str,
    *,
    channel: str | None = None,
    points: int = 401,
) -> ResidualSlice:
    """The residual of `rate` along `channel` (the most telling one if None) through the medians of the others.

    A median is a value that occurs, so that an action stays one that can be taken. The grid steps over zero
    in no width at all: an input that jumps there shows as a jump and not as a slope.
    """
    column = residuals.rate.index(rate)
    inputs, targets = residuals.inputs[rows], residuals.values[rows, column]
    along = most_telling(inputs, targets) if channel is None else residuals.channels.index(channel)
    middle = np.quantile(inputs, 0.5, axis=0, method="closest_observation")
    grid = _grid(inputs[:, along], points)
    line = np.tile(middle, (len(grid), 1))
    line[:, along] = grid
    mean, variance = correction.predictor.mean_and_variance(correction.features(line))
    predicted = correction.predictor.mean(correction.features(inputs))[:, column]
    noise = correction.predictor.noise_variances[column]
    others = [name for i, name in enumerate(residuals.channels.names) if i != along]
    return ResidualSlice(
        rate=rate,
        channel=residuals.channels.names[along],
        at={name: float(middle[residuals.channels.index(name)]) for name in others},
        grid=grid,
        mean=mean[:, column],
        observed_std=np.sqrt(variance[:, column] + noise),
        point_inputs=inputs[:, along],
        point_residuals=targets,
        point_errors=targets - predicted,
        near=_near(inputs, middle, along),
    )


def most_telling(inputs: FloatArray, targets: FloatArray) -> int:
    """The column of inputs (N, D) whose value alone says most about targets (N,); the first of equals.

    Measured by the correlation ratio over bins of equal counts, corrected for the number of bins as an adjusted
    R2 is, so that a column with two values competes fairly with a continuous one.
    """
    return int(np.argmax([_explained(column, targets) for column in inputs.T]))


def _explained(column: FloatArray, targets: FloatArray) -> float:
    """Share of the variance of targets (N,) between bins of column (N,), adjusted for their number."""
    count = len(targets)
    # A bin edge at zero: a sign change is the commonest jump there is, and a bin across it would hide it.
    edges = np.unique(
        [*np.quantile(column, np.linspace(0.0, 1.0, min(BINS, max(2, count // 4)) + 1)[1:-1]), 0.0]
    )
    _, group = np.unique(np.searchsorted(edges, column, side="right"), return_inverse=True)
    bins = int(group.max()) + 1
    total = float(np.sum((targets - targets.mean()) ** 2))
    if bins < 2 or count <= bins or total <= 0.0:
        return 0.0
    means = np.bincount(group, weights=targets) / np.bincount(group)
    within = float(np.sum((targets - means[group]) ** 2))
    return 1.0 - within / total * (count - 1) / (count - bins)


def _grid(values: FloatArray, points: int) -> FloatArray:
    """Evenly over the range of values; where that crosses zero, the two numbers next to zero instead of zero."""
    low, high = float(values.min()), float(values.max())
    margin = 0.03 * (high - low) or 1.0
    grid = np.linspace(low - margin, high + margin, points)
    if grid[0] < 0.0 < grid[-1]:
        hair = 1e-9 * (high - low + margin)
        grid = np.sort(np.concatenate([grid[np.abs(grid) > hair], [-hair, hair]]))
    return grid


def _near(inputs: FloatArray, middle: FloatArray, along: int) -> np.ndarray:
    """(N,) True on the nearest quarter, by the largest distance in standard deviations over the other inputs."""
    others = np.delete(np.arange(inputs.shape[1]), along)
    spread = inputs[:, others].std(axis=0)
    scaled = np.abs(inputs[:, others] - middle[others]) / np.where(spread > 0.0, spread, 1.0)
    distance = scaled.max(axis=1) if others.size else np.zeros(len(inputs))
    return np.asarray(distance <= np.quantile(distance, NEAREST))
