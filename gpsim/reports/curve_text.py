"""Measured curves in words: what a curve does, which named laws are nearest, and what each of them misses.

The picture of a measured curve: its band, its nearest laws, and where it was never visited.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from matplotlib.axes import Axes

from gpsim.channels import FloatArray
from gpsim.diagnosis.assessment import EFFECTS
from gpsim.diagnosis.report import MeasuredCurve, NamedEffect, NearestLaw
from gpsim.reports.account_effects import effect_name
from gpsim.reports.canvas import FAINT, GRID, INK, LABEL, legend_above, named, panels, png
from gpsim.reports.diagnosis_figures import COLOURS, Picture
from gpsim.reports.diagnosis_text import noun
from gpsim.reports.quantities import percent, shortened

NAMES = 3  # nearest laws that are told
TRIFLE = 0.005  # of the mismatch: a slight curve that is less of it is named among the small corrections only
LEVEL = 0.05  # of all that a curve rises and falls: a turn that is smaller is none


def curve_sentence(effect: NamedEffect) -> str:
    """No law of the catalogue; what the curve does, and what is nearest to it."""
    curve = effect.curve
    assert curve is not None
    where = "" if effect.recordings is None else f" in {', '.join(effect.recordings)}"
    inputs = [curve.input] if curve.second is None else [curve.second, curve.input]
    over = " and ".join(shortened(name) for name in inputs)
    head = f"no catalogue law for {shortened(curve.quantity)} over {over}"
    return "; ".join([head, *nearest_said(curve), course(curve), *_found(curve)]) + where


def curve_rows(effects: tuple[NamedEffect, ...]) -> Iterator[str]:
    """The same of every measured curve of an account that is worth a line."""
    for effect in effects:
        little = (
            effect.role == "slight" and effect.importance is not None and effect.importance.share < TRIFLE
        )
        if effect.curve is not None and not little:
            yield curve_sentence(effect)


def course(curve: MeasuredCurve) -> str:
    """`it goes from 2.2 N at q_dot = -0.64 m/s over 3.1 at -0.36 to -2.9 at 0.5`; of a map its extent."""
    of = shortened(curve.input)
    if curve.second is not None:
        return f"it lies between {min(curve.values):.3g} and {max(curve.values):.3g} {curve.unit}"
    turns = _turns(curve)
    first, *between, last = [(curve.at[i], curve.values[i]) for i in turns]
    over = " and ".join(f"{y:.3g} at {x:.3g}" for x, y in between[:2])
    start = f"{first[1]:.3g} {curve.unit} at {of} = {first[0]:.3g} {curve.input_unit}"
    return f"it goes from {start}{f' over {over}' if over else ''} to {last[1]:.3g} at {last[0]:.3g}"


def beyond(curve: MeasuredCurve) -> str:
    """What to record where nothing else is left: where the curve was never measured."""
    low, high = curve.visited
    reach = f"[{low:.3g}, {high:.3g}] {curve.input_unit}"
    return f"record {shortened(curve.input)} beyond {reach}, if you need it there: the curve is held, which is a guess"


def nearest_said(curve: MeasuredCurve) -> list[str]:
    """`nearest: viscous friction (misses 6 %, most for q_dot in [-0.64, -0.54]), Coulomb friction (32 %)`."""
    if not curve.nearest:
        return []
    first, *others = curve.nearest[:NAMES]
    most = ""
    if first.differs is not None:
        low, high = first.differs
        most = f", most of it for {shortened(curve.input)} in [{low:.3g}, {high:.3g}]"
    told = [f"{law_name(first)} (misses {percent(first.misses)} %{most})"]
    return ["nearest: " + ", ".join([*told, *(f"{law_name(n)} ({percent(n.misses)} %)" for n in others)])]


def law_name(law: NearestLaw) -> str:
    """`Coulomb friction + viscous friction`."""
    return " + ".join(noun(family) for family, _ in law.effects)


def _found(curve: MeasuredCurve) -> list[str]:
    if curve.found is None:
        return []
    return [f"form found, not known: {curve.found.formula}, x = {shortened(curve.input)}"]


def _turns(curve: MeasuredCurve) -> list[int]:
    """The ends of a curve and, between them, its one or two largest turns."""
    values, last = curve.values, len(curve.values) - 1
    span = max(values) - min(values)
    inner = {values.index(max(values)), values.index(min(values))} - {0, last}
    far = [
        i
        for i in sorted(inner)
        if min(abs(values[i] - values[0]), abs(values[i] - values[last])) > LEVEL * span
    ]
    return [0, *far, last]


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
