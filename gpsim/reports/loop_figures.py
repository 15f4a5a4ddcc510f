"""Figures of policies: what they earn on the target, and how they learnt."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter

from gpsim.channels import FloatArray
from gpsim.reports.canvas import FAINT, INK, LABEL, LONGEST_UNIT, colours, legend_above, named, panels, style
from gpsim.reports.loop_report import ALL, CERTIFIED, SOLVED, LoopReport, printed_returns
from gpsim.reports.model_sheets import rollout_simulators
from gpsim.reports.quantities import shortened
from gpsim.reports.sheets import known, unit, whole_percent

BINS = 25
HILL = 0.62
"""Height of a row's highest bar, of the row."""
SET_TITLES = {SOLVED: "Solved by a Target policy", CERTIFIED: "Certified by the search", ALL: "All starts"}
"""Of a task whose every step earns 1: the returns of others are not drawn."""


def figure_returns(report: LoopReport) -> Figure | None:
    """A column per set of starts, a row per policy: how the episodes' returns are distributed, and their mean.

    Outcomes are bimodal, so that a mean alone misleads: bars are shares of episodes per bin of return. None where
    no return is known.
    """
    sets = [
        key for key in report.start_sets if any(report.episodes(key, name).size for name in report.policies)
    ]
    if not sets:
        return None
    with style():
        height = 1.1 + 0.95 * len(report.policies)
        figure, axes = panels(1, len(sets), (11.0, height), sharey=True)
        for axis, starts in zip(axes[0], sets, strict=True):
            _distribution(axis, report, starts)
            share = (report.summary.get("share") or {}).get(starts)
            title = SET_TITLES[starts] + (f" ({whole_percent(share)})" if known(share) else "")
            axis.set_title(title)
        count = len(report.policies)
        axes[0, 0].set_yticks(np.arange(count)[::-1], report.policies)
        axes[0, 0].set_ylim(-0.4, count - 0.25)
        handles, labels = axes[0, 0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside lower left", ncols=5)
        return figure


def _distribution(axis: Axes, report: LoopReport, starts: str) -> None:
    colour = colours(report.policies)
    edges = np.linspace(0.0, report.best_return, BINS + 1)
    for row, policy in enumerate(reversed(report.policies)):
        episodes = report.episodes(starts, policy)
        values = episodes[np.isfinite(episodes)]
        if values.size:
            share = np.histogram(np.clip(values, edges[0], edges[-1]), edges)[0] / values.size
            axis.bar(
                edges[:-1], HILL * share, np.diff(edges), bottom=row, align="edge", color=colour[policy], alpha=0.75,
                edgecolor="white", linewidth=0.4, zorder=2,
            )  # fmt: skip
            full = "" if report.own_rewards else f"{whole_percent(report.full_share(starts, policy))} full"
            axis.annotate(
                full, (0.94 * report.best_return, row + 0.3), ha="right", va="bottom", fontsize=8.5, color=FAINT,
            )  # fmt: skip
        axis.axhline(row, color=FAINT, linewidth=0.6, zorder=1)
        _mean(axis, report, starts, policy, row - 0.14, first=row == len(report.policies) - 1)
    axis.set_xlim(-0.02 * report.best_return, 1.04 * report.best_return)
    axis.set_xlabel("return of an episode" if report.own_rewards else "return of an episode [steps]")
    axis.grid(visible=False, axis="y")
    axis.tick_params(axis="y", length=0)
    axis.spines["left"].set_visible(False)


def _mean(axis: Axes, report: LoopReport, starts: str, policy: str, y: float, *, first: bool) -> None:
    """Mean with its interval, the seeds' means and the thesis's mean, below a row's bars."""
    stats = report.stats(starts, policy)
    mean, interval = stats.get("mean"), stats.get("interval")
    if known(mean) and interval and known(interval[0]) and known(interval[1]):
        axis.plot(
            interval, [y, y], color=INK, linewidth=2.4, zorder=4, label="95 % interval" if first else None
        )
        axis.plot([mean], [y], "o", color=INK, markersize=5.5, zorder=5, label="mean" if first else None)
    seeds = [value for value in stats.get("by_seed") or [] if known(value)]
    if len(seeds) > 1:
        axis.plot(
            seeds, np.full(len(seeds), y - 0.13), "|", color=INK, markersize=7, markeredgewidth=1.4, zorder=4,
            label="a seed's mean" if first else None,
        )  # fmt: skip
    figure = printed_returns(report.system).get(policy)
    if figure is not None and starts != "returns_all":
        axis.plot(
            [figure.mean], [y], "D", markerfacecolor="white", markeredgecolor="#B00020", markersize=6, zorder=3,
            label="thesis's mean" if first else None,
        )  # fmt: skip


def figure_learning_curves(report: LoopReport) -> Figure | None:
    """Mean return in training over decisions. None where no curve is known."""
    held = f"decisions in training, each held for {report.held} steps"
    return _figure_of_curves(report, report.curves, held if report.held > 1 else "steps in training")


def figure_expert_rounds(report: LoopReport) -> Figure | None:
    """Mean return on fresh starts over rounds of expert iteration. None where no policy has any."""
    return _figure_of_curves(report, report.rounds, "rounds of expert iteration, after PPO")


def _figure_of_curves(
    report: LoopReport, known_curves: Mapping[str, Sequence[tuple[FloatArray, FloatArray]]], over: str
) -> Figure | None:
    """Mean return over `over` by policy: each seed faint, their mean bold. None where no curve is known."""
    curves = {name: [c for c in found if len(c[0])] for name, found in known_curves.items()}
    curves = {name: found for name, found in curves.items() if found}
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
        axis.set_xlabel(over)
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
