"""The pictures of a diagnosis: of its account, and of where it differs, how the error runs and the worst rollouts."""

from __future__ import annotations

import base64
import math
from collections.abc import Callable, Mapping, Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Patch, Rectangle

from gpsim.channels import Channels
from gpsim.diagnosis import Diagnosis, Outcome
from gpsim.diagnosis.assessment import most_telling
from gpsim.findings import NamedEffect
from gpsim.reports import canvas
from gpsim.reports.account import left_share
from gpsim.reports.account_effects import effect_name, told_effects
from gpsim.reports.canvas import FAINT, GRID, beside, legend_above, named, panels, png, style
from gpsim.reports.diagnosis_text import noun
from gpsim.reports.quantities import LABEL, in_percent, number, percent, shortened
from gpsim.traces import BASE, COHERENT, EFFECTS, MEASURED, Course, Response, Trace, Traces

COLOURS = {BASE: "#D55E00", EFFECTS: "#0072B2"}
LINES = {BASE: (0, (4, 1.5)), EFFECTS: "-"}
NAMES: Mapping[str, str] = {BASE: "base", EFFECTS: "corrected"}
ROLLOUT, PARTS = "held_out_rollout", "decomposition"
WIDE = 5.4  # inches of a picture of the first screen
SHARP = 150.0  # dots an inch: it is shown smaller than it is drawn
CHANNELS = 2  # of a rollout: those that make most of the mismatch
INSIDE = 0.08  # of the bar: a narrower part has no room for its number
LABELS = 32  # letters of a part's name
MOST = 6  # parts with a name of their own; further ones stand together
BEYOND = 0.08  # of what was visited, that is drawn on either side of a measured curve

Contained = Callable[[str], AbstractContextManager[None]]


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


@dataclass(frozen=True)
class Part:
    """A part of the mismatch [1] and its colour."""

    name: str
    share: float
    colour: str


def account_figures(
    diagnosis: Diagnosis,
    state: Channels,
    traces: Traces | None,
    contained: Contained = lambda name: nullcontext(),
) -> dict[str, Picture]:
    """Name -> picture, of what the diagnosis holds; contained(name): the block in which that picture is drawn."""
    made: dict[str, Callable[[], Picture]] = {}
    if traces is not None and traces.traces:
        made[ROLLOUT] = lambda: _rollout(state, traces, corrected=any(told_effects(diagnosis)))
    if parts(diagnosis):
        made[PARTS] = lambda: _decomposition(parts(diagnosis))
    curved = [e for e in diagnosis.effects if e.curve and len(e.curve.values) == len(e.curve.at)]
    for i, effect in enumerate(curved, start=1):  # earlier versions had maps of two inputs, too
        made[f"measured_{i}"] = lambda effect=effect: measured_picture(effect)  # type: ignore[misc]
    return _drawn(made, contained)


def figures(
    found: Outcome,
    traces: Traces | None,
    course: Course | None,
    contained: Contained = lambda name: nullcontext(),
    response: Response | None = None,
) -> dict[str, Picture]:
    """Name -> picture; what is drawn comes computed, None is not drawn. contained: as in `account_figures`."""
    made: dict[str, Callable[[], Picture]] = {}
    if found.comparison.one_step:
        made["residual_inputs"] = lambda: _inputs(found)
    if course is not None:
        made["residual_time"] = lambda: _over_time(found, course)
    if traces is not None and traces.traces:
        made["traces"] = lambda: _traces(found, traces)
    if response is not None:
        made["frequency_response"] = lambda: _frequency(found, response)
    return _drawn(made, contained)


def _drawn(made: Mapping[str, Callable[[], Picture]], contained: Contained) -> dict[str, Picture]:
    drawn: dict[str, Picture] = {}
    with style():
        for name, make in made.items():
            with contained(name):
                drawn[name] = make()
    return drawn


def parts(diagnosis: Diagnosis) -> list[Part]:
    """The mismatch in its parts: headline effects, the most important first, slight ones together, what is left.

    Empty where nobody computed them; what explains less than nothing is no part.
    """
    headline, slight = told_effects(diagnosis)
    shares = [
        (f"{noun(e.family)} on {e.place}", e.importance.share) for e in headline if e.importance is not None
    ]
    if not shares or not all(math.isfinite(share) for _, share in shares):
        return []
    further = sum(share for _, share in shares[MOST:])
    lesser = sum(e.importance.share for e in slight if e.importance is not None)
    found = [Part(name, share, canvas.SEGMENTS[i]) for i, (name, share) in enumerate(shares[:MOST])]
    found += [Part(f"{len(shares) - MOST} more", further, FAINT)] if len(shares) > MOST else []
    found = [part for part in [*found, Part("small corrections", lesser, canvas.SLIGHT)] if part.share > 0.0]
    left = left_share(diagnosis)
    return [
        *found,
        Part("left", max(1.0 - sum(p.share for p in found), 0.0) if left is None else left, GRID),
    ]


