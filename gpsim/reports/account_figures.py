"""The pictures of an account: a held-out rollout, the mismatch in its parts, laws beside free curves."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Patch, Rectangle

from gpsim.channels import Channels
from gpsim.diagnosis import Diagnosis
from gpsim.findings import MeasuredCurve, NamedEffect
from gpsim.reports.account_effects import effect_name, told_effects
from gpsim.reports.account_sentences import left_share
from gpsim.reports.canvas import (
    FAINT,
    GRID,
    INK,
    LABEL,
    SEGMENTS,
    SLIGHT,
    beside,
    legend_above,
    legend_label,
    named,
    panels,
    png,
    style,
)
from gpsim.reports.diagnosis_figures import COLOURS, Picture, draw_trace
from gpsim.reports.diagnosis_text import noun
from gpsim.reports.layout import Panels
from gpsim.reports.quantities import percent
from gpsim.traces import BASE, EFFECTS, Traces

ROLLOUT, PARTS = "held_out_rollout", "decomposition"
NAMES: Mapping[str, str] = {BASE: "base", EFFECTS: "corrected"}
WIDE = 5.4  # inches of a picture of the first screen
SHARP = 150.0  # dots an inch: it is shown smaller than it is drawn
CHANNELS = 2  # of a rollout: those in which the base is furthest off
INSIDE = 0.08  # of the bar: a narrower part has no room for its number
LABELS = 32  # letters of a part's name
MOST = 6  # parts with a name of their own; further ones stand together

Contained = Callable[[str], AbstractContextManager[None]]


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
    drawn: dict[str, Picture] = {}
    with style():
        if traces is not None and traces.traces:
            with contained(ROLLOUT):
                drawn[ROLLOUT] = _rollout(state, traces, corrected=any(told_effects(diagnosis)))
        if parts(diagnosis):
            with contained(PARTS):
                drawn[PARTS] = _decomposition(diagnosis)
        curved = [e for e in diagnosis.effects if e.curve and len(e.curve.values) == len(e.curve.at)]
        for i, effect in enumerate(curved, start=1):  # earlier versions had maps of two inputs, too
            name = f"measured_{i}"
            with contained(name):
                drawn[name] = measured_picture(effect)
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
    found = [Part(name, share, SEGMENTS[i]) for i, (name, share) in enumerate(shares[:MOST])]
    found += [Part(f"{len(shares) - MOST} more", further, FAINT)] if len(shares) > MOST else []
    found += [Part("small corrections", lesser, SLIGHT)] if lesser > 0.0 else []
    found = [part for part in found if part.share > 0.0]
    left = left_share(diagnosis)
    found.append(Part("left", max(1.0 - sum(p.share for p in found), 0.0) if left is None else left, GRID))
    return found


def _decomposition(diagnosis: Diagnosis) -> Picture:
    """One stacked bar, and what its parts are below it."""
    found = parts(diagnosis)
    rows = math.ceil(len(found) / 2)
    figure, axes = panels(1, 1, (WIDE, 0.75 + 0.25 * rows), Panels())
    axis: Axes = axes[0, 0]
    at, whole = 0.0, max(sum(part.share for part in found), 1e-300)
    for part in found:
        width = part.share / whole
        axis.add_patch(Rectangle((at, 0.0), width, 1.0, facecolor=part.colour, edgecolor="white"))
        if width >= INSIDE:
            ink = INK if part.colour in (GRID, SLIGHT) else "white"
            middle = (at + width / 2, 0.5)
            axis.text(*middle, f"{percent(part.share)} %", color=ink, ha="center", va="center", weight="bold")
        at += width
    axis.set_xlim(0.0, 1.0)
    axis.set_ylim(0.0, 1.0)
    axis.axis("off")
    handles = [Patch(facecolor=part.colour, label=_labelled(part)) for part in found]
    figure.legend(
        handles=handles, loc="outside lower left", ncols=2, handlelength=1.0, handleheight=1.0, fontsize=9
    )
    return Picture(
        "What the mismatch is made of",
        "Shares of the squared error of rollouts beyond the noise that each effect takes off (Shapley).",
        png(figure, SHARP),
        [part.name for part in found],
    )


def _labelled(part: Part) -> str:
    return f"{legend_label(part.name, LABELS)} {percent(part.share)} %"


def _rollout(state: Channels, traces: Traces, *, corrected: bool) -> Picture:
    """The median stretch, or the only one: measured, by the base, and corrected by what the account tells."""
    trace = traces.traces[-1]
    names = {"": "real", **{model: name for model, name in NAMES.items() if model != EFFECTS or corrected}}
    shown = traces.shown[:CHANNELS]
    figure, axes = panels(len(shown), 1, (WIDE, 0.9 + 1.35 * len(shown)), Panels(), sharex="col")
    for i, axis in enumerate(axes[:, 0]):
        draw_trace(axis, trace, i, names, 1.4)
        channel = state.items[traces.shown[i]]
        axis.set_ylabel(beside(channel.name, channel.unit))
    axes[-1, 0].set_xlabel("t [s]")
    legend_above(figure, axes[0, 0], markerscale=2)
    which = "The median held-out stretch" if trace.place else "The held-out stretch"
    return Picture(
        "Real, base and corrected" if corrected else "Real and base",
        f"{which if traces.held_out else 'The stretch'} of episode {trace.name}, simulated over "
        f"{traces.horizon:.3g} s at a time, each time from a measured state.",
        png(figure, SHARP),
        [state.items[i].name for i in shown],
    )


BEYOND = 0.08  # of what was visited, that is drawn on either side of it


def measured_picture(effect: NamedEffect) -> Picture:
    """The curve over its input."""
    curve = effect.curve
    assert curve is not None
    figure, axes = panels(1, 1, (WIDE, 3.0), Panels())
    axis: Axes = axes[0, 0]
    _draw_measured(axis, curve)
    axis.set_xlabel(named(curve.input, curve.input_unit))
    axis.set_ylabel(named(curve.quantity, curve.unit, LABEL))
    legend_above(figure, axis)
    return Picture(
        f"No law of the catalogue: {effect_name(effect)}",
        f"{curve.quantity} over {curve.input}: measured, with its 90 % band; {curve.freedom:.0f} effective "
        "parameters. Grey: never visited, where what it adds is held: extrapolation.",
        png(figure),
        (curve.input, curve.quantity),
    )


def _draw_measured(axis: Axes, curve: MeasuredCurve) -> None:
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
