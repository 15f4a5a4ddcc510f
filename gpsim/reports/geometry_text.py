"""A model's geometry in words: what is off by how much, what cannot be told apart, and how far the tool is off."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

from gpsim.findings import (
    GeometryFound,
    GeometryKind,
    GeometryPlace,
    InPlaceOf,
    Inseparable,
    Kinematics,
    ToolError,
)
from gpsim.reports.diagnosis_text import listed
from gpsim.reports.quantities import brief, size_text, spelled
from gpsim.reports.sheets import Cell, Sheet, row

NAMES: Mapping[GeometryKind, str] = {
    "frame turn": "the base's turn about {axis}",
    "frame place": "the base's place along {axis}",
    "joint zero": "the zero of {on}",
    "body place": "the place of {on} along {axis}",
    "body turn": "the turn of {on} about {axis}",
    "site place": "the place of {on} along {axis}",
    "site turn": "the turn of {on} about {axis}",
    "delay": "the delay of the motion capture",
}
LABORATORY = "the base against the motion capture's frame"
NOTE = (
    "A zero is to be added to the encoder's reading; a link's place is along its parent's axes, its turn about "
    "its own. The robot's numbers are corrected in the simulator and in what `gpsim export model` writes; those of the "
    "laboratory (the base in the motion capture's frame, turned about the first joint; the delay) are none of the "
    "model's."
)


def place_name(place: GeometryPlace) -> str:
    """`the zero of elbow`, `the place of forearm along x`."""
    return NAMES[place.kind].format(on=spelled(place.on), axis=place.axis)


def found_text(found: GeometryFound) -> str:
    """`the zero of elbow is off by 0.0200 ± 0.0001 rad`, and what would do as well."""
    off = "is" if found.place.kind == "delay" else "is off by"
    said = f"{place_name(found.place)} {off} {size_text('', found.size)}"
    others = instead_text(found)
    return f"{said}; {others}" if others else said


def instead_text(found: GeometryFound) -> str:
    """What would explain the same; empty where nothing does."""
    exact = [i for i in found.instead if i.exact]
    alike = [i for i in found.instead if not i.exact]
    said = [f"of it and {place_name(i.place)} ({_size(i)}) only {_together(found, i)} shows" for i in exact]
    if alike:
        named = [f"{place_name(i.place)} ({_size(i)})" for i in alike]
        said.append(f"this recording does not tell it from {listed(named, None, 'or')}")
    return "; ".join(said)


def _together(found: GeometryFound, other: InPlaceOf) -> str:
    if found.size.unit != other.unit:
        return "a sum"
    return "the sum" if found.size.value * other.value > 0.0 else "the difference"


def _size(other: InPlaceOf) -> str:
    return f"{other.value:.3g} {other.unit}"


def inseparable_text(entry: Inseparable) -> str:
    """`the zero of joint1 and the base's turn about z: only a sum shows`."""
    if not entry.of:
        return f"{place_name(entry.place)} does not show at all"
    return f"{listed([place_name(entry.place), *map(place_name, entry.of)], None)}: only a sum shows"


def error_text(name: str, error: ToolError) -> str:
    """`tool: 18 → 0.86 mm off on held-out samples (with the base put in place 3.8, noise 0.87)`."""
    before, placed, after, noise = (
        brief(1e3 * v) for v in (error.before, error.placed, error.after, error.noise)
    )
    beside = f"with {LABORATORY} alone {placed}, noise {noise}"
    return f"{spelled(name)} is {before} → {after} mm off on held-out samples ({beside})"


def geometry_lines(found: Kinematics | None) -> list[str]:
    """The account's lines: the robot's numbers, those of the laboratory, and the tool's error; none without poses."""
    if found is None:
        return []
    robot = [found_text(f) for f in found.found if f.model]
    lab = [f for f in found.found if not f.model]
    errors = [error_text(name, error) for name, error in found.error.items()]
    lines = robot or ["zeros and lengths are as the model says, as far as the motion capture tells"]
    return [*lines, *errors, *([_laboratory(lab)] if lab else [])]


def _laboratory(found: Sequence[GeometryFound]) -> str:
    """The laboratory's numbers in one sentence; those of the robot that do as well beside each."""
    return f"the laboratory: {'; '.join(found_text(f) for f in found)}"


def geometry_sheet(found: Kinematics | None) -> Sheet:
    """A row a number that is off; no rows without poses."""
    rows: list[tuple[Cell, ...]] = []
    for each in found.found if found is not None else ():
        whose = "the robot's" if each.model else "the laboratory's"
        rows.append(row(place_name(each.place), whose, instead_text(each), size_text("", each.size)))
    return Sheet("Geometry", ("what is off", "whose", "instead of it", "by (90 %)"), tuple(rows), 3, NOTE)


def inseparable_lines(found: Kinematics | None) -> list[str]:
    """What no sample of the recording tells apart, a line each."""
    return [inseparable_text(entry) for entry in found.inseparable] if found is not None else []


def with_sentences(found: Kinematics | None) -> Kinematics | None:
    """With every sentence that diagnosis.json holds."""
    if found is None:
        return None
    return replace(
        found,
        found=tuple(replace(f, sentence=f.sentence or found_text(f)) for f in found.found),
        inseparable=tuple(replace(i, sentence=i.sentence or inseparable_text(i)) for i in found.inseparable),
    )