def _decomposition(found: Sequence[Part]) -> Picture:
    """One stacked bar, and what its parts are below it."""
    figure, axes = panels(1, 1, (WIDE, 0.75 + 0.25 * math.ceil(len(found) / 2)))
    axis: Axes = axes[0, 0]
    at, whole = 0.0, max(sum(part.share for part in found), 1e-300)
    for part in found:
        width = part.share / whole
        axis.add_patch(Rectangle((at, 0.0), width, 1.0, facecolor=part.colour, edgecolor="white"))
        if width >= INSIDE:
            look: dict[str, Any] = {"ha": "center", "va": "center", "weight": "bold"}
            look["color"] = canvas.INK if part.colour in (GRID, canvas.SLIGHT) else "white"
            axis.text(at + width / 2, 0.5, f"{percent(part.share)} %", **look)
        at += width
    axis.set(xlim=(0.0, 1.0), ylim=(0.0, 1.0))
    axis.axis("off")
    labels = [f"{canvas.legend_label(part.name, LABELS)} {percent(part.share)} %" for part in found]
    handles = [Patch(facecolor=p.colour, label=label) for p, label in zip(found, labels, strict=True)]
    figure.legend(
        handles=handles, loc="outside lower left", ncols=2, handlelength=1.0, handleheight=1.0, fontsize=9
    )
    return Picture(
        "What the mismatch is made of",
        "Share of the squared rollout error beyond the noise that each effect removes (Shapley value).",
        png(figure, SHARP),
        [part.name for part in found],
    )


def _rollout(state: Channels, traces: Traces, *, corrected: bool) -> Picture:
    """The median stretch, or the only one: measured, by the base, and corrected by what the account tells."""
    trace, shown = traces.traces[-1], traces.shown[:CHANNELS]
    names = {"": "real", **{model: name for model, name in NAMES.items() if model != EFFECTS or corrected}}
    figure, axes = panels(len(shown), 1, (WIDE, 0.9 + 1.35 * len(shown)), sharex="col")
    for i, axis in enumerate(axes[:, 0]):
        _draw_trace(axis, trace, i, names, 1.4)
        axis.set_ylabel(beside(state.items[shown[i]].name, state.items[shown[i]].unit))
    axes[-1, 0].set_xlabel("t [s]")
    legend_above(figure, axes[0, 0], markerscale=2)
    which = "The median held-out stretch" if trace.place else "The held-out stretch"
    return Picture(
        "Real, base and corrected" if corrected else "Real and base",
        f"{which if traces.held_out else 'The stretch'} of episode {trace.name}, simulated in pieces of "
        f"{traces.horizon:.3g} s, each from a measured state.",
        png(figure, SHARP),
        [state.items[i].name for i in shown],
    )


def measured_picture(effect: NamedEffect) -> Picture:
    """A measured curve over its input."""
    curve = effect.curve
    assert curve is not None
    figure, axes = panels(1, 1, (WIDE, 3.0))
    axis: Axes = axes[0, 0]
    at = np.asarray(curve.at)
    if len(curve.low) == len(curve.high) == len(at):
        band: dict[str, Any] = {"color": COLOURS[EFFECTS], "alpha": 0.18, "linewidth": 0}
        axis.fill_between(at, curve.low, curve.high, label="90 %", **band)
    axis.plot(at, curve.values, color=COLOURS[EFFECTS], marker=".", markersize=3, label="measured")
    low, high = curve.visited
    wide = BEYOND * (high - low)
    for begin, end in ((low - wide, low), (high, high + wide)):
        axis.axvspan(begin, end, color=GRID, alpha=0.6, linewidth=0)
    axis.set_xlim(low - wide, high + wide)
    axis.set_xlabel(named(curve.input, curve.input_unit))
    axis.set_ylabel(named(curve.quantity, curve.unit, LABEL))
    legend_above(figure, axis)
    return Picture(
        f"No law of the catalogue: {effect_name(effect)}",
        f"{curve.quantity} over {curve.input}: measured, with its 90 % band; {curve.freedom:.0f} effective "
        "parameters. Grey: outside the visited range, where the curve is held constant.",
        png(figure),
        (curve.input, curve.quantity),
    )


