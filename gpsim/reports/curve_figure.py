"""The picture of a measured curve: its band, its nearest laws, and where it was never visited."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes

from gpsim.channels import FloatArray
from gpsim.diagnosis.assessment import EFFECTS
from gpsim.diagnosis.report import MeasuredCurve, NamedEffect
from gpsim.reports.account_effects import effect_name
from gpsim.reports.canvas import FAINT, GRID, INK, LABEL, legend_above, named, panels, png
from gpsim.reports.curve_text import law_name, nearest_said
from gpsim.reports.diagnosis_figures import COLOURS, Picture

WIDE = 5.4  # inches
LAWS = 2  # nearest laws that are drawn
DASHES = ((0, (4, 1.5)), (0, (1, 1.5)))
BEYOND = 0.08  # of what was visited, that is drawn on either side of it
SLICES = 3  # of a map


def measured_picture(effect: NamedEffect) -> Picture:
    """The curve over its input, of a map some slices."""
    curve = effect.curve
    assert curve is not None
    figure, axes = panels(1, 1, (WIDE, 3.0))
    axis: Axes = axes[0, 0]
    if curve.second_at is None:
        _draw(axis, curve)
    else:
        _draw_map(axis, curve, np.asarray(curve.second_at))
    axis.set_xlabel(named(curve.input, curve.input_unit))
    axis.set_ylabel(named(curve.quantity, curve.unit, LABEL))
    legend_above(figure, axis)
    return Picture(
        f"No law of the catalogue: {effect_name(effect)}",
        _caption(curve),
        png(figure),
        (curve.input, curve.quantity),
    )


def _draw(axis: Axes, curve: MeasuredCurve) -> None:
    at, values = np.asarray(curve.at), np.asarray(curve.values)
    if len(curve.low) == len(at):
        axis.fill_between(
            at, curve.low, curve.high, color=COLOURS[EFFECTS], alpha=0.18, linewidth=0, label="90 %"
        )
    axis.plot(at, values, color=COLOURS[EFFECTS], marker=".", markersize=3, label="measured")
    for law, dashes in zip(curve.nearest[:LAWS], DASHES, strict=False):
        if len(law.values) == len(at):
            axis.plot(at, law.values, color=INK, linestyle=dashes, linewidth=1.0, label=law_name(law))
    low, high = curve.visited
    wide = BEYOND * (high - low)
    for begin, end in ((low - wide, low), (high, high + wide)):
        axis.axvspan(begin, end, color=GRID, alpha=0.6, linewidth=0)
    axis.set_xlim(low - wide, high + wide)


def _draw_map(axis: Axes, curve: MeasuredCurve, second: FloatArray) -> None:
    values = np.asarray(curve.values).reshape(len(second), len(curve.at))
    picks = np.unique(np.linspace(0, len(second) - 1, SLICES).round().astype(int))
    for place, alpha in zip(picks, np.linspace(0.35, 1.0, len(picks)), strict=True):
        label = f"{curve.second} = {second[place]:.2g} {curve.second_unit}"
        axis.plot(curve.at, values[place], color=COLOURS[EFFECTS], alpha=float(alpha), label=label)
    axis.plot(curve.at, curve.at, color=FAINT, linewidth=0.8, label="base")


def _caption(curve: MeasuredCurve) -> str:
    of = curve.input if curve.second is None else f"{curve.second} and {curve.input}"
    said = (
        f"{curve.quantity} over {of}: measured, with its 90 % band; {curve.freedom:.0f} effective parameters."
    )
    if curve.second is not None:
        said = f"{curve.quantity} over {of}: slices of the measured map; {curve.freedom:.0f} effective parameters."
    beyond = (
        " Grey: never visited, where what it adds is held: extrapolation." if curve.second is None else ""
    )
    found = f" Form found, not known: {curve.found.formula}." if curve.found else ""
    near = "".join(f" {text[0].upper()}{text[1:]}." for text in nearest_said(curve))
    return said + beyond + near + found
