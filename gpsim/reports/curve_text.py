"""Measured curves in words: what a curve does, which named laws are nearest, and what each of them misses."""

from __future__ import annotations

from collections.abc import Iterator

from gpsim.diagnosis.report import MeasuredCurve, NamedEffect, NearestLaw
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
