"""A URDF as people keep it: meshes in ROS packages, links without a mass, inertias that no body has.

And a corrected model as URDF: links, joints, inertias, damping and friction; what URDF cannot hold is listed.
"""

from __future__ import annotations

import os
import struct
import warnings
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
from scipy.spatial.transform import Rotation

from gpsim.channels import FloatArray
from gpsim.mjcf.naming import called
from gpsim.mjcf.optional import mujoco

PACKAGE, FILE = "package://", "file://"
WORKSPACES, PREFIXES = "ROS_PACKAGE_PATH", "AMENT_PREFIX_PATH"
"""Where ROS 1 and ROS 2 look for packages."""
READABLE = (".stl", ".obj", ".msh")
FACES = 200_000  # that MuJoCo takes of an STL file
HEADER, FACE = 84, 50  # bytes of a binary STL
MASS, GYRATION = 1e-6, 0.03  # kg, m: of a link that its file gives no mass
LEAST = 1e-3  # of a body's largest second moment: the least along its other axes
SMALLEST = 1e-3  # m, the least extent of a body
NEXT_TO_NONE = 1e-12  # kg m^2, above what MuJoCo takes for none
DENSITY = 1000  # kg/m^3, MuJoCo's where nothing is said
MANIFEST = 1 << 20  # bytes of a package.xml, at most
SOME = 4  # names that a line tells
WORLD = "world"
STANDARD_GRAVITY = (0.0, 0.0, -9.81)
FASTEST, STRONGEST = 1e3, 1e6  # that a joint's limits say where the model has none: URDF demands numbers
Lost = dict[str, list[str]]


def mesh_file(name: str, folder: Path) -> Path | None:
    """The file that a URDF in this folder means by `name`, a path, file:// or package://NAME/PATH; None: not there."""
    return next((p.resolve() for p in mesh_places(name, folder) if p.is_file()), None)


def mesh_places(name: str, folder: Path) -> Iterator[Path]:
    """Where the file that is called so may lie, in the order in which it is looked for."""
    if name.startswith(PACKAGE):
        package, _, rest = name.removeprefix(PACKAGE).partition("/")
        yield from (place / rest for place in _package(package, folder))
        yield from (place / rest for place in (folder, folder.parent))
    else:
        yield folder / name.removeprefix(FILE)
    yield folder / Path(name).name


def completed(spec: Any, path: Path) -> list[str]:
    """Change the MjSpec of a URDF, in place, until it compiles; what is not as its file says, in lines."""
    notes = [*_meshes(spec, path.resolve().parent), *_masses(spec), *_inertias(spec)]
    driven, types = (mujoco().mjtJoint.mjJNT_HINGE, mujoco().mjtJoint.mjJNT_SLIDE), mujoco().mjtTrn
    if not list(spec.actuators):  # a URDF has none: a motor JOINT_motor of gear 1 for each of its joints
        for joint in (j for j in spec.joints if j.type in driven):
            motor = spec.add_actuator(name=f"{joint.name}_motor", target=joint.name)
            motor.trntype = types.mjTRN_JOINT
    return notes


def apart(spec: Any, model: Any) -> list[str]:
    """Exclude from contact what is inside each other with joints at 0 or as near as they get; told in a line.

    Collision shapes are convex hulls wider than links, which touch their neighbours' at once; MoveIt's setup assistant
    leaves such pairs out in the same way ("collision by default").
    """
    mj, data = mujoco(), mujoco().MjData(model)
    low, high = model.jnt_range.T
    single = (model.jnt_type == mj.mjtJoint.mjJNT_HINGE) | (model.jnt_type == mj.mjtJoint.mjJNT_SLIDE)
    for j in np.flatnonzero(single & (model.jnt_limited != 0)):
        place = model.jnt_qposadr[j]
        data.qpos[place] = min(max(data.qpos[place], low[j]), high[j])
    mj.mj_fwdPosition(model, data)
    inside = [contact.geom for contact in data.contact[: data.ncon] if contact.dist < 0.0]
    bodies = sorted({tuple(sorted(int(model.geom_bodyid[g]) for g in pair)) for pair in inside})
    names = [tuple(model.body(b).name for b in pair) for pair in bodies]
    for one, other in names:
        spec.add_exclude(bodyname1=one, bodyname2=other)
    if not names:
        return []
    return [f"links that overlap at rest, whose contacts are off: {_some(' and '.join(n) for n in names)}"]


