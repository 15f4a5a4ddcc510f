"""A patch as MJCF: which attributes of which elements, written by MjSpec, with all their digits and a comment each."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any
from xml.etree import ElementTree

import numpy as np

from gpsim.channels import FloatArray
from gpsim.mjcf.body import Body
from gpsim.mjcf.commanding import Motor, samples
from gpsim.mjcf.native import Fields
from gpsim.mjcf.optional import mujoco

Value = FloatArray | str
JOINT = {
    "damping": ("dof_damping", "dof_dampingpoly"),
    "frictionloss": ("dof_frictionloss",),
    "solreffriction": ("dof_solref",),
    "solimpfriction": ("dof_solimp",),
    "armature": ("dof_armature",),
    "stiffness": ("jnt_stiffness", "jnt_stiffnesspoly"),
    "springref": ("qpos_spring",),
}
"""Attribute of a joint -> the fields that it is."""
INERTIAL = {"pos": "body_ipos", "quat": "body_iquat", "mass": "body_mass", "diaginertia": "body_inertia"}
SPELT = {"solreffriction": "solref_friction", "solimpfriction": "solimp_friction"}
GEOM = {"friction": "geom_friction", "solref": "geom_solref"}
"""What MjSpec calls otherwise than MJCF."""
MOVED = {"reference": "joint", "frame": "body"}
"""Kinds of changes that move an element -> its tag."""
_DASHES = re.compile("-(?=-)")  # no two may follow each other in a comment


@dataclass
class Change:
    """Attributes of one element as they are to be; index: in the model.

    kind: joint, body (its masses), geom, actuator, option; where it is moved reference (of a joint), frame (a body) or
    site.

    kept: those of them that are written because others beside them must be.
    """

    kind: str
    index: int
    attributes: dict[str, Value]
    kept: tuple[str, ...] = ()
    comments: list[str] = field(default_factory=list)


def changes_of(body: Body, fields: Fields, motors: Sequence[Motor], step: float) -> list[Change]:
    """Every element of which something is to be other than in the model."""
    found = [
        *_options(body, fields, step),
        *_joints(body, fields),
        *_bodies(body, fields),
        *_geoms(body, fields),
    ]
    return [*found, *_actuators(body, fields, motors, step)]


def _now(body: Body, fields: Fields, name: str) -> FloatArray:
    return fields[name][0] if name in fields else _was(body, name)


def _was(body: Body, name: str) -> FloatArray:
    model = body.base
    return np.asarray(getattr(model.opt, name[4:]) if name.startswith("opt.") else getattr(model, name))


def _options(body: Body, fields: Fields, step: float) -> Iterator[Change]:
    made: dict[str, Value] = {}
    gravity = _now(body, fields, "opt.gravity")
    if (gravity != _was(body, "opt.gravity")).any():
        made["gravity"] = np.array(gravity)
    if abs(step - body.own_step) > 1e-12 * step:
        made["timestep"] = np.array([step])
    if made:
        yield Change("option", 0, made)


def _joints(body: Body, fields: Fields) -> Iterator[Change]:
    model = body.base
    for j in range(model.njnt):
        places = {"dof": int(model.jnt_dofadr[j]), "jnt": j, "qpos": int(model.jnt_qposadr[j])}
        made: dict[str, Value] = {}
        for attribute, names in JOINT.items():
            pairs = [(name, places[name.split("_")[0]]) for name in names]
            now = np.concatenate([np.ravel(_now(body, fields, n)[at]) for n, at in pairs])
            was = np.concatenate([np.ravel(_was(body, n)[at]) for n, at in pairs])
            if (now != was).any():
                made[attribute] = _short(now)
        if made:
            yield Change("joint", j, made)


def _short(values: FloatArray) -> FloatArray:
    """Without zeros at the end: the coefficients of a polynomial that has none."""
    last = int(np.max(np.flatnonzero(values), initial=0))
    return np.array(values[: last + 1])


def _bodies(body: Body, fields: Fields) -> Iterator[Change]:
    for b in range(1, body.base.nbody):
        now = {attribute: _now(body, fields, name)[b] for attribute, name in INERTIAL.items()}
        kept = tuple(a for a, name in INERTIAL.items() if (now[a] == _was(body, name)[b]).all())
        if len(kept) < len(INERTIAL):
            yield Change("body", b, {a: np.atleast_1d(np.array(v)) for a, v in now.items()}, kept)


def _geoms(body: Body, fields: Fields) -> Iterator[Change]:
    for g in range(body.base.ngeom):
        now = {attribute: np.array(_now(body, fields, name)[g]) for attribute, name in GEOM.items()}
        made: dict[str, Value] = {a: v for a, v in now.items() if (v != _was(body, GEOM[a])[g]).any()}
        if made:
            yield Change("geom", g, made)


def _actuators(body: Body, fields: Fields, motors: Sequence[Motor], step: float) -> Iterator[Change]:
    mj, model, of = mujoco(), body.base, {m.index: m for m in motors}
    for i in range(model.nu):
        gain, bias = (np.array(_now(body, fields, f"actuator_{n}prm")[i]) for n in ("gain", "bias"))
        made: dict[str, Value] = {}
        motor = of.get(i, Motor(i))
        bias[0] += gain[0] * motor.more
        gain[0] *= motor.scale
        if (gain != model.actuator_gainprm[i]).any():
            made["gainprm"] = _short(gain)
        if (bias != model.actuator_biasprm[i]).any():
            made["biasprm"] = _short(bias)
            if int(model.actuator_biastype[i]) == mj.mjtBias.mjBIAS_NONE:
                made["biastype"] = "affine"
        force = np.array(_now(body, fields, "actuator_forcerange")[i])
        if (force != model.actuator_forcerange[i]).any():
            made["forcerange"] = force
        if motor.limit is not None:
            low, high = model.actuator_ctrlrange[i] if model.actuator_ctrllimited[i] else (-np.inf, np.inf)
            made["ctrlrange"] = np.array([max(low, -motor.limit), min(high, motor.limit)])
            made["ctrllimited"] = "true"
        if motor.delay is not None:
            made["delay"], made["nsample"] = np.array([motor.delay]), str(samples(motor.delay, step))
            made["interp"] = "linear"
        if made:
            yield Change("actuator", i, made)


def named(spec: Any, geoms: Mapping[int, str]) -> None:
    """Give what has no name the one by which gpsim calls it; the spec must have been compiled.

    geoms: those that are a parameter's, by their numbers.
    """
    for geom in spec.geoms:
        geom.name = geom.name or geoms.get(geom.id, "")
    for kind, elements in (("joint", spec.joints), ("actuator", spec.actuators), ("body", spec.bodies[1:])):
        for element in elements:
            if not element.name:
                element.name = f"{kind}{element.id}"


def apply(spec: Any, body: Body, changes: Sequence[Change]) -> None:
    """Write the changes into a spec; masses and inertias that a geom had become the body's own."""
    mj = mujoco()
    if any(c.kind == "body" for c in changes):
        _release_inertia(mj, spec, body)
    groups = (spec.bodies, spec.joints, spec.actuators, spec.geoms)
    bodies, joints, actuators, geoms = ({e.id: e for e in group} for group in groups)
    for change in changes:
        if change.kind == "option":
            for name, value in change.attributes.items():
                setattr(spec.option, name, value if name == "gravity" else float(value[0]))
        elif change.kind == "joint":
            _to_joint(mj, spec, joints[change.index], change.attributes)
        elif change.kind == "geom":
            for name, value in change.attributes.items():
                setattr(geoms[change.index], name, value)
        elif change.kind == "body":
            _to_body(bodies[change.index], change.attributes)
        else:
            _to_actuator(mj, actuators[change.index], change.attributes)


