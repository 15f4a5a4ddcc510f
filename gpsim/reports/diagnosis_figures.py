"""The pictures of a diagnosis: where it differs, how the error runs over time, and the worst and median rollouts."""

from __future__ import annotations

import base64
from collections.abc import Callable, Mapping, Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.axes import Axes

from gpsim.diagnosis import Outcome
from gpsim.diagnosis.assessment import most_telling
from gpsim.reports.canvas import FAINT, LABEL, LONGEST_UNIT, beside, legend_above, named, panels, png, style
from gpsim.reports.layout import Panels
from gpsim.reports.quantities import in_percent, number, shortened
from gpsim.traces import BASE, EFFECTS, Course, Trace, Traces

COLOURS = {BASE: "#D55E00", EFFECTS: "#0072B2"}
LINES = {BASE: (0, (4, 1.5)), EFFECTS: "-"}


@dataclass(frozen=True)
class Picture:
    """A figure of the page: what stands above and below it; shows: names in it, of which long ones are shortened."""

    title: str
    caption: str
    png: bytes
    shows: Sequence[str] = ()

    @property
    def source(self) -> str:
        """What a page shows as an image."""
        return f"data:image/png;base64,{base64.b64encode(self.png).decode()}"

    def _repr_png_(self) -> bytes:
        """What a notebook shows."""
        return self.png


def figures(
    found: Outcome,
    traces: Traces | None,
    course: Course | None,
    contained: Callable[[str], AbstractContextManager[None]] = lambda name: nullcontext(),
) -> dict[str, Picture]:
    """Name -> picture; what is drawn comes computed, None is not drawn.

    contained(name): the block in which that picture is drawn.
    """
    simulator = found.question.everything.simulator
    names = simulator.state.names
    with style():
        pictures = {}
        if found.comparison.one_step:
            with contained("residual_inputs"):
                rate, telling = _plainest(found)
                pictures["residual_inputs"] = Picture(
                    "Residual against its two most telling inputs",
                    "Measured minus simulated rate of single transitions, each from its measured state.",
                    _inputs(found),
                    (simulator.rate.names[rate], *telling),
                )
        if course is not None:
            with contained("residual_time"):
                pictures["residual_time"] = Picture(
                    "Error over time, before and after",
                    f"Every dot is a window of {course.seconds:.3g} s that the diagnosis learnt from, simulated from "
                    "the state that was measured at its start; the base simulator takes its own step.",
                    _over_time(found, course),
                    (names[course.channel],),
                )
        if traces is not None and traces.traces:
            with contained("traces"):
                pictures["traces"] = Picture(
                    _traces_title(traces),
                    _traces_caption(traces),
                    _traces(found, traces),
                    (
                        *(names[i] for i in traces.shown),
                        *(f"episode {trace.name}" for trace in traces.traces),
                    ),
                )
        return pictures


def _traces_title(traces: Traces) -> str:
    what = "episode" if all(trace.whole for trace in traces.traces) else "stretch"
    which = "the worst and the median" if len(traces.traces) > 1 else "the only"
    return f"Measured and simulated: {which} {'held-out ' if traces.held_out else ''}{what}"


def _traces_caption(traces: Traces) -> str:
    judged = "base + effects" if EFFECTS in traces.traces[0].said else "the base simulator"
    several = f" Worst and median by the error of {judged} in all channels." if len(traces.traces) > 1 else ""
    return (
        f"Rollouts over {traces.horizon:.3g} s, as in the table above: each starts at a measured state.{several} Shown "
        "are the channels in which the base simulator is furthest off. A line that leaves the picture has gone astray."
    )


def _plainest(found: Outcome) -> tuple[int, list[str]]:
    """The rate that stands out most, and the two inputs that tell most of it."""
    comparison, simulator = found.comparison, found.question.everything.simulator
    ratio = {n: e.before / max(e.noise_floor, 1e-300) for n, e in comparison.one_step.items()}
    rate = simulator.rate.index(max(ratio, key=lambda name: ratio[name]))
    return rate, most_telling(simulator, comparison, rate)