def _package(name: str, folder: Path) -> Iterator[Path]:
    """Folders that may be a ROS package's: above the file, and where ROS looks."""

    def listed(variable: str) -> list[Path]:
        return [Path(p) for p in os.environ.get(variable, "").split(os.pathsep) if p]

    for above in (folder, *folder.parents):
        yield above / name
        if above.name == name or _package_name(above / "package.xml") == name:
            yield above
    for place in listed(WORKSPACES):
        yield from (place / name, place) if place.name == name else (place / name,)
    for place in listed(PREFIXES):
        yield place / "share" / name


def _package_name(manifest: Path) -> str | None:
    try:
        if not manifest.is_file() or manifest.stat().st_size > MANIFEST:
            return None
        return ElementTree.parse(manifest).getroot().findtext("name", "").strip()
    except (OSError, ElementTree.ParseError):
        return None


def _meshes(spec: Any, folder: Path) -> list[str]:
    """Every mesh by the path of its file; what has none that MuJoCo reads is left out."""
    missing: dict[str, list[str]] = {}
    weighed = {g.meshname for b in spec.bodies if not b.explicitinertial for g in b.geoms}
    places = [folder, *([folder / spec.meshdir] if spec.meshdir else [])]
    for mesh in list(spec.meshes):
        if not mesh.file:
            continue
        found = next((f for p in places if (f := mesh_file(mesh.file, p)) is not None), None)
        why = "not found" if found is None else _unreadable(found)
        if why:
            missing.setdefault(why, []).append(Path(mesh.file).name)
            for element in [*[g for g in spec.geoms if g.meshname == mesh.name], mesh]:
                spec.delete(element)
        elif found is not None:
            mesh.file = os.path.relpath(found, places[-1])
            if mesh.name not in weighed:
                mesh.inertia = mujoco().mjtMeshInertia.mjMESH_INERTIA_SHELL  # of no use, and always possible
    return [f"meshes left out, without contacts ({why}): {_some(names)}" for why, names in missing.items()]


def _unreadable(path: Path) -> str:
    """Why MuJoCo cannot read a mesh; empty where it can."""
    ending = path.suffix.lower()
    if ending not in READABLE:
        return f"{ending or 'no ending'}, not {', '.join(READABLE)}"
    if ending != ".stl":
        return ""
    with path.open("rb") as file:
        head = file.read(HEADER)
    faces = struct.unpack("<I", head[-4:])[0] if len(head) == HEADER else 0
    if path.stat().st_size != HEADER + FACE * faces:
        return "STL as text, or cut short"
    return "" if 0 < faces <= FACES else f"{faces} faces, not 1 to {FACES}"


def _masses(spec: Any) -> list[str]:
    """Links that move and have no mass get next to none, as URDF means it; MuJoCo takes some from shapes."""
    bare, shaped = [], []
    for body in spec.bodies[1:]:
        if list(body.geoms) and not body.explicitinertial:
            shaped.append(body.name)
        elif not (body.explicitinertial and body.mass > 0.0):
            body.explicitinertial, body.mass, body.ipos = True, MASS, np.zeros(3)
            body.fullinertia = np.array([MASS * GYRATION**2] * 3 + [0.0] * 3)
            bare += [body.name] if list(body.joints) else []
    light = f"moving links without mass, set to {MASS:g} kg: {_some(bare)}"
    heavy = f"links without <inertial>, which weigh what their shapes do at {DENSITY} kg/m^3: {_some(shaped)}"
    return [line for line, names in ((light, bare), (heavy, shaped)) if names]