def _release_inertia(mj: Any, spec: Any, body: Body) -> None:
    """Masses that are written are to count: no geom's in their place, and no total to which all are scaled."""
    if spec.compiler.settotalmass > 0.0:
        for element in spec.bodies[1:]:
            _to_body(element, {a: np.atleast_1d(_was(body, n)[element.id]) for a, n in INERTIAL.items()})
        spec.compiler.settotalmass = -1.0
        spec.compiler.inertiafromgeom = mj.mjtInertiaFromGeom.mjINERTIAFROMGEOM_AUTO
    if spec.compiler.inertiafromgeom == mj.mjtInertiaFromGeom.mjINERTIAFROMGEOM_TRUE:
        for element in spec.bodies:
            element.explicitinertial = element.explicitinertial and not list(element.geoms)
        spec.compiler.inertiafromgeom = mj.mjtInertiaFromGeom.mjINERTIAFROMGEOM_AUTO


def _to_joint(mj: Any, spec: Any, joint: Any, attributes: Mapping[str, Value]) -> None:
    degrees = spec.compiler.degree and joint.type == mj.mjtJoint.mjJNT_HINGE
    for name, value in attributes.items():
        numbers = np.asarray(value, dtype=np.float64)
        if name in ("damping", "stiffness"):
            setattr(joint, name, np.pad(numbers, (0, 3 - len(numbers))))
        elif name in SPELT:
            setattr(joint, SPELT[name], numbers)
        elif name == "springref":
            joint.springref = float(np.rad2deg(numbers[0]) if degrees else numbers[0])
        else:
            setattr(joint, name, float(numbers[0]))


