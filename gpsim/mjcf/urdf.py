"""A URDF as people keep it: meshes in ROS packages, links without a mass, inertias that no body has."""

from __future__ import annotations

import os
import struct
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np

from gpsim.channels import FloatArray
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


def is_urdf(path: Path) -> bool:
    """Whether a model's file is a URDF, by its ending."""
    return path.suffix.lower() == ".urdf"


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
    _add_motors(spec)
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
    bodies = sorted(
        {
            tuple(sorted(int(model.geom_bodyid[g]) for g in contact.geom))
            for contact in data.contact[: data.ncon]
            if contact.dist < 0.0
        }
    )
    names = [tuple(model.body(b).name for b in pair) for pair in bodies]
    for one, other in names:
        spec.add_exclude(bodyname1=one, bodyname2=other)
    if not names:
        return []
    return [f"links inside each other at rest, which never touch: {_some(' and '.join(n) for n in names)}"]


def _package(name: str, folder: Path) -> Iterator[Path]:
    """Folders that may be a ROS package's: above the file, and where ROS looks."""
    for above in (folder, *folder.parents):
        yield above / name
        if above.name == name or _called(above / "package.xml") == name:
            yield above
    for place in _paths(WORKSPACES):
        yield from (place / name, place) if place.name == name else (place / name,)
    for place in _paths(PREFIXES):
        yield place / "share" / name


def _paths(variable: str) -> list[Path]:
    return [Path(p) for p in os.environ.get(variable, "").split(os.pathsep) if p]


def _called(manifest: Path) -> str | None:
    """What a package.xml calls its package."""
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
            _leave_out(spec, mesh)
        elif found is not None:
            mesh.file = os.path.relpath(found, places[-1])
            if mesh.name not in weighed:
                mesh.inertia = mujoco().mjtMeshInertia.mjMESH_INERTIA_SHELL  # of no use, and always possible
    return [
        f"meshes left out, which then touch nothing ({why}): {_some(names)}" for why, names in missing.items()
    ]


def _leave_out(spec: Any, mesh: Any) -> None:
    for geom in [g for g in spec.geoms if g.meshname == mesh.name]:
        spec.delete(geom)
    spec.delete(mesh)


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
        if body.explicitinertial and body.mass > 0.0:
            continue
        if list(body.geoms) and not body.explicitinertial:
            shaped.append(body.name)
            continue
        body.explicitinertial, body.mass, body.ipos = True, MASS, np.zeros(3)
        body.fullinertia = np.array([MASS * GYRATION**2] * 3 + [0.0] * 3)
        if list(body.joints):
            bare.append(body.name)
    notes = []
    if bare:
        notes.append(f"links that move and have no mass, taken for {MASS:g} kg: {_some(bare)}")
    if shaped:
        notes.append(
            f"links without <inertial>, which weigh what their shapes do at {DENSITY} kg/m^3: {_some(shaped)}"
        )
    return notes


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
    return [f"inertias that no body can have, made the nearest possible: {_some(changed)}"]


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


def _add_motors(spec: Any) -> None:
    """A URDF has no actuators: a motor JOINT_motor of gear 1 for each of its joints."""
    mj = mujoco()
    if list(spec.actuators):
        return
    for joint in spec.joints:
        if joint.type in (mj.mjtJoint.mjJNT_HINGE, mj.mjtJoint.mjJNT_SLIDE):
            motor = spec.add_actuator(name=f"{joint.name}_motor", target=joint.name)
            motor.trntype = mj.mjtTrn.mjTRN_JOINT


def _some(names: Sequence[str] | Iterator[str]) -> str:
    every = list(names)
    more = f" and {len(every) - SOME} more" if len(every) > SOME else ""
    return ", ".join(every[:SOME]) + more