def _inertias(spec: Any) -> list[str]:
    """Inertias that no distribution of mass has become the nearest that one has."""
    changed = []
    for body in spec.bodies[1:]:
        full = np.nan_to_num(body.fullinertia)  # MuJoCo reads one of zeros as none
        if not body.explicitinertial or np.any(body.inertia):
            continue
        possible = nearest_inertia(full, float(body.mass))
        if not np.array_equal(possible, full):
            body.fullinertia = possible
            if body.mass > MASS:
                changed.append(body.name)
    if not changed:
        return []
    return [f"impossible inertias, replaced by the nearest possible ones: {_some(changed)}"]


def nearest_inertia(full: FloatArray, mass: float) -> FloatArray:
    """(6,) kg m^2, xx yy zz xy xz yz: an inertia about the centre of mass, or the nearest that a body can have.

    A body's second moments of mass, tr(I)/2 - I, are positive semidefinite (Wensing, Kim and Slotine, Linear matrix
    inequalities for physically consistent inertial parameter identification, 2018): negative ones are raised.
    """
    xx, yy, zz, xy, xz, yz = full
    inertia = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    moments, axes = np.linalg.eigh(0.5 * np.trace(inertia) * np.eye(3) - inertia)
    if moments[0] >= 0.0 and np.linalg.eigvalsh(inertia)[0] > 0.0:
        return full
    raised = np.maximum(moments, max(LEAST * float(moments[-1]), mass * SMALLEST**2, NEXT_TO_NONE))
    made = raised.sum() * np.eye(3) - (axes * raised) @ axes.T
    return np.array([made[0, 0], made[1, 1], made[2, 2], made[0, 1], made[0, 2], made[1, 2]])


def _some(names: Iterable[str]) -> str:
    every = list(names)
    more = f" and {len(every) - SOME} more" if len(every) > SOME else ""
    return ", ".join(every[:SOME]) + more


def urdf_of(model: Any, name: str) -> tuple[str, list[str]]:
    """A compiled model as the text of a URDF, and what that cannot hold, in lines.

    Joints that share a body become a chain of links with next to no mass. A link's frame lies at its body's last joint,
    and a joint is at zero where MuJoCo's position is, whatever its reference. Dynamics are those of the model but for
    what is listed.
    """
    lost: Lost = {}
    robot = ElementTree.Element("robot", name=name)
    ElementTree.SubElement(robot, "link", name=WORLD)
    for body in range(1, model.nbody):
        robot.extend(_body(model, body, lost))
    _left_out(model, lost)
    ElementTree.indent(robot)
    text = ElementTree.tostring(robot, encoding="unicode")
    return f'<?xml version="1.0"?>\n{text}\n', [f"{what}: {', '.join(on)}" for what, on in lost.items()]


def _body(model: Any, body: int, lost: Lost) -> Iterator[ElementTree.Element]:
    """The links and joints that lead to a body, and its own link."""
    name, first = called(model, "body", body), int(model.body_jntadr[body])
    joints = range(first, first + int(model.body_jntnum[body]))
    parent = int(model.body_parentid[body])
    turn = Rotation.from_quat(model.body_quat[body], scalar_first=True)
    place = model.body_pos[body] - _shift(model, parent)
    before = called(model, "body", parent) if parent else WORLD
    at = np.zeros(3)
    if not len(joints):
        yield _joint("fixed", f"{name}_fixed", before, name, place, turn)
    for joint in joints:
        kind, axis = _kind(model, joint), np.array(model.jnt_axis[joint])
        anchor = np.zeros(3) if kind in ("floating", "prismatic") else model.jnt_pos[joint] - at
        child = name if joint == joints[-1] else f"{name}_{joint - first}"
        reference = float(model.qpos0[model.jnt_qposadr[joint]])
        place = place + turn.apply(anchor)
        if kind == "ball":
            lost.setdefault("ball joints, which are fixed", []).append(model.joint(joint).name)
            kind = "fixed"
        elif kind == "prismatic":
            place = place - turn.apply(axis * reference)
        elif kind != "floating":
            turn = turn * Rotation.from_rotvec(-reference * axis)
        made = _joint(kind, called(model, "joint", joint), before, child, place, turn)
        if kind not in ("fixed", "floating"):
            _limits(model, joint, kind, axis, made)
        yield made
        if child != name:  # a link between two joints: next to no mass, since few who read URDF take none
            bare = ElementTree.Element("link", name=child)
            inertial, each = ElementTree.SubElement(bare, "inertial"), f"{MASS * GYRATION**2:g}"
            ElementTree.SubElement(inertial, "mass", value=f"{MASS:g}")
            _inertia(inertial, [each] * 3)
            yield bare
        before, place, turn, at = child, np.zeros(3), Rotation.identity(), at + anchor
    yield _link(model, body, name, lost)