def _to_body(body: Any, attributes: Mapping[str, Value]) -> None:
    body.explicitinertial = True
    body.fullinertia = [np.nan, 0, 0, 0, 0, 0]
    body.mass = float(attributes["mass"][0])
    body.ipos, body.iquat, body.inertia = (attributes[n] for n in ("pos", "quat", "diaginertia"))


def _to_actuator(mj: Any, actuator: Any, attributes: Mapping[str, Value]) -> None:
    for name, value in attributes.items():
        if name in ("gainprm", "biasprm"):
            setattr(actuator, name, np.pad(np.asarray(value), (0, len(getattr(actuator, name)) - len(value))))
        elif name == "ctrlrange":
            actuator.ctrlrange, actuator.ctrllimited = value, mj.mjtLimited.mjLIMITED_TRUE
        elif name == "forcerange":
            actuator.forcerange = value
        elif name == "biastype":
            actuator.biastype = mj.mjtBias.mjBIAS_AFFINE
        elif name == "delay":
            actuator.delay = float(value[0])
            actuator.nsample, actuator.interp = int(str(attributes["nsample"])), 1


def written(text: str, spec: Any, changes: Sequence[Change], assets: Mapping[str, str]) -> str:
    """MjSpec's own text (six digits) with all digits of what was changed, and a comment before each element.

    assets: attributes of the compiler that say where meshes and textures lie.
    """
    root = _parsed(text)
    if assets:
        compiler = root.find("compiler")
        for name, place in assets.items():
            compiler.set(name, place)
    parents = {child: parent for parent in root.iter() for child in parent}
    for change in changes:
        element = _element(root, spec, change)
        target = element
        if change.kind == "body":
            target = next(child for child in element if child.tag == "inertial")
            target.attrib.pop("fullinertia", None)
        for name, value in change.attributes.items():
            target.set(name, value if isinstance(value, str) else _digits(value))
        _comment(parents, target if target in parents else element, change.comments)
    return _text(root)


def _parsed(text: str) -> Any:
    return ElementTree.fromstring(
        text, ElementTree.XMLParser(target=ElementTree.TreeBuilder(insert_comments=True))
    )


def _text(root: Any) -> str:
    ElementTree.indent(root)
    return ElementTree.tostring(root, encoding="unicode") + "\n"


def _element(root: Any, spec: Any, change: Change) -> Any:
    if change.kind == "option":
        found = root.find("option")
        if found is None:
            found = ElementTree.Element("option")
            root.insert(1 if len(root) and root[0].tag == "compiler" else 0, found)
        return found
    groups = {"joint": spec.joints, "body": spec.bodies, "geom": spec.geoms, "actuator": spec.actuators}
    groups["site"], kind = spec.sites, MOVED.get(change.kind, change.kind)
    name = next(e.name for e in groups[kind] if e.id == change.index)
    place = root.find("actuator" if kind == "actuator" else "worldbody")
    places = list(place) if kind == "actuator" else place.iter(kind)
    return next(e for e in places if isinstance(e.tag, str) and e.get("name") == name)


def _digits(values: FloatArray) -> str:
    return " ".join(f"{v:.15g}" for v in np.ravel(values).astype(float))


def _comment(parents: Mapping[Any, Any], element: Any, lines: Sequence[str]) -> None:
    parent = parents.get(element)
    if parent is None or not lines:
        return
    for line in lines:
        at = list(parent).index(element)
        parent.insert(at, ElementTree.Comment(f" {_DASHES.sub('- ', line)} "))
