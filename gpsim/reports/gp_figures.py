"""A residual along its most telling input, and the Gaussian process along the same line."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from gpsim.channels import FloatArray, IntArray
from gpsim.corrected import GpCorrection
from gpsim.reports.canvas import BAND, FAINT, GP, INK, LONGEST_UNIT, legend_above, named, panels, style
from gpsim.reports.loop_report import LoopReport, ResidualSlice
from gpsim.reports.quantities import LABEL, shortened
from gpsim.reports.sheets import significant
from gpsim.residuals import Residuals

BINS = 16
NEAREST = 0.25
"""The share of the training rows, closest to the slice, that count as lying on it."""


def residual_slices(
    residuals: Residuals, correction: GpCorrection, rows: IntArray
) -> dict[str, ResidualSlice]:
    """One slice per rate, each along its most telling input; rows: those that the GP was conditioned on."""
    return {name: residual_slice(residuals, correction, rows, name) for name in residuals.rate.names}


def residual_slice(
    residuals: Residuals,
    correction: GpCorrection,
    rows: IntArray,
    rate: str,
    channel: str | None = None,
    points: int = 401,
) -> ResidualSlice:
    """The residual of `rate` along `channel` (the most telling one if None) through the medians of the others.

    A median is a value that occurs, so that an action stays one that can be taken. The grid steps over zero
    in no width at all: an input that jumps there shows as a jump and not as a slope.
    """
    names, column = residuals.channels.names, residuals.rate.index(rate)
    inputs, targets = residuals.inputs[rows], residuals.values[rows, column]
    along = most_telling(inputs, targets) if channel is None else residuals.channels.index(channel)
    middle = np.quantile(inputs, 0.5, axis=0, method="closest_observation")
    grid = _grid(inputs[:, along], points)
    line = np.tile(middle, (len(grid), 1))
    line[:, along] = grid
    mean, variance = correction.predictor.mean_and_variance(correction.features(line))
    predicted = correction.predictor.mean(correction.features(inputs))[:, column]
    noise = correction.predictor.noise_variances[column]
    return ResidualSlice(
        rate=rate,
        channel=names[along],
        at={name: float(middle[i]) for i, name in enumerate(names) if i != along},
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


DEVIATIONS = 2.0
AT = 18  # letters of the names of what a slice holds


def figure_residual_slices(report: LoopReport) -> Figure | None:
    """Per rate the residual with the GP's mean, and what the mean leaves of it with the GP's band of +-2 std.

    Two rows because a good fit's band is too narrow to be seen on the residual's own scale.
    """
    slices = list(report.slices.values())
    if not slices:
        return None
    with style():
        figure, axes = panels(2, len(slices), (11.0, 6.2), height_ratios=(3, 2), sharex="col")
        for (upper, lower), cut in zip(axes.T, slices, strict=True):
            _residual(upper, cut, report)
            _left(lower, cut, report)
        legend_above(figure, axes[0, 0])
        return figure


def _residual(axis: Axes, cut: ResidualSlice, report: LoopReport) -> None:
    _points(axis, cut, cut.point_residuals)
    half = DEVIATIONS * cut.observed_std
    band: dict[str, Any] = {"color": BAND, "alpha": 0.7, "linewidth": 0, "label": "GP, ±2 std"}
    axis.fill_between(cut.grid, cut.mean - half, cut.mean + half, **band)
    axis.plot(cut.grid, cut.mean, color=GP, linewidth=1.8, label="GP, mean", zorder=3)
    axis.set_ylabel(f"residual of {named(cut.rate, report.unit(cut.rate), LABEL)}")
    others = (
        f"{shortened(name, AT)} = {significant(value, 2)} {shortened(report.unit(name), LONGEST_UNIT)}".strip()
        for name, value in cut.at.items()
    )
    axis.set_title(shortened(cut.rate), pad=19)
    look: Any = {"xycoords": "axes fraction", "textcoords": "offset points", "fontsize": 7.8, "color": FAINT}
    held = axis.annotate("slice at " + ", ".join(others), (0.0, 1.0), (0.0, 5.0), **look)
    held.set_in_layout(False)


def _left(axis: Axes, cut: ResidualSlice, report: LoopReport) -> None:
    _points(axis, cut, cut.point_errors)
    half = DEVIATIONS * cut.observed_std
    axis.fill_between(cut.grid, -half, half, color=BAND, alpha=0.7, linewidth=0)
    axis.axhline(0.0, color=GP, linewidth=1.4)
    axis.set_ylabel(f"left by the mean\n[{shortened(report.unit(cut.rate, '-'), LONGEST_UNIT)}]")
    axis.set_xlim(cut.grid[0], cut.grid[-1])
    axis.set_xlabel(named(cut.channel, report.unit(cut.channel)))


def _points(axis: Axes, cut: ResidualSlice, values: np.ndarray) -> None:
    far: dict[str, Any] = {"color": FAINT, "alpha": 0.25, "markersize": 3.5, "label": "training points"}
    near: dict[str, Any] = {
        "color": INK,
        "markersize": 4,
        "zorder": 4,
        "label": "the quarter nearest the slice",
    }
    for shown, look in ((~cut.near, far), (cut.near, near)):
        axis.plot(cut.point_inputs[shown], values[shown], "o", markeredgewidth=0, **look)
