"""Figures of a loop: what policies earn on the target, how they learnt and reach a goal; and what the processes say.

That is a residual along its most telling input, and the Gaussian process along the same line.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from matplotlib.patches import Circle, Rectangle
from matplotlib.ticker import FuncFormatter

from gpsim.channels import FloatArray, IntArray
from gpsim.corrected import GpCorrection
from gpsim.reports.canvas import (
    BAND,
    FAINT,
    GP,
    INK,
    LONGEST_UNIT,
    colours,
    legend_above,
    named,
    panels,
    style,
)
from gpsim.reports.loop_report import ALL, CERTIFIED, SOLVED, LoopReport, ResidualSlice, TripReport
from gpsim.reports.quantities import LABEL, shortened
from gpsim.reports.sheets import known, significant, whole_percent
from gpsim.residuals import Residuals

BINS = 25
HILL = 0.62  # height of a row's highest bar, of the row
SET_TITLES = {SOLVED: "Solved by a Target policy", CERTIFIED: "Certified by the search", ALL: "All starts"}
"""Of a task whose every step earns 1: the returns of others are not drawn."""
EXAMPLES = 3  # of rollouts
DRAWN_LAST = ("Source", "GP-Sample", "GP-Mean", "Target")
TRIPS = ("Source", "GP-Mean", "GP-Sample", "Effects", "Target")  # policies whose paths are drawn


def figure_returns(report: LoopReport) -> Figure | None:
    """A column per set of starts, a row per policy: how the episodes' returns are distributed, and their mean.

    Outcomes are bimodal, so that a mean alone misleads: bars are shares of episodes per bin of return. None where
    no return is known, or where a task has a goal.
    """
    sets = [
        key for key in report.start_sets if any(report.episodes(key, name).size for name in report.policies)
    ]
    if not sets or report.trips is not None:
        return None
    count = len(report.policies)
    with style():
        figure, axes = panels(1, len(sets), (11.0, 1.1 + 0.95 * count), sharey=True)
        for axis, starts in zip(axes[0], sets, strict=True):
            _distribution(axis, report, starts)
            share = (report.summary.get("share") or {}).get(starts)
            axis.set_title(SET_TITLES[starts] + (f" ({whole_percent(share)})" if known(share) else ""))
        axes[0, 0].set_yticks(np.arange(count)[::-1], report.policies)
        axes[0, 0].set_ylim(-0.4, count - 0.25)
        figure.legend(*axes[0, 0].get_legend_handles_labels(), loc="outside lower left", ncols=5)
        return figure


def _distribution(axis: Axes, report: LoopReport, starts: str) -> None:
    colour, most = colours(report.policies), report.best_return
    edges = np.linspace(0.0, most, BINS + 1)
    bars: dict[str, Any] = {
        "align": "edge",
        "alpha": 0.75,
        "edgecolor": "white",
        "linewidth": 0.4,
        "zorder": 2,
    }
    for row, policy in enumerate(reversed(report.policies)):
        episodes = report.episodes(starts, policy)
        values = episodes[np.isfinite(episodes)]
        if values.size:
            share = np.histogram(np.clip(values, edges[0], edges[-1]), edges)[0] / values.size
            axis.bar(edges[:-1], HILL * share, np.diff(edges), bottom=row, color=colour[policy], **bars)
            full = "" if report.own_rewards else f"{whole_percent(report.full_share(starts, policy))} full"
            look: dict[str, Any] = {"ha": "right", "va": "bottom", "fontsize": 8.5, "color": FAINT}
            axis.annotate(full, (0.94 * most, row + 0.3), **look)
        axis.axhline(row, color=FAINT, linewidth=0.6, zorder=1)
        _mean(axis, report.stats(starts, policy), row - 0.14, first=row == len(report.policies) - 1)
    axis.set_xlim(-0.02 * most, 1.04 * most)
    axis.set_xlabel("return of an episode" if report.own_rewards else "return of an episode [steps]")
    axis.grid(visible=False, axis="y")
    axis.tick_params(axis="y", length=0)
    axis.spines["left"].set_visible(False)


def _mean(axis: Axes, stats: Mapping[str, Any], y: float, *, first: bool) -> None:
    """Mean with its interval and the seeds' means, below a row's bars."""
    mean, interval = stats.get("mean"), stats.get("interval")

    def label(text: str) -> str | None:
        return text if first else None

    if known(mean) and interval and known(interval[0]) and known(interval[1]):
        axis.plot(interval, [y, y], color=INK, linewidth=2.4, zorder=4, label=label("95 % interval"))
        axis.plot([mean], [y], "o", color=INK, markersize=5.5, zorder=5, label=label("mean"))
    seeds = [value for value in stats.get("by_seed") or [] if known(value)]
    if len(seeds) > 1:
        look: dict[str, Any] = {"color": INK, "markersize": 7, "markeredgewidth": 1.4, "zorder": 4}
        axis.plot(seeds, np.full(len(seeds), y - 0.13), "|", label=label("a seed's mean"), **look)


def figure_learning_curves(report: LoopReport) -> Figure | None:
    """Mean return in training over decisions by policy: each seed faint, their mean bold. None where none is known."""
    curves = {
        name: several for name, found in report.curves.items() if (several := [c for c in found if len(c[0])])
    }
    if not curves:
        return None
    colour = colours([*report.policies, *curves])
    with style():
        figure, axes = panels(1, 1, (11.0, 4.0))
        axis = axes[0, 0]
        for name, found in curves.items():
            for steps, values in found if len(found) > 1 else []:
                axis.plot(steps, values, color=colour[name], linewidth=0.8, alpha=0.35)
            axis.plot(*_mean_curve(found), color=colour[name], label=name)
        held = f"decisions in training, each held for {report.held} steps"
        axis.set_xlabel(held if report.held > 1 else "steps in training")
        axis.set_ylabel("mean return [steps]" if report.earns_steps else "mean return")
        axis.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:,.0f}".replace(",", "\u202f")))
        if report.earns_steps:
            axis.set_ylim(0.0, 1.05 * report.best_return)
        axis.set_xlim(left=0.0)
        axis.legend(loc="center left", bbox_to_anchor=(1.0, 0.5))
        return figure


def _mean_curve(found: list[tuple[FloatArray, FloatArray]]) -> tuple[FloatArray, FloatArray]:
    """The mean of the seeds' curves at the steps of the first, each curve held at its ends."""
    steps = np.asarray(found[0][0], dtype=np.float64)
    values = []
    for at, curve in found:
        good = np.isfinite(curve)
        values.append(np.interp(steps, at[good], curve[good]) if good.any() else np.full(len(steps), np.nan))
    stack = np.stack(values)
    counts = np.isfinite(stack).sum(axis=0)
    return steps, np.where(counts > 0, np.nansum(stack, axis=0) / np.maximum(counts, 1), np.nan)


