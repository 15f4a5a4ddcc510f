"""Figures of policies: what they earn on the target, how they learnt, and how they reach a goal."""

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

from gpsim.channels import FloatArray
from gpsim.reports.canvas import FAINT, INK, colours, legend_above, named, panels, style
from gpsim.reports.loop_report import ALL, CERTIFIED, SOLVED, LoopReport, TripReport
from gpsim.reports.quantities import LABEL
from gpsim.reports.sheets import known, whole_percent

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
