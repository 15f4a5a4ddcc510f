"""A correction as MJCF: which attributes of which elements, written by MjSpec, with all digits and a comment each.

Effects and parameters change attributes; a corrected geometry the reference of a joint, the place and turn of a body or
site.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any
from xml.etree import ElementTree

import numpy as np

from gpsim.channels import FloatArray
from gpsim.errors import UsageError
from gpsim.mjcf.body import Body
from gpsim.mjcf.geometry import Place, target_of
from gpsim.mjcf.naming import called
from gpsim.mjcf.optional import mujoco
from gpsim.mjcf.patching import Motor, samples
from gpsim.mjcf.plan import Fields
from gpsim.mjcf.simulator import MjcfSimulator

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
TENDON = {
    "damping": "tendon_damping",
    "frictionloss": "tendon_frictionloss",
    "solreffriction": "tendon_solref_fri",
    "solimpfriction": "tendon_solimp_fri",
    "armature": "tendon_armature",
}
"""Attribute of a fixed tendon -> the field that it is."""
INERTIAL = {"pos": "body_ipos", "quat": "body_iquat", "mass": "body_mass", "diaginertia": "body_inertia"}
GEOM = {"friction": "geom_friction", "solref": "geom_solref", "pos": "geom_pos"}
SPELT = {"solreffriction": "solref_friction", "solimpfriction": "solimp_friction"}
"""What MjSpec calls otherwise than MJCF."""
MOVED = {
    "reference": ("joint", {"ref": "qpos0"}),
    "frame": ("body", {"pos": "body_pos", "quat": "body_quat"}),
    "site": ("site", {"pos": "site_pos", "quat": "site_quat"}),
}
"""Kind of an element that is moved -> its tag, its attributes and the fields that they are."""
OFF = 1e-9  # m, 1: of a place or a turn in what was written
_DASHES = re.compile("-(?=-)")  # no two may follow each other in a comment


@dataclass
class Change:
    """Attributes of one element as they are to be; index: in the model.

    kind: joint, body (its masses), geom, actuator, option; where it is moved reference (of a joint), frame (a body) or
    site; tendon, which is new: one between two joints, numbered as in `Body.tied`, and its name.

    kept: those of them that are written because others beside them must be.
    """

    kind: str
    index: int
    attributes: dict[str, Value]
    kept: tuple[str, ...] = ()
    comments: list[str] = field(default_factory=list)
    name: str = ""


def changes_of(body: Body, fields: Fields, motors: Sequence[Motor], step: float) -> list[Change]:
    """Every element of which something is to be other than in the model."""
    model = body.base
    found = []

    def now_was(name: str) -> tuple[FloatArray, FloatArray]:
        was = np.asarray(getattr(model.opt, name[4:]) if name.startswith("opt.") else getattr(model, name))
        return fields[name][0] if name in fields else was, was

    def add(kind: str, index: int, made: dict[str, Value], kept: tuple[str, ...] = ()) -> None:
        if made:
            found.append(Change(kind, index, made, kept))

    made: dict[str, Value] = {}
    gravity, was = now_was("opt.gravity")
    if (gravity != was).any():
        made["gravity"] = np.array(gravity)
    if abs(step - body.own_step) > 1e-12 * step:
        made["timestep"] = np.array([step])
    add("option", 0, made)
    for j in range(model.njnt):
        places, made = {"dof": int(model.jnt_dofadr[j]), "jnt": j, "qpos": int(model.jnt_qposadr[j])}, {}
        for attribute, names in JOINT.items():
            pairs = [[np.ravel(v[places[name.split("_")[0]]]) for v in now_was(name)] for name in names]
            now, was = (np.concatenate(each) for each in zip(*pairs, strict=True))
            if (now != was).any():
                made[attribute] = _short(now)
        add("joint", j, made)
    for place in body.ties if any(name in fields for name in TENDON.values()) else ():
        t, made = body.tendon(place), {}
        for attribute, name in TENDON.items():
            was = np.atleast_1d(getattr(body.tied, name)[t])
            now = np.atleast_1d(fields[name][0, t]) if name in fields else was
            if (now != was).any():
                made[attribute] = np.array(now)
        if made:
            found.append(Change("tendon", t, made, name=called(body.tied, "tendon", t)))
    for b in range(1, model.nbody):
        both = {a: [np.atleast_1d(v[b]) for v in now_was(name)] for a, name in INERTIAL.items()}
        kept = tuple(a for a, (now, was) in both.items() if (now == was).all())
        if len(kept) < len(INERTIAL):
            add("body", b, {a: np.array(now) for a, (now, _) in both.items()}, kept)
    for g in range(model.ngeom):
        both = {a: [v[g] for v in now_was(name)] for a, name in GEOM.items()}
        add("geom", g, {a: np.array(now) for a, (now, was) in both.items() if (now != was).any()})
    of = {motor.index: motor for motor in motors}
    for i in range(model.nu):
        names = ("actuator_gainprm", "actuator_biasprm", "actuator_forcerange")
        gain, bias, force = (np.array(now_was(name)[0][i]) for name in names)
        add("actuator", i, _of_actuator(model, of.get(i, Motor(i)), gain, bias, force, step))
    return found


def _short(values: FloatArray) -> FloatArray:
    """Without zeros at the end: the coefficients of a polynomial that has none."""
    last = int(np.max(np.flatnonzero(values), initial=0))
    return np.array(values[: last + 1])


def _of_actuator(
    model: Any, motor: Motor, gain: FloatArray, bias: FloatArray, force: FloatArray, step: float
) -> dict[str, Value]:
    """Its attributes, by what its fields are to be and what the motor does otherwise."""
    i, made = motor.index, dict[str, Value]()
    bias[0] += gain[0] * motor.more
    gain[0] *= motor.scale
    if (gain != model.actuator_gainprm[i]).any():
        made["gainprm"] = _short(gain)
    if (bias != model.actuator_biasprm[i]).any():
        made["biasprm"] = _short(bias)
        if int(model.actuator_biastype[i]) == mujoco().mjtBias.mjBIAS_NONE:
            made["biastype"] = "affine"
    if (force != model.actuator_forcerange[i]).any():
        made["forcerange"] = force
    if motor.limit is not None:
        low, high = model.actuator_ctrlrange[i] if model.actuator_ctrllimited[i] else (-np.inf, np.inf)
        made["ctrlrange"] = np.array([max(low, -motor.limit), min(high, motor.limit)])
        made["ctrllimited"] = "true"
    if motor.delay is not None:
        made["delay"], made["nsample"] = np.array([motor.delay]), str(samples(motor.delay, step))
        made["interp"] = "linear"
    return made


def moved_changes(simulator: MjcfSimulator, said: Mapping[Place, str]) -> list[Change]:
    """Every element that the simulator's geometry moves; said: of each place a sentence."""
    believed, changes = simulator.believed, dict[tuple[str, int], Change]()
    for moved in simulator.geometry:
        place, names = moved.place, simulator.body.names
        if place.kind == "joint zero":
            kind, index = "reference", simulator.body.joint(place.on)
        elif place.kind.startswith("body"):
            kind, index = "frame", names.bodies.index(place.on)
        else:
            kind, index = "site", target_of(believed, names, place.on).site
        if index < 0:  # a marker on a body, of which the model has no element
            continue
        if (kind, index) not in changes:
            at = int(believed.jnt_qposadr[index]) if kind == "reference" else index
            change = changes[kind, index] = Change(kind, index, {})
            for name, of in MOVED[kind][1].items():
                now, was = (np.atleast_1d(getattr(m, of)[at]) for m in (simulator.body.base, believed))
                if (now != was).any():
                    change.attributes[name] = np.array(now, dtype=np.float64)
        sentence = said.get(place) or f"{place.kind} of {place.on}: {moved.value:.6g}"
        changes[kind, index].comments.append(sentence)
    return list(changes.values())