def figure_rollouts(report: LoopReport) -> Figure | None:
    """Channels over time, a column per example: those that are no velocity, as in the thesis's Figure 4.2."""
    chosen = tuple(n for n in report.states if n not in report.velocities) or report.states
    paths = {name: path for name, path in report.rollouts.items() if path.size}
    if not paths or not chosen:
        return None
    examples = min(EXAMPLES, *(len(path) for path in paths.values()))
    colour = colours([*report.policies, *paths])
    # Target first, then the rest in the order in which they should lie above each other.
    ordered = sorted(paths, key=lambda name: -DRAWN_LAST.index(name) if name in DRAWN_LAST else 1)
    with style():
        figure, axes = panels(len(chosen), examples, (11.0, 0.7 + 2.3 * len(chosen)), sharex=True)
        for row, channel in enumerate(chosen):
            for example, axis in enumerate(axes[row]):
                for order, name in enumerate(ordered):
                    path = paths[name][example, :, report.states.index(channel)]
                    wide, alpha = (3.6, 0.45) if name == "Target" else (1.6, 1.0)
                    axis.plot(
                        report.dt * np.arange(len(path)), path, color=colour[name], label=name, zorder=3 - 0.1 * order,
                        linewidth=wide, alpha=alpha, linestyle="--" if name == "GP-Mean" else "-",
                    )  # fmt: skip
                limit = report.limits.get(channel)
                if limit is not None:
                    bounds = axis.get_ylim()
                    axis.axhspan(-limit, limit, color=FAINT, alpha=0.1, linewidth=0, zorder=0)
                    axis.set_ylim(bounds)
            axes[row, 0].set_ylabel(named(channel, report.unit(channel), LABEL))
        for example, axis in enumerate(axes[0]):
            axis.set_title(f"Start {example + 1}")
        for axis in axes[-1]:
            axis.set_xlabel("time [s]")
        legend_above(figure, axes[0, 0])
        return figure


