"""What of a model's geometry may be other than it says: zeros of encoders, places and turns of links and markers."""

from __future__ import annotations

import copy
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from gpsim.channels import FloatArray
from gpsim.mjcf.naming import Names
from gpsim.mjcf.optional import mujoco

Kind = Literal[
    "frame turn", "frame place", "joint zero", "body place", "body turn", "site place", "site turn"
]
AXES = "xyz"


@dataclass(frozen=True)
class Place:
    """One number of a model's geometry that may be off.

    kind: `frame`: of the motion capture against the model's world, turned about the first joint; `joint zero`: what is
    to be added to the encoder's reading; `body place`: along its parent's axes; `body turn`: about its own; `site`: of
    a marker on its body. on: the joint, body or marker, "" of the frame; axis: x, y or z; unit: m or rad.
    """

    kind: Kind
    on: str
    axis: str
    unit: str


@dataclass(frozen=True)
class Moved:
    """A place by how much it is off, in its unit."""

    place: Place
    value: float


@dataclass(frozen=True)
class Target:
    """A site or body whose pose was measured; site: -1 of a body."""

    name: str
    body: int
    site: int


def target_of(model: Any, names: Names, name: str) -> Target:
    """The site or body of a name; of both the site."""
    for s in range(model.nsite):
        if model.site(s).name == name:
            return Target(name, int(model.site_bodyid[s]), s)
    return Target(name, names.bodies.index(name), -1)


def trackable(model: Any, names: Names) -> tuple[str, ...]:
    """The names of all sites and moving bodies, whose poses a motion capture may have measured."""
    sites = [str(model.site(s).name) for s in range(model.nsite)]
    return tuple(dict.fromkeys([*filter(None, sites), *names.bodies[1:]]))


def places_of(
    model: Any, names: Names, targets: Sequence[Target], turned: Sequence[bool]
) -> tuple[Place, ...]:
    """All that may be off between the frame and the targets; turned: of which targets the orientation was measured."""
    return tuple(
        [Place("frame turn", "", a, "rad") for a in AXES]
        + [Place("frame place", "", a, "m") for a in AXES]
        + [*_of_the_chains(model, names, targets)]
        + [Place("site place", t.name, a, "m") for t in targets for a in AXES]
        + [Place("site turn", t.name, a, "rad") for t, own in zip(targets, turned, strict=True) if own for a in AXES]
    )  # fmt: skip


def _of_the_chains(model: Any, names: Names, targets: Sequence[Target]) -> Iterator[Place]:
    """Zeros first, then places, then turns, from the base on."""
    on_way = sorted({b for t in targets for b in ancestors(model, t.body)})
    every = dict(zip(names.joints, (c.name for c in names.coordinates), strict=True))
    called = {j: name for j, name in sorted(every.items()) if int(model.jnt_bodyid[j]) in on_way}
    yield from (Place("joint zero", name, "", names.state.units[name]) for name in called.values())
    # A link that stands on the base alone is as far off as the base: the frame says so already.
    bodies = [b for b in on_way if any(int(model.jnt_bodyid[j]) == b for j in called)]
    roots = [b for b in bodies if int(model.body_weldid[model.body_parentid[b]]) == 0]
    bodies = [b for b in bodies if b not in roots or len(roots) > 1]
    yield from (Place("body place", names.bodies[b], a, "m") for b in bodies for a in AXES)
    for b in bodies:
        # A turn about the joint's own axis is its zero.
        first = int(model.body_jntadr[b])
        hinge = int(model.jnt_type[first]) == int(mujoco().mjtJoint.mjJNT_HINGE)
        own = AXES[int(np.abs(model.jnt_axis[first]).argmax())] if hinge else ""
        yield from (Place("body turn", names.bodies[b], a, "rad") for a in AXES if a != own)


def ancestors(model: Any, body: int) -> list[int]:
    """A body and all that carry it, the world left out."""
    found = []
    while body > 0:
        found.append(body)
        body = int(model.body_parentid[body])
    return found


def corrected(model: Any, names: Names, moved: Sequence[Moved]) -> Any:
    """The model as it is in truth, in the encoders' coordinates: a zero is the joint's reference.

    The frame of a motion capture is none of the model's.
    """
    mj, made = mujoco(), copy.copy(model)
    written(made, names, moved)
    mj.mj_setConst(made, mj.MjData(made))
    return made


def written(model: Any, names: Names, moved: Sequence[Moved]) -> None:
    """Write all but the frame into a model, which must be the caller's own."""
    joint = {c.name: j for j, c in zip(names.joints, names.coordinates, strict=True)}
    turns: dict[tuple[str, str], FloatArray] = {}
    for each in moved:
        place, value = each.place, each.value
        axis = AXES.index(place.axis) if place.axis else 0
        if place.kind == "joint zero":
            model.qpos0[int(model.jnt_qposadr[joint[place.on]])] -= value
        elif place.kind == "body place":
            model.body_pos[names.bodies.index(place.on), axis] += value
        elif place.kind == "site place" and (site := target_of(model, names, place.on).site) >= 0:
            model.site_pos[site, axis] += value
            model.site_sameframe[site] = mujoco().mjtSameFrame.mjSAMEFRAME_NONE
        elif place.kind in ("body turn", "site turn"):
            turns.setdefault((place.kind, place.on), np.zeros(3))[axis] += value
    for (kind, on), vector in turns.items():
        if kind == "body turn":
            b = names.bodies.index(on)
            model.body_quat[b] = turned_by(model.body_quat[b], vector)
        elif (site := target_of(model, names, on).site) >= 0:
            model.site_quat[site] = turned_by(model.site_quat[site], vector)
            model.site_sameframe[site] = mujoco().mjtSameFrame.mjSAMEFRAME_NONE


def turned_by(quat: FloatArray, vector: FloatArray) -> FloatArray:
    """(4,): a unit quaternion, real part first, turned by a rotation vector (3,) rad in its own frame."""
    mj, out, turn = mujoco(), np.zeros(4), np.array([1.0, 0.0, 0.0, 0.0])
    angle = float(np.linalg.norm(vector))
    if angle > 0.0:
        mj.mju_axisAngle2Quat(turn, vector / angle, angle)
    mj.mju_mulQuat(out, np.array(quat), turn)
    return out