def _inertia(inertial: ElementTree.Element, moments: Iterable[str]) -> None:
    xx, yy, zz = moments
    ElementTree.SubElement(inertial, "inertia", ixx=xx, iyy=yy, izz=zz, ixy="0", ixz="0", iyz="0")


def _shift(model: Any, body: int) -> FloatArray:
    """(3,) where a link's frame lies in its body's: at the last hinge."""
    first = int(model.body_jntadr[body])
    joints = range(first, first + int(model.body_jntnum[body]))
    hinges = [j for j in joints if _kind(model, j) not in ("floating", "prismatic")]
    return np.array(model.jnt_pos[hinges[-1]]) if hinges else np.zeros(3)


def _kind(model: Any, joint: int) -> str:
    """What URDF calls a joint; a ball is none of its kinds."""
    types = mujoco().mjtJoint
    kinds = {types.mjJNT_FREE: "floating", types.mjJNT_BALL: "ball", types.mjJNT_SLIDE: "prismatic"}
    found = kinds.get(types(int(model.jnt_type[joint])))
    return found or ("revolute" if model.jnt_limited[joint] else "continuous")


def _joint(
    kind: str, name: str, parent: str, child: str, place: FloatArray, turn: Rotation
) -> ElementTree.Element:
    made = ElementTree.Element("joint", name=name, type=kind)
    made.append(_origin(place, turn))
    ElementTree.SubElement(made, "parent", link=parent)
    ElementTree.SubElement(made, "child", link=child)
    return made


def _origin(place: FloatArray, turn: Rotation) -> ElementTree.Element:
    with warnings.catch_warnings():  # a quarter turn of pitch has many rolls and yaws, of which one is enough
        warnings.simplefilter("ignore", UserWarning)
        angles = turn.as_euler("xyz")
    return ElementTree.Element("origin", xyz=_text(place), rpy=_text(angles))


def _text(values: FloatArray) -> str:
    return " ".join(f"{v + 0.0:.12g}" for v in np.atleast_1d(values))


def _limits(model: Any, joint: int, kind: str, axis: FloatArray, made: ElementTree.Element) -> None:
    dof = int(model.jnt_dofadr[joint])
    ElementTree.SubElement(made, "axis", xyz=_text(axis))
    said = {"effort": f"{_effort(model, joint):.9g}", "velocity": f"{FASTEST:g}"}
    if kind != "continuous":
        limited = bool(model.jnt_limited[joint])
        low, high = model.jnt_range[joint] if limited else (-STRONGEST, STRONGEST)
        said |= {"lower": f"{low:.12g}", "upper": f"{high:.12g}"}
    ElementTree.SubElement(made, "limit", said)
    damping, friction = float(model.dof_damping[dof]), float(model.dof_frictionloss[dof])
    ElementTree.SubElement(made, "dynamics", damping=f"{damping:.12g}", friction=f"{friction:.12g}")