def _inputs(found: Outcome) -> Picture:
    """The rate that stands out most against the two inputs that tell most of it, before and after."""
    comparison, simulator = found.comparison, found.question.everything.simulator
    ratio = {n: e.before / max(e.noise_floor, 1e-300) for n, e in comparison.one_step.items()}
    rate = simulator.rate.index(max(ratio, key=lambda name: ratio[name]))
    telling = most_telling(simulator, comparison, rate)
    channels = (*simulator.state, *simulator.action)
    names = [channel.name for channel in channels]
    before, after = comparison.left_before[:, rate], comparison.left_after[:, rate]
    low, high = np.quantile(before, [0.002, 0.998])
    margin = 0.15 * (high - low) + 1e-12
    outside = float(np.mean((before < low - margin) | (before > high + margin)))
    figure, axes = panels(1, len(telling), (9.0, 3.6))
    for axis, name in zip(axes[0], telling, strict=True):
        column = names.index(name)
        shown = {BASE: before} | ({EFFECTS: after} if found.judgement.leader.hypothesis.terms else {})
        for label, values in shown.items():
            look: dict[str, Any] = {"markersize": 2.5, "alpha": 0.4, "color": COLOURS[label]}
            axis.plot(comparison.inputs[:, column], values, ".", label=label, **look)
        axis.set_xlabel(named(name, channels[column].unit))
        # A sensor's leaps would flatten the rest: they are counted.
        axis.set_ylim(low - margin, high + margin)
    item = simulator.rate.items[rate]
    axes[0, 0].set_ylabel(f"residual of {named(item.name, item.unit, LABEL)}")
    if outside > 0:
        axes[0, -1].set_title(f"{in_percent(outside)} % lie outside", fontsize=9)
    legend_above(figure, axes[0, 0], markerscale=4)
    return Picture(
        "Residual against its two most important inputs",
        "Measured minus simulated rate of single transitions, each from the measured state.",
        png(figure),
        (item.name, *telling),
    )


def _over_time(found: Outcome, course: Course) -> Picture:
    channel = found.question.everything.simulator.state.items[course.channel]
    figure, axes = panels(1, 1, (9.0, 3.2))
    at = course.t if course.session else np.arange(len(course.t))
    for label, size in course.sizes.items():
        axes[0, 0].semilogy(at, np.maximum(size, 1e-12), ".", markersize=4, color=COLOURS[label], label=label)
    axes[0, 0].set_xlabel(_clock(found) if course.session else "window, in the order of the recording")
    axes[0, 0].set_ylabel(f"RMS error of {named(channel.name, channel.unit, LABEL)}")
    legend_above(figure, axes[0, 0], markerscale=2)
    return Picture(
        "Error over time, before and after",
        f"Every dot is a training window of {course.seconds:.3g} s, simulated from the measured state at its start; "
        "the base simulator uses its own step.",
        png(figure),
        (channel.name,),
    )


def _traces(found: Outcome, traces: Traces) -> Picture:
    """One column a stretch, one row a channel."""
    channels = [found.question.everything.simulator.state.items[i] for i in traces.shown]
    rows, columns, several = len(channels), len(traces.traces), len(traces.traces) > 1
    figure, axes = panels(rows, columns, (4.8 * columns + 0.6, 1.0 + 2.0 * rows), sharex="col")
    for trace, column in zip(traces.traces, axes.T, strict=True):
        what = f"{'' if trace.whole else 'part of '}episode {shortened(trace.name, LABEL)}"
        column[0].set_title(f"{trace.place}: {what}" if trace.place else what[0].upper() + what[1:], pad=20)
        column[-1].set_xlabel(_clock(found))
        for i, axis in enumerate(column):
            _draw_trace(axis, trace, i, {"": "measured"} | {label: label for label in trace.said}, 1.3)
            unit = shortened(channels[i].unit, canvas.LONGEST_UNIT)
            said_of = ", ".join(f"{k} {number(float(error[i]))} {unit}" for k, error in trace.errors.items())
            place = ((0.0, 1.0), (0, 5), "axes fraction", "offset points")
            axis.annotate(f"RMS error: {said_of}", *place, fontsize=8, color=FAINT)
    for axis, channel in zip(axes[:, 0], channels, strict=True):
        axis.set_ylabel(beside(channel.name, channel.unit))
    legend_above(figure, axes[0, 0], markerscale=2)
    judged = "base + effects" if EFFECTS in traces.traces[0].said else "the base simulator"
    which = f" Worst and median episode, by the error of {judged} in all channels." if several else ""
    what = "episode" if all(trace.whole for trace in traces.traces) else "stretch"
    return Picture(
        f"Measured and simulated: {'the worst and the median' if several else 'the only'} "
        f"{'held-out ' if traces.held_out else ''}{what}",
        f"Rollouts over {traces.horizon:.3g} s, as in the table above: each starts at a measured state.{which} The "
        "channels with most of the mismatch are shown. A line that leaves the plot has diverged.",
        png(figure),
        (*(c.name for c in channels), *(f"episode {trace.name}" for trace in traces.traces)),
    )


