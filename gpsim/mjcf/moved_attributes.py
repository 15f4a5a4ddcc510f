"""A corrected geometry as MJCF: the reference of a joint, the place and turn of a body or site, with a comment each."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from gpsim.channels import FloatArray
from gpsim.errors import UsageError
from gpsim.mjcf.attributes import Change, Value
from gpsim.mjcf.geometry import Moved, Place, target_of
from gpsim.mjcf.naming import Names
from gpsim.mjcf.simulator import MjcfSimulator

OFF = 1e-9  # m, 1: of a place or a turn in what was written
FIELDS = {
    "reference": {"ref": "qpos0"},
    "frame": {"pos": "body_pos", "quat": "body_quat"},
    "site": {"pos": "site_pos", "quat": "site_quat"},
}
"""Kind of an element that is moved -> its attributes and the fields that they are."""


def moved_changes(simulator: MjcfSimulator, said: Mapping[Place, str]) -> list[Change]:
    """Every element that the simulator's geometry moves; said: of each place a sentence."""
    names, found = simulator.body.names, dict[tuple[str, int], list[str]]()
    for moved in simulator.geometry:
        element = _element(simulator.believed, names, moved)
        if element is not None:
            sentence = said.get(moved.place) or f"{moved.place.kind} of {moved.place.on}: {moved.value:.6g}"
            found.setdefault(element, []).append(sentence)
    return [
        Change(kind, index, dict(_attributes(simulator, kind, index)), comments=comments)
        for (kind, index), comments in found.items()
    ]


def _element(model: Any, names: Names, moved: Moved) -> tuple[str, int] | None:
    """Which element a number is of; None where the model has none, as of a marker on a body."""
    on = moved.place.on
    if moved.place.kind == "joint zero":
        return "reference", names.joints[[c.name for c in names.coordinates].index(on)]
    if moved.place.kind.startswith("body"):
        return "frame", names.bodies.index(on)
    site = target_of(model, names, on).site
    return ("site", site) if site >= 0 else None


def _attributes(simulator: MjcfSimulator, kind: str, index: int) -> Iterator[tuple[str, Value]]:
    """Those of an element that are to be other than the model says."""
    at = int(simulator.believed.jnt_qposadr[index]) if kind == "reference" else index
    for name, field in FIELDS[kind].items():
        now, was = (
            np.atleast_1d(np.array(getattr(model, field)[at], dtype=np.float64))
            for model in (simulator.body.base, simulator.believed)
        )
        if (now != was).any():
            yield name, now


def move(mj: Any, element: Any, kind: str, attributes: Mapping[str, Value], degrees: bool) -> None:
    """Write such a change into an element of a spec; degrees: whether that counts angles so."""
    if kind == "reference":
        turns = degrees and element.type == mj.mjtJoint.mjJNT_HINGE
        value = float(np.asarray(attributes["ref"], dtype=np.float64)[0])
        element.ref = float(np.rad2deg(value)) if turns else value
        return
    if "pos" in attributes:
        element.pos = attributes["pos"]
    if "quat" in attributes:
        element.alt.type, element.quat = mj.mjtOrientation.mjORIENTATION_QUAT, attributes["quat"]


def check_moved(wanted: Any, simulator: MjcfSimulator) -> None:
    """Raises UsageError where the compiled spec has another geometry: what stands in a <frame> is moved with it."""
    for name in ("qpos0", "body_pos", "body_quat", "site_pos", "site_quat"):
        one, other = getattr(wanted, name), getattr(simulator.body.base, name)
        if simulator.geometry and one.shape == other.shape and _far(one, other):
            raise UsageError(
                f"{simulator.name}: a body or site that was off stands in a <frame>, which moves it once more; take it "
                "out of the frame in the model"
            )


def _far(one: FloatArray, other: FloatArray) -> bool:
    return bool(np.abs(one - other).max(initial=0.0) > OFF)