def _effort(model: Any, joint: int) -> float:
    """The most that the actuators of a joint give it, as far as it or they say so."""
    if model.jnt_actfrclimited[joint]:
        return float(np.abs(model.jnt_actfrcrange[joint]).max())
    mine = (model.actuator_trntype == mujoco().mjtTrn.mjTRN_JOINT) & (model.actuator_trnid[:, 0] == joint)
    limited = mine & (model.actuator_forcelimited != 0)
    most = np.abs(model.actuator_forcerange).max(axis=1) * np.abs(model.actuator_gear[:, 0])
    return float(most[limited].sum()) if limited.any() else STRONGEST


def _link(model: Any, body: int, name: str, lost: Lost) -> ElementTree.Element:
    link, shift = ElementTree.Element("link", name=name), _shift(model, body)
    if model.body_mass[body] > 0.0:
        inertial = ElementTree.SubElement(link, "inertial")
        turn = Rotation.from_quat(model.body_iquat[body], scalar_first=True)
        inertial.append(_origin(model.body_ipos[body] - shift, turn))
        ElementTree.SubElement(inertial, "mass", value=f"{model.body_mass[body]:.12g}")
        _inertia(inertial, (f"{v:.12g}" for v in model.body_inertia[body]))
    for geom in np.flatnonzero(model.geom_bodyid == body):
        shape = _shape(model, int(geom), lost)
        if shape is None:
            continue
        turn = Rotation.from_quat(model.geom_quat[geom], scalar_first=True)
        touches = model.geom_contype[geom] or model.geom_conaffinity[geom]
        for kind in ("visual", "collision") if touches else ("visual",):
            made = ElementTree.SubElement(link, kind)
            made.append(_origin(model.geom_pos[geom] - shift, turn))
            ElementTree.SubElement(made, "geometry").append(shape)
    return link


def _shape(model: Any, geom: int, lost: Lost) -> ElementTree.Element | None:
    types, size = mujoco().mjtGeom, model.geom_size[geom]
    kind, name = types(int(model.geom_type[geom])), called(model, "geom", geom)
    if kind == types.mjGEOM_BOX:
        return ElementTree.Element("box", size=_text(2.0 * size))
    if kind == types.mjGEOM_SPHERE:
        return ElementTree.Element("sphere", radius=f"{size[0]:.12g}")
    if kind in (types.mjGEOM_CYLINDER, types.mjGEOM_CAPSULE):
        if kind == types.mjGEOM_CAPSULE:
            lost.setdefault("capsules (replaced by cylinders of the same length)", []).append(name)
        length = 2.0 * (size[1] + (size[0] if kind == types.mjGEOM_CAPSULE else 0.0))
        return ElementTree.Element("cylinder", radius=f"{size[0]:.12g}", length=f"{length:.12g}")
    lost.setdefault("shapes left out, without contacts", []).append(name)
    return None


def _left_out(model: Any, lost: Lost) -> None:
    """What has no place in a URDF, where the model has some."""
    joints = [called(model, "joint", int(j)) for j in model.dof_jntid]
    for what, values in (
        ("rotors (armature)", model.dof_armature),
        ("springs of joints", np.asarray(model.jnt_stiffness)[model.dof_jntid]),
        ("drag of joints", np.abs(model.dof_dampingpoly).max(axis=1)),
    ):
        held = [f"{joints[i]} {float(values[i]):.4g}" for i in np.flatnonzero(values)]
        if held:
            lost[what] = list(dict.fromkeys(held))
    if model.nu:
        lost["actuators, their gains and servos"] = [called(model, "actuator", i) for i in range(model.nu)]
    if not np.allclose(model.opt.gravity, STANDARD_GRAVITY, atol=0.01):
        lost["gravity"] = [f"{_text(np.round(model.opt.gravity, 5))} m/s²"]
    for what, count in (("equality constraints", model.neq), ("tendons", model.ntendon)):
        if count:
            lost[what] = [str(count)]
    ground = [called(model, "geom", int(g)) for g in np.flatnonzero(model.geom_bodyid == 0)]
    if ground:
        lost["what stands in the world"] = ground