def _frequency(found: Outcome, response: Response) -> Picture:
    """Magnitude where what was measured is coherent, and the coherence beneath."""
    simulator = found.question.everything.simulator
    command, channel = simulator.action.items[response.command], simulator.state.items[response.channel]
    figure, axes = panels(2, 1, (WIDE, 4.2), sharex="col", height_ratios=(2, 1))
    for model, magnitude in response.magnitudes.items():
        look: dict[str, Any] = {"color": COLOURS.get(model, FAINT), "linestyle": LINES.get(model, "none")}
        look |= {"marker": ".", "markersize": 5} if model == MEASURED else {"linewidth": 1.6}
        shown = np.where(response.shown, magnitude, np.nan)
        axes[0, 0].loglog(response.f, shown, label=model or "measured", **look)
        axes[1, 0].semilogx(response.f, response.coherences[model], **look | {"markersize": 3})
    axes[1, 0].axhline(COHERENT, color=FAINT, linewidth=0.8)
    axes[1, 0].set(ylim=(0.0, 1.05), ylabel="coherence", xlabel="frequency [Hz]")
    units = [shortened(each.unit, canvas.LONGEST_UNIT) or "1" for each in (channel, command)]
    names = [shortened(each.name, LABEL) for each in (channel, command)]
    axes[0, 0].set_ylabel(f"{' by '.join(names)}\n[{' per '.join(units)}]")
    legend_above(figure, axes[0, 0])
    astray = [name for name in COLOURS if name not in response.magnitudes and EFFECTS in response.coherences]
    ran = f" {astray[0]} diverged and is not shown." if astray else ""
    return Picture(
        f"How {names[0]} answers {names[1]}, by frequency",
        f"Welch averages of {response.segments} segments of {response.seconds:.3g} s with half overlap over the "
        "whole recording; simulations run freely from the measured state at the start of each. Shown where at least "
        f"half of the measured power follows the command (coherence {COHERENT:g}).{ran} If a controller computes the "
        "command from noisy readings, the measured line is biased.",
        png(figure),
        (channel.name, command.name),
    )


def _draw_trace(axis: Axes, trace: Trace, column: int, names: Mapping[str, str], width: float) -> None:
    """A channel as measured and as models said; names: of those that are drawn, of the model "" what was measured.

    The axis shows what was measured in full, and of a model that goes astray no more than once as much beside it.
    """
    measured = trace.measured[:, column]
    axis.plot(trace.t, measured, ".", color=FAINT, markersize=3.5, label=names[""])
    for model, said in ((m, s[:, column]) for m, s in trace.said.items() if m in names):
        line: dict[str, Any] = {"color": COLOURS[model], "linestyle": LINES[model], "linewidth": width}
        axis.plot(trace.t, said, label=names[model], **line)
    low, high = float(np.nanmin(measured)), float(np.nanmax(measured))
    reach = max(high - low, 1e-12)
    every = np.concatenate([measured, *(said[:, column] for said in trace.said.values())])
    bottom, top = max(float(np.nanmin(every)), low - reach), min(float(np.nanmax(every)), high + reach)
    margin = 0.05 * max(top - bottom, 1e-12)
    axis.set_ylim(bottom - margin, top + margin)
    axis.ticklabel_format(useOffset=False)


def _clock(found: Outcome) -> str:
    return "t since the recording's start [s]" if found.question.origin else "t [s]"