def figure_trips(report: LoopReport) -> Figure | None:
    """A panel a policy: solid on the target, coloured by the steps it took, dotted in its own simulator."""
    trips = report.trips
    names = [name for name in TRIPS if trips is not None and f"target/{name}" in trips.paths]
    if trips is None or not names:
        return None
    targets = {name: trips.paths[f"target/{name}"] for name in names}
    norm = Normalize(0.0, float(max(_steps(paths).max() for paths in targets.values())))
    far = max(float(np.nanmax(np.abs(paths[..., :2]))) for paths in targets.values())
    half = min(1.1 * max(far, trips.arena / 2.0), 1.05 * trips.floor / 2.0)
    with style():
        columns = min(3, len(names))
        rows = -(-len(names) // columns)
        figure, axes = panels(rows, columns, (11.0, 0.6 + 3.5 * rows), sharex=True, sharey=True)
        for axis, name in zip(axes.flat, names, strict=False):
            _draw_trips(axis, targets[name], trips.paths["goal"][0], trips.goal_radius, norm)
            for path in trips.paths[f"simulator/{name}"]:
                axis.plot(path[:, 0], path[:, 1], ":", color=INK, linewidth=0.9, alpha=0.75, zorder=2)
            _frame(axis, half, trips.arena, trips.floor)
            axis.set_title(f"{name}: {_reached(trips, name)}")
        for axis in axes.flat[len(names) :]:
            axis.set_visible(False)
        for axis in axes[:, 0]:
            axis.set_ylabel("y [m]")
        for axis in axes[-1]:
            axis.set_xlabel("x [m]")
        bar = figure.colorbar(LineCollection([], cmap="viridis", norm=norm), ax=axes, shrink=0.6, pad=0.02)
        bar.set_label("steps on the target")
        return figure


def figure_deployed(
    paths: Sequence[FloatArray], goal: FloatArray, goal_radius: float, floor: float
) -> Figure:
    """Recorded trips (K_i + 1, >= 2), coloured by their number of steps."""
    longest = max(len(path) for path in paths)
    padded = np.full((len(paths), longest, paths[0].shape[1]), np.nan)
    for i, path in enumerate(paths):
        padded[i, : len(path)] = path
    norm = Normalize(0.0, float(max(1, longest - 1)))
    with style():
        figure, axes = panels(1, 1, (6.2, 5.2))
        axis = axes[0, 0]
        _draw_trips(axis, padded, goal, goal_radius, norm)
        half = min(1.15 * max(float(np.nanmax(np.abs(padded[..., :2]))), 0.5), 1.05 * floor / 2.0)
        _frame(axis, half, floor)
        axis.set(xlabel="x [m]", ylabel="y [m]", title="Recorded deployments")
        bar = figure.colorbar(LineCollection([], cmap="viridis", norm=norm), ax=axis, shrink=0.8)
        bar.set_label("steps")
        return figure


def _draw_trips(axis: Axes, paths: FloatArray, goal: FloatArray, goal_radius: float, norm: Normalize) -> None:
    """Paths (H, T + 1, >= 2) coloured by their number of steps, how they begin (an arrow), and the goal."""
    arrow = {"arrowstyle": "->", "color": INK, "linewidth": 1.0}
    for path, steps in zip(paths, _steps(paths), strict=True):
        there = path[np.isfinite(path[:, 0])]
        line = LineCollection([there[:, :2]], cmap="viridis", norm=norm, linewidths=1.7, zorder=3)
        line.set_array(np.array([steps]))
        axis.add_collection(line)
        if there.shape[1] > 2:
            x, y, yaw = there[0, :3]
            ahead = (x + 0.14 * np.cos(yaw), y + 0.14 * np.sin(yaw))
            axis.annotate("", ahead, (x, y), zorder=5, arrowprops=arrow)
    axis.add_patch(Circle((float(goal[0]), float(goal[1])), goal_radius, color="#D55E00", zorder=4))


def _steps(paths: FloatArray) -> FloatArray:
    return np.asarray(np.isfinite(paths[:, :, 0]).sum(axis=1) - 1, dtype=np.float64)


def _reached(trips: TripReport, name: str) -> str:
    ends = np.array([path[np.isfinite(path[:, 0])][-1, :2] for path in trips.paths[f"target/{name}"]])
    there = np.hypot(*(ends - trips.paths["goal"]).T) <= trips.goal_radius
    return f"{int(there.sum())} of {len(there)}"


def _frame(axis: Axes, half: float, *edges: float) -> None:
    """What is shown of a floor [m] about the origin, and dashed squares."""
    axis.set(xlim=(-half, half), ylim=(-half, half), aspect="equal")
    look: dict[str, Any] = {"fill": False, "color": FAINT, "linewidth": 0.9, "linestyle": "--"}
    for edge in edges:
        axis.add_patch(Rectangle((-edge / 2.0, -edge / 2.0), edge, edge, **look))


SLICE_BINS = 16
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
        [*np.quantile(column, np.linspace(0.0, 1.0, min(SLICE_BINS, max(2, count // 4)) + 1)[1:-1]), 0.0]
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
    axis.set_ylabel(f"remaining error\n[{shortened(report.unit(cut.rate, '-'), LONGEST_UNIT)}]")
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