def check_moved(wanted: Any, simulator: MjcfSimulator) -> None:
    """Raises UsageError where the compiled spec has another geometry: what stands in a <frame> is moved with it."""
    for name in (of for _, fields in MOVED.values() for of in fields.values()):
        one, other = getattr(wanted, name), getattr(simulator.body.base, name)
        same_shape = simulator.geometry and one.shape == other.shape
        if same_shape and np.abs(one - other).max(initial=0.0) > OFF:
            raise UsageError(
                f"{simulator.name}: a body or site that was off stands in a <frame>, which moves it once more; take it "
                "out of the frame in the model"
            )


def named(spec: Any, geoms: Mapping[int, str]) -> None:
    """Give what has no name the one by which gpsim calls it; the spec must have been compiled.

    geoms: those that are a parameter's, by their numbers.
    """
    for geom in spec.geoms:
        geom.name = geom.name or geoms.get(geom.id, "")
    for kind, elements in (("joint", spec.joints), ("actuator", spec.actuators), ("body", spec.bodies[1:])):
        for element in elements:
            element.name = element.name or f"{kind}{element.id}"


def apply(spec: Any, body: Body, changes: Sequence[Change]) -> None:
    """Write the changes into a spec; masses and inertias that a geom had become the body's own."""
    if any(c.kind == "body" for c in changes):
        _release_inertia(spec, body)
    places = [*body.ties]
    for change in changes:
        if change.kind == "tendon":
            body.tie(spec, places[change.index - body.base.ntendon])
        kind, attributes = change.kind, change.attributes
        if kind == "option":
            for name, value in attributes.items():
                setattr(spec.option, name, value if name == "gravity" else float(value[0]))
            continue
        element = _of_spec(spec, change)
        if kind == "body":
            _to_body(element, attributes)
            continue
        for name, value in attributes.items():
            _set(spec, element, name, value)