def _inputs(found: Outcome) -> bytes:
    """The rate that stands out most against the two inputs that tell most of it, before and after."""
    comparison, simulator = found.comparison, found.question.everything.simulator
    channels = (*simulator.state, *simulator.action)
    names = [channel.name for channel in channels]
    rate, telling = _plainest(found)
    before, after = comparison.left_before[:, rate], comparison.left_after[:, rate]
    low, high = np.quantile(before, [0.002, 0.998])
    margin = 0.15 * (high - low) + 1e-12
    outside = float(np.mean((before < low - margin) | (before > high + margin)))
    figure, axes = panels(1, len(telling), (9.0, 3.6), Panels())
    for axis, name in zip(axes[0], telling, strict=True):
        column = names.index(name)
        shown = {BASE: before} | ({EFFECTS: after} if found.judgement.leader.hypothesis.terms else {})
        for label, values in shown.items():
            at, look = (
                comparison.inputs[:, column],
                {"markersize": 2.5, "alpha": 0.4, "color": COLOURS[label]},
            )
            axis.plot(at, values, ".", label=label, **look)
        axis.set_xlabel(named(name, channels[column].unit))
        # A sensor's leaps would flatten the rest: they are counted.
        axis.set_ylim(low - margin, high + margin)
    item = simulator.rate.items[rate]
    axes[0, 0].set_ylabel(f"residual of {named(item.name, item.unit, LABEL)}")
    if outside > 0:
        axes[0, -1].set_title(f"{in_percent(outside)} % lie outside", fontsize=9)
    legend_above(figure, axes[0, 0], markerscale=4)
    return png(figure)


def _over_time(found: Outcome, course: Course) -> bytes:
    channel = found.question.everything.simulator.state.items[course.channel]
    figure, axes = panels(1, 1, (9.0, 3.2), Panels())
    at = course.t if course.session else np.arange(len(course.t))
    for label, size in course.sizes.items():
        axes[0, 0].semilogy(at, np.maximum(size, 1e-12), ".", markersize=4, color=COLOURS[label], label=label)
    axes[0, 0].set_xlabel(_clock(found) if course.session else "window, in the order of the recording")
    axes[0, 0].set_ylabel(f"RMS error of {named(channel.name, channel.unit, LABEL)}")
    legend_above(figure, axes[0, 0], markerscale=2)
    return png(figure)


def _traces(found: Outcome, traces: Traces) -> bytes:
    """One column a stretch, one row a channel."""
    channels = [found.question.everything.simulator.state.items[i] for i in traces.shown]
    rows, columns = len(channels), max(len(traces.traces), 1)
    figure, axes = panels(rows, columns, (4.8 * columns + 0.6, 1.0 + 2.0 * rows), Panels(), sharex="col")
    for trace, column in zip(traces.traces, axes.T, strict=True):
        column[0].set_title(_heading(trace), pad=20)
        column[-1].set_xlabel(_clock(found))
        for i, axis in enumerate(column):
            draw_trace(axis, trace, i, {"": "measured"} | {label: label for label in trace.said}, 1.3)
            unit = shortened(channels[i].unit, LONGEST_UNIT)
            said_of = ", ".join(f"{k} {number(float(error[i]))} {unit}" for k, error in trace.errors.items())
            place = ((0.0, 1.0), (0, 5), "axes fraction", "offset points")
            axis.annotate(f"RMS error: {said_of}", *place, fontsize=8, color=FAINT)
    for axis, channel in zip(axes[:, 0], channels, strict=True):
        axis.set_ylabel(beside(channel.name, channel.unit))
    legend_above(figure, axes[0, 0], markerscale=2)
    return png(figure)


def _heading(trace: Trace) -> str:
    what = f"{'' if trace.whole else 'part of '}episode {shortened(trace.name, LABEL)}"
    return f"{trace.place}: {what}" if trace.place else what[0].upper() + what[1:]


def draw_trace(axis: Axes, trace: Trace, column: int, names: Mapping[str, str], width: float) -> None:
    """A channel as measured and as models said; names: of those that are drawn, of the model "" what was measured."""
    axis.plot(trace.t, trace.measured[:, column], ".", color=FAINT, markersize=3.5, label=names[""])
    for model, said in ((m, s[:, column]) for m, s in trace.said.items() if m in names):
        line: dict[str, Any] = {"color": COLOURS[model], "linestyle": LINES[model], "linewidth": width}
        axis.plot(trace.t, said, label=names[model], **line)
    axis.set_ylim(*_limits(trace, column))
    axis.ticklabel_format(useOffset=False)


def _limits(trace: Trace, column: int) -> tuple[float, float]:
    """Of an axis: what was measured in full, and of a model that goes astray no more than once as much beside it."""
    measured = trace.measured[:, column]
    low, high = float(np.nanmin(measured)), float(np.nanmax(measured))
    reach = max(high - low, 1e-12)
    every = np.concatenate([measured, *(said[:, column] for said in trace.said.values())])
    bottom, top = max(float(np.nanmin(every)), low - reach), min(float(np.nanmax(every)), high + reach)
    margin = 0.05 * max(top - bottom, 1e-12)
    return bottom - margin, top + margin


def _clock(found: Outcome) -> str:
    return "t since the recording's start [s]" if found.question.origin else "t [s]"
