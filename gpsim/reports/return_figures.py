"""Figures of policies: what they earn on the target, and how they learnt."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter

from gpsim.channels import FloatArray
from gpsim.reports import thesis
from gpsim.reports.canvas import panels, style
from gpsim.reports.loop_report import ALL, CERTIFIED, SOLVED, LoopReport
from gpsim.reports.palette import FAINT, INK, colours
from gpsim.reports.sheets import known, whole_percent

BINS = 25
HILL = 0.62
"""Height of a row's highest bar, of the row."""
SET_TITLES = {
    SOLVED: "Solved by a Target policy",
    CERTIFIED: "Certified by the search",
    ALL: "All starts",
}
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
    figure = thesis.returns(report.system).get(policy)
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