def _of_spec(spec: Any, change: Change) -> Any:
    """The element of a change in a spec."""
    if change.kind == "tendon":
        return next(tendon for tendon in spec.tendons if tendon.name == change.name)
    tag = MOVED[change.kind][0] if change.kind in MOVED else change.kind
    every = {"joint": spec.joints, "body": spec.bodies, "geom": spec.geoms, "actuator": spec.actuators}
    return next(e for e in (every | {"site": spec.sites})[tag] if e.id == change.index)


def _set(spec: Any, element: Any, name: str, value: Value) -> None:
    """Write an attribute of an element as MjSpec wants it."""
    mj, length = mujoco(), len(np.atleast_1d(getattr(element, SPELT.get(name, name))))
    if isinstance(value, str):
        words = {"affine": mj.mjtBias.mjBIAS_AFFINE, "true": mj.mjtLimited.mjLIMITED_TRUE, "linear": 1}
        setattr(element, name, words[value] if value in words else int(value))
    elif name in ("ref", "springref"):
        degrees = spec.compiler.degree and element.type == mj.mjtJoint.mjJNT_HINGE
        setattr(element, name, float(np.rad2deg(value[0]) if degrees else value[0]))
    elif name in ("damping", "stiffness", "gainprm", "biasprm"):
        setattr(element, name, np.pad(value, (0, length - len(value))))
    elif length == 1:
        setattr(element, name, float(value[0]))
    else:
        setattr(element, SPELT.get(name, name), value)
        if name == "quat":
            element.alt.type = mj.mjtOrientation.mjORIENTATION_QUAT


def _release_inertia(spec: Any, body: Body) -> None:
    """Masses that are written are to count: no geom's in their place, and no total to which all are scaled."""
    kinds = mujoco().mjtInertiaFromGeom
    if spec.compiler.settotalmass > 0.0:
        for element in spec.bodies[1:]:
            _to_body(
                element, {a: np.atleast_1d(getattr(body.base, n)[element.id]) for a, n in INERTIAL.items()}
            )
        spec.compiler.settotalmass = -1.0
        spec.compiler.inertiafromgeom = kinds.mjINERTIAFROMGEOM_AUTO
    if spec.compiler.inertiafromgeom == kinds.mjINERTIAFROMGEOM_TRUE:
        for element in spec.bodies:
            element.explicitinertial = element.explicitinertial and not list(element.geoms)
        spec.compiler.inertiafromgeom = kinds.mjINERTIAFROMGEOM_AUTO


def _to_body(body: Any, attributes: Mapping[str, Value]) -> None:
    body.explicitinertial = True
    body.fullinertia = [np.nan, 0, 0, 0, 0, 0]
    body.mass = float(attributes["mass"][0])
    body.ipos, body.iquat, body.inertia = (attributes[n] for n in ("pos", "quat", "diaginertia"))


def written(text: str, spec: Any, changes: Sequence[Change], assets: Mapping[str, str]) -> str:
    """MjSpec's own text (six digits) with all digits of what was changed, and a comment before each element.

    assets: attributes of the compiler that say where meshes and textures lie.
    """
    reading = ElementTree.XMLParser(target=ElementTree.TreeBuilder(insert_comments=True))
    root: Any = ElementTree.fromstring(text, reading)
    for name, place in assets.items():
        root.find("compiler").set(name, place)
    parents: dict[Any, Any] = {child: parent for parent in root.iter() for child in parent}
    for change in changes:
        element = _in_text(root, spec, change)
        target = element
        if change.kind == "body":
            target = next(child for child in element if child.tag == "inertial")
            target.attrib.pop("fullinertia", None)
        for name, value in change.attributes.items():
            digits = [value] if isinstance(value, str) else [f"{v:.15g}" for v in np.ravel(value)]
            target.set(name, " ".join(digits))
        told = target if target in parents else element
        for line in change.comments if told in parents else ():
            comment = ElementTree.Comment(f" {_DASHES.sub('- ', line)} ")
            parents[told].insert(list(parents[told]).index(told), comment)
    ElementTree.indent(root)
    return ElementTree.tostring(root, encoding="unicode") + "\n"


def _in_text(root: Any, spec: Any, change: Change) -> Any:
    """The element of a change in a spec's text."""
    if change.kind == "option":
        found = root.find("option")
        if found is None:
            found = ElementTree.Element("option")
            root.insert(1 if len(root) and root[0].tag == "compiler" else 0, found)
        return found
    tag = MOVED[change.kind][0] if change.kind in MOVED else change.kind
    apart = tag in ("actuator", "tendon")
    places = list(root.find(tag)) if apart else root.find("worldbody").iter(tag)
    name = _of_spec(spec, change).name
    return next(e for e in places if isinstance(e.tag, str) and e.get("name") == name)
