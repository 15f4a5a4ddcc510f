"""A corrected model as URDF: links, joints, inertias, damping and friction; what URDF cannot hold is listed."""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from typing import Any
from xml.etree import ElementTree

import numpy as np
from scipy.spatial.transform import Rotation

from gpsim.channels import FloatArray
from gpsim.mjcf.optional import mujoco
from gpsim.mjcf.urdf import GYRATION, MASS

WORLD = "world"
STANDARD_GRAVITY = (0.0, 0.0, -9.81)
FASTEST, STRONGEST = 1e3, 1e6  # that a joint's limits say where the model has none: URDF demands numbers
Lost = dict[str, list[str]]


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
        for element in _body(model, body, lost):
            robot.append(element)
    _left_out(model, lost)
    ElementTree.indent(robot)
    text = ElementTree.tostring(robot, encoding="unicode")
    return f'<?xml version="1.0"?>\n{text}\n', [f"{what}: {', '.join(on)}" for what, on in lost.items()]


def _body(model: Any, body: int, lost: Lost) -> Iterator[ElementTree.Element]:
    """The links and joints that lead to a body, and its own link."""
    called, first = _called(model, body), int(model.body_jntadr[body])
    joints = range(first, first + int(model.body_jntnum[body]))
    parent = int(model.body_parentid[body])
    turn = Rotation.from_quat(model.body_quat[body], scalar_first=True)
    place = model.body_pos[body] - _shift(model, parent)
    before = _called(model, parent)
    at = np.zeros(3)
    if not len(joints):
        yield _joint("fixed", f"{called}_fixed", before, called, place, turn)
    for joint in joints:
        kind, axis = _kind(model, joint), np.array(model.jnt_axis[joint])
        anchor = np.zeros(3) if kind in ("floating", "prismatic") else model.jnt_pos[joint] - at
        child = called if joint == joints[-1] else f"{called}_{joint - first}"
        reference = float(model.qpos0[model.jnt_qposadr[joint]])
        place = place + turn.apply(anchor)
        if kind == "ball":
            lost.setdefault("ball joints, which are fixed", []).append(model.joint(joint).name)
            kind = "fixed"
        elif kind == "prismatic":
            place = place - turn.apply(axis * reference)
        elif kind != "floating":
            turn = turn * Rotation.from_rotvec(-reference * axis)
        made = _joint(kind, model.joint(joint).name or f"joint{joint}", before, child, place, turn)
        if kind not in ("fixed", "floating"):
            _limits(model, joint, kind, axis, made)
        yield made
        if child != called:
            yield _bare(child)
        before, place, turn, at = child, np.zeros(3), Rotation.identity(), at + anchor
    yield _link(model, body, called, lost)


def _bare(name: str) -> ElementTree.Element:
    """A link between two joints of a body: next to no mass, since few who read URDF take none."""
    link = ElementTree.Element("link", name=name)
    inertial = ElementTree.SubElement(link, "inertial")
    ElementTree.SubElement(inertial, "mass", value=f"{MASS:g}")
    each = f"{MASS * GYRATION**2:g}"
    ElementTree.SubElement(inertial, "inertia", ixx=each, iyy=each, izz=each, ixy="0", ixz="0", iyz="0")
    return link


def _called(model: Any, body: int) -> str:
    return WORLD if body == 0 else model.body(body).name or f"body{body}"


def _shift(model: Any, body: int) -> FloatArray:
    """(3,) where a link's frame lies in its body's: at the last hinge."""
    first = int(model.body_jntadr[body])
    hinges = [
        j
        for j in range(first, first + int(model.body_jntnum[body]))
        if _kind(model, j) not in ("floating", "prismatic")
    ]
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
    transmission = mujoco().mjtTrn.mjTRN_JOINT
    mine = (model.actuator_trntype == transmission) & (model.actuator_trnid[:, 0] == joint)
    limited = mine & (model.actuator_forcelimited != 0)
    if not limited.any():
        return STRONGEST
    most = np.abs(model.actuator_forcerange).max(axis=1) * np.abs(model.actuator_gear[:, 0])
    return float(most[limited].sum())


def _link(model: Any, body: int, called: str, lost: Lost) -> ElementTree.Element:
    link, shift = ElementTree.Element("link", name=called), _shift(model, body)
    if model.body_mass[body] > 0.0:
        inertial = ElementTree.SubElement(link, "inertial")
        turn = Rotation.from_quat(model.body_iquat[body], scalar_first=True)
        inertial.append(_origin(model.body_ipos[body] - shift, turn))
        ElementTree.SubElement(inertial, "mass", value=f"{model.body_mass[body]:.12g}")
        xx, yy, zz = (f"{v:.12g}" for v in model.body_inertia[body])
        ElementTree.SubElement(inertial, "inertia", ixx=xx, iyy=yy, izz=zz, ixy="0", ixz="0", iyz="0")
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
    kind, name = types(int(model.geom_type[geom])), model.geom(geom).name or f"geom{geom}"
    if kind == types.mjGEOM_BOX:
        return ElementTree.Element("box", size=_text(2.0 * size))
    if kind == types.mjGEOM_SPHERE:
        return ElementTree.Element("sphere", radius=f"{size[0]:.12g}")
    if kind in (types.mjGEOM_CYLINDER, types.mjGEOM_CAPSULE):
        if kind == types.mjGEOM_CAPSULE:
            lost.setdefault("capsules, which are cylinders as long", []).append(name)
        length = 2.0 * (size[1] + (size[0] if kind == types.mjGEOM_CAPSULE else 0.0))
        return ElementTree.Element("cylinder", radius=f"{size[0]:.12g}", length=f"{length:.12g}")
    lost.setdefault("shapes left out, which then touch nothing", []).append(name)
    return None


def _left_out(model: Any, lost: Lost) -> None:
    """What has no place in a URDF, where the model has some."""
    joints = [model.joint(int(j)).name or f"joint{j}" for j in model.dof_jntid]
    for what, values in (
        ("rotors (armature)", model.dof_armature),
        ("springs of joints", np.asarray(model.jnt_stiffness)[model.dof_jntid]),
        ("drag of joints", np.abs(model.dof_dampingpoly).max(axis=1)),
    ):
        held = [f"{joints[i]} {float(values[i]):.4g}" for i in np.flatnonzero(values)]
        if held:
            lost[what] = list(dict.fromkeys(held))
    if model.nu:
        lost["actuators, their gains and servos"] = [
            model.actuator(i).name or f"actuator{i}" for i in range(model.nu)
        ]
    if not np.allclose(model.opt.gravity, STANDARD_GRAVITY, atol=0.01):
        lost["gravity"] = [f"{_text(np.round(model.opt.gravity, 5))} m/s²"]
    for what, count in (("equality constraints", model.neq), ("tendons", model.ntendon)):
        if count:
            lost[what] = [str(count)]
    ground = [model.geom(int(g)).name or f"geom{g}" for g in np.flatnonzero(model.geom_bodyid == 0)]
    if ground:
        lost["what stands in the world"] = ground
