"""Figures of trips to a goal: in the policy's simulator and on the target (Figure 4.3), and the steps they took."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from matplotlib.patches import Circle, Rectangle

from gpsim.channels import FloatArray
from gpsim.reports.canvas import FAINT, INK, colours, panels, style
from gpsim.reports.loop_report import LoopReport, TripReport

SHOWN = ("Source", "GP-Mean", "GP-Sample", "Effects", "Target")
COLOURS = "viridis"


def figure_trips(report: LoopReport) -> Figure | None:
    """A panel a policy: solid on the target, coloured by the steps it took, dotted in its own simulator."""
    trips = report.trips
    names = [name for name in SHOWN if trips is not None and f"target/{name}" in trips.paths]
    if trips is None or not names:
        return None
    most = max(_steps(trips.paths[f"target/{name}"]).max() for name in names)
    norm = Normalize(0.0, float(most))
    with style():
        columns = min(3, len(names))
        rows = -(-len(names) // columns)
        figure, axes = panels(rows, columns, (11.0, 0.6 + 3.5 * rows), sharex=True, sharey=True)
        half = _reach(trips, names)
        for axis, name in zip(axes.flat, names, strict=False):
            draw_trips(axis, trips.paths[f"target/{name}"], trips.paths["goal"][0], trips.goal_radius, norm)
            for path in trips.paths[f"simulator/{name}"]:
                axis.plot(path[:, 0], path[:, 1], ":", color=INK, linewidth=0.9, alpha=0.75, zorder=2)
            _square(axis, trips.arena)
            _square(axis, trips.floor)
            axis.set_title(f"{name}: {_reached(trips, name)}")
            axis.set_xlim(-half, half)
            axis.set_ylim(-half, half)
            axis.set_aspect("equal")
        for axis in axes.flat[len(names) :]:
            axis.set_visible(False)
        for axis in axes[:, 0]:
            axis.set_ylabel("y [m]")
        for axis in axes[-1]:
            axis.set_xlabel("x [m]")
        bar = figure.colorbar(_mappable(norm), ax=axes, shrink=0.6, pad=0.02)
        bar.set_label("steps on the target")
        return figure


def figure_steps(report: LoopReport) -> Figure | None:
    """How many starts each policy has solved by a number of steps, over all seeds."""
    trips = report.trips
    if trips is None:
        return None
    colour = colours(report.policies)
    with style():
        figure, axes = panels(1, 2, (11.0, 3.4), sharey=True)
        halves = (("facing the goal", ~trips.behind), ("facing away", trips.behind))
        for axis, (words, starts) in zip(axes[0], halves, strict=True):
            for name in report.policies:
                steps, reached = trips.steps[name][:, starts].ravel(), trips.reached[name][:, starts].ravel()
                if steps.size:
                    at = np.sort(steps[reached])
                    share = 100.0 * np.arange(1, len(at) + 1) / steps.size
                    axis.step(
                        np.concatenate([[0.0], at, [report.best_return]]),
                        np.concatenate([[0.0], share, share[-1:] if len(share) else [0.0]]),
                        where="post", color=colour[name], label=name,
                    )  # fmt: skip
            axis.set_title(f"Starts {words}")
            axis.set_xlabel("steps")
        axes[0, 0].set_ylabel("goal reached [%]")
        axes[0, -1].legend(loc="center left", bbox_to_anchor=(1.0, 0.5))
        return figure


def draw_trips(axis: Axes, paths: FloatArray, goal: FloatArray, goal_radius: float, norm: Normalize) -> None:
    """Paths (H, T + 1, >= 2) coloured by their number of steps, how they begin (an arrow), and the goal."""
    for path, steps in zip(paths, _steps(paths), strict=True):
        known = path[np.isfinite(path[:, 0])]
        line = LineCollection([known[:, :2]], cmap=COLOURS, norm=norm, linewidths=1.7, zorder=3)
        line.set_array(np.array([steps]))
        axis.add_collection(line)
        if known.shape[1] > 2:
            x, y, yaw = known[0, :3]
            axis.annotate(
                "", (x + 0.14 * np.cos(yaw), y + 0.14 * np.sin(yaw)), (x, y), zorder=5,
                arrowprops={"arrowstyle": "->", "color": INK, "linewidth": 1.0},
            )  # fmt: skip
    axis.add_patch(Circle((float(goal[0]), float(goal[1])), goal_radius, color="#D55E00", zorder=4))


def _mappable(norm: Normalize) -> LineCollection:
    return LineCollection([], cmap=COLOURS, norm=norm)


def _steps(paths: FloatArray) -> FloatArray:
    return np.asarray(np.isfinite(paths[:, :, 0]).sum(axis=1) - 1, dtype=np.float64)


def _reached(trips: TripReport, name: str) -> str:
    ends = np.array([path[np.isfinite(path[:, 0])][-1, :2] for path in trips.paths[f"target/{name}"]])
    there = np.hypot(*(ends - trips.paths["goal"]).T) <= trips.goal_radius
    return f"{int(there.sum())} of {len(there)}"


def _reach(trips: TripReport, names: list[str]) -> float:
    far = max(float(np.nanmax(np.abs(trips.paths[f"target/{name}"][..., :2]))) for name in names)
    return min(1.1 * max(far, trips.arena / 2.0), 1.05 * trips.floor / 2.0)


def _square(axis: Axes, edge: float) -> None:
    axis.add_patch(
        Rectangle(
            (-edge / 2.0, -edge / 2.0), edge, edge, fill=False, color=FAINT, linewidth=0.9, linestyle="--"
        )
    )


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
        draw_trips(axis, padded, goal, goal_radius, norm)
        _square(axis, floor)
        half = min(1.15 * max(float(np.nanmax(np.abs(padded[..., :2]))), 0.5), 1.05 * floor / 2.0)
        axis.set(xlim=(-half, half), ylim=(-half, half), xlabel="x [m]", ylabel="y [m]", aspect="equal")
        axis.set_title("Recorded deployments")
        figure.colorbar(_mappable(norm), ax=axis, shrink=0.8).set_label("steps")
        return figure
