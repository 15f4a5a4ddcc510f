"""Figures of rollouts: the same start and actions in every simulator (Figure 4.2), and how far they drift apart."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from gpsim.reports.canvas import legend_above, panels, style
from gpsim.reports.lettering import LABEL, LONGEST_UNIT, named, shortened
from gpsim.reports.loop_report import LoopReport
from gpsim.reports.model_sheets import rollout_simulators
from gpsim.reports.palette import FAINT, colours
from gpsim.reports.sheets import unit

EXAMPLES = 3
DRAWN_LAST = ("Source", "GP-Sample", "GP-Mean", "Target")


def figure_rollouts(report: LoopReport, channels: tuple[str, ...] | None = None) -> Figure | None:
    """Channels over time, a column per example. Without a choice: those that are no velocity, as in Figure 4.2."""
    chosen = channels or tuple(n for n in report.states if n not in report.velocities) or report.states
    paths = {name: path for name, path in report.rollouts.items() if path.size}
    if not paths or not chosen:
        return None
    examples = min(EXAMPLES, *(len(path) for path in paths.values()))
    colour = colours([*report.policies, *paths])
    with style():
        figure, axes = panels(len(chosen), examples, (11.0, 0.7 + 2.3 * len(chosen)), sharex=True)
        for row, channel in enumerate(chosen):
            for example, axis in enumerate(axes[row]):
                for order, name in enumerate(_ordered(paths)):
                    path = paths[name][example, :, report.states.index(channel)]
                    target = name == "Target"
                    axis.plot(
                        report.dt * np.arange(len(path)), path, color=colour[name], label=name, zorder=3 - 0.1 * order,
                        linewidth=3.6 if target else 1.6, alpha=0.45 if target else 1.0,
                        linestyle="--" if name == "GP-Mean" else "-",
                    )  # fmt: skip
                limit = report.limits.get(channel)
                if limit is not None:
                    bounds = axis.get_ylim()
                    axis.axhspan(-limit, limit, color=FAINT, alpha=0.1, linewidth=0, zorder=0)
                    axis.set_ylim(bounds)
            axes[row, 0].set_ylabel(named(channel, unit(report.units.get(channel, "")), LABEL))
        for example, axis in enumerate(axes[0]):
            axis.set_title(f"Start {example + 1}")
        for axis in axes[-1]:
            axis.set_xlabel("time [s]")
        legend_above(figure, axes[0, 0])
        return figure


def _ordered(names: object) -> list[str]:
    """Target first, then the rest in the order in which they should lie above each other."""
    listed = list(names)  # type: ignore[call-overload]
    return sorted(listed, key=lambda name: -DRAWN_LAST.index(name) if name in DRAWN_LAST else 1)


def figure_divergence(report: LoopReport) -> Figure | None:
    """Distance to the target over time per channel: median and the band of 80 % of the rollouts, logarithmic."""
    simulators = {
        name: found["bands"] for name, found in rollout_simulators(report).items() if found.get("bands")
    }
    channels = list(dict.fromkeys(channel for found in simulators.values() for channel in found))
    if not channels:
        return None
    colour = colours([*report.policies, *simulators])
    step = float((report.summary.get("rollout") or {}).get("dt", report.dt))
    columns = 2 if len(channels) > 1 else 1
    rows = -(-len(channels) // columns)
    with style():
        figure, axes = panels(rows, columns, (11.0, 0.7 + 2.5 * rows), sharex=True)
        for axis, channel in zip(axes.flat, channels, strict=False):
            for name, found in simulators.items():
                if channel not in found:
                    continue
                low, middle, high = (_positive(found[channel][key]) for key in ("q10", "median", "q90"))
                t = step * np.arange(len(middle))
                axis.fill_between(t, low, high, color=colour[name], alpha=0.18, linewidth=0)
                dashed = name == "GP-Mean"  # lies on GP-Sample's where a sample scatters little
                axis.plot(
                    t,
                    middle,
                    "--" if dashed else "-",
                    color=colour[name],
                    label=name,
                    zorder=3 if dashed else 2,
                )
            if any(np.isfinite(line.get_ydata()).any() for line in axis.lines):
                axis.set_yscale("log")
            axis.set_title(shortened(channel))
            axis.set_ylabel(f"distance [{shortened(unit(report.units.get(channel, '-')), LONGEST_UNIT)}]")
        for axis in axes.flat[len(channels) :]:
            axis.set_visible(False)
        for axis in axes[-1]:
            axis.set_xlabel("time [s]")
        legend_above(figure, axes[0, 0])
        return figure


def _positive(values: object) -> np.ndarray:
    """Values as an array, those that a logarithm cannot show as NaN."""
    array = np.asarray(values, dtype=np.float64)
    return np.where(array > 0.0, array, np.nan)
