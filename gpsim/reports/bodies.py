"""The bodies of simulators, as far as anybody knows their shape, and MuJoCo models in three dimensions.

Many models hold masses and joints alone: a body without a shape is drawn as sticks to the joints that it carries, or to
its centre of mass.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from gpsim.channels import FloatArray
from gpsim.mjcf import MjcfSimulator, mujoco
from gpsim.reports.scene import STRAIGHT, WORLD, Body, Columns, Frame, Shape, Turn, Vector
from gpsim.simulators import Simulator

THICK = 0.08  # of the longest stick
HIDDEN = 3  # groups of geoms from here on are collision shapes, which MuJoCo's viewer does not show either


def body_of(simulator: Simulator, parameters: Mapping[str, float], reach: float) -> Body | None:
    """The body of a simulator; None of one whose shape nobody knows. reach: m that it travels, for what has no size."""
    if isinstance(simulator, MjcfSimulator):
        return robot(simulator)
    units, positions = simulator.state.units, [c.name for c in simulator.coordinates]
    if simulator.name == "cartpole":
        return _cart_pole(parameters["pole_half_length"])
    if simulator.name == "pendulum":
        return _pendulum(parameters["length"])
    if {"x": "m", "y": "m", "yaw": "rad"}.items() <= units.items():
        return _vehicle(1.5 * parameters["wheelbase"] if "wheelbase" in parameters else reach / 20)
    if len(positions) == 1 and units[positions[0]] == "m":
        block = Shape("", "cube", (0.0, 0.0, 0.0), (reach / 5, reach / 10, reach / 10))
        along = positions[0]
        return Body((along,), lambda columns: {"": _frame(WORLD, (columns[along], 0.0, 0.0))}, (block,))
    return None


def _frame(
    parent: str, position: Sequence[float | FloatArray], axis: int = 2, angle: float | FloatArray = 0.0
) -> Frame:
    """At (x, y, z) m, turned by `angle` [rad] about the axis of this number."""
    *place, angles = np.broadcast_arrays(*position, angle)
    turn = np.zeros((len(angles), 4))
    turn[:, axis], turn[:, 3] = np.sin(angles / 2), np.cos(angles / 2)
    return Frame(parent, np.stack(place, axis=1), turn)


def _cart_pole(half: float) -> Body:
    """Theta leans towards +x, 0 upright; the pole is twice `half` [m] long."""

    def frames(columns: Columns) -> dict[str, Frame]:
        pole = _frame("", (0.0, 0.0, 0.0), 1, columns["theta"])
        return {"": _frame(WORLD, (columns["x"], 0.0, 0.0)), "pole": pole}

    cart = Shape("", "cube", (0.0, 0.0, -half / 5), (0.8 * half, half / 2, 0.4 * half))
    pole = Shape("pole", "cylinder", (0.0, 0.0, half), (half / 12, half / 12, 2 * half))
    return Body(("x", "theta"), frames, (cart, pole))


def _pendulum(length: float) -> Body:
    """Theta turns the bob from below towards +x; the frame's origin is the bob."""

    def frames(columns: Columns) -> dict[str, Frame]:
        theta = columns["theta"]
        return {"": _frame(WORLD, (length * np.sin(theta), 0.0, -length * np.cos(theta)), 1, -theta)}

    bob = Shape("", "sphere", (0.0, 0.0, 0.0), (length / 5, length / 5, length / 5))
    rod = Shape("", "cylinder", (0.0, 0.0, length / 2), (length / 25, length / 25, length))
    return Body(("theta",), frames, (bob, rod))


def _vehicle(length: float) -> Body:
    """A box with a nose; yaw turns it about z."""

    def frames(columns: Columns) -> dict[str, Frame]:
        return {"": _frame(WORLD, (columns["x"], columns["y"], 0.0), 2, columns["yaw"])}

    hull = Shape("", "cube", (0.0, 0.0, length / 8), (length, 0.6 * length, length / 4))
    nose = Shape("", "arrow", (length / 2, 0.0, length / 8), (length / 2, length / 8, length / 8))
    return Body(("x", "y", "yaw"), frames, (hull, nose), path=True)


class Poses(NamedTuple):
    """In N states: of bodies position and centre of mass (N, B, 3) m and turn (N, B, 4) x, y, z, w.

    Of joints anchor (N, J, 3) m and axis (N, J, 3).
    """

    position: FloatArray
    centre: FloatArray
    turn: FloatArray
    anchor: FloatArray
    axis: FloatArray


def poses(model: Any, qpos: FloatArray) -> Poses:
    """Where bodies and joints are; qpos: (N, nq)."""
    mj, found = mujoco(), []
    data = mj.MjData(model)
    for row in qpos:
        data.qpos[:] = row
        mj.mj_kinematics(model, data)
        now = (data.xpos, data.xipos, data.xquat[:, [1, 2, 3, 0]], data.xanchor, data.xaxis)
        found.append([each.copy() for each in now])
    return Poses(*(np.array(each) for each in zip(*found, strict=True)))


def robot(simulator: MjcfSimulator) -> Body:
    """Every body of the model that something hangs in is a frame in the world."""
    model, names = simulator.body.base, simulator.body.names
    hung = shapes(model, names.bodies)
    seen = {shape.frame for shape in hung}
    places = {n: p for n, p in zip(names.state.names, names.positions, strict=True) if p >= 0}

    def frames(columns: Columns) -> dict[str, Frame]:
        qpos = np.tile(model.qpos0, (len(next(iter(columns.values()))), 1))
        qpos[:, list(places.values())] = np.stack([columns[name] for name in places], axis=1)
        at = poses(model, qpos)
        return {
            name: Frame(WORLD, at.position[:, b], at.turn[:, b])
            for b, name in enumerate(names.bodies)
            if name in seen
        }

    return Body(tuple(places), frames, hung)


def shown_geoms(model: Any) -> list[int]:
    """What a viewer shows of a robot: no endless ground, collision shapes only where there is nothing else."""
    mj = mujoco()
    endless = (mj.mjtGeom.mjGEOM_PLANE, mj.mjtGeom.mjGEOM_HFIELD)
    solid = [g for g in range(model.ngeom) if int(model.geom_type[g]) not in endless]
    return [g for g in solid if model.geom_group[g] < HIDDEN and model.geom_rgba[g, 3] > 0.0] or solid


def sticks(model: Any, clad: Collection[int]) -> list[tuple[int, FloatArray, FloatArray]]:
    """Of every moving body that is not clad: the body, and from where to where (3,) m, in its frame."""
    found = []
    for b in range(1, model.nbody):
        if b in clad or model.body_weldid[b] == 0:
            continue
        begin = model.jnt_pos[model.body_jntadr[b]] if model.body_jntnum[b] else np.zeros(3)
        carried = [c for c in range(b + 1, model.nbody) if model.body_parentid[c] == b]
        ends = [model.body_pos[c] for c in carried] or [model.body_ipos[b]]
        found += [(b, np.array(begin), np.array(end)) for end in ends if (end != begin).any()]
    return found


def shapes(model: Any, bodies: tuple[str, ...]) -> tuple[Shape, ...]:
    """What is drawn of a model, each in its body's frame."""
    kinds, found = mujoco().mjtGeom, list[Shape]()
    for g in shown_geoms(model):
        body, kind = bodies[model.geom_bodyid[g]], int(model.geom_type[g])
        centre, turn = _vector(model.geom_pos[g]), _turn(model.geom_quat[g])
        a, b, c = model.geom_size[g].tolist()
        if kind == kinds.mjGEOM_CAPSULE:
            found += _rod(body, centre, turn, 2 * a, 2 * b)
        elif kind == kinds.mjGEOM_MESH:
            m = int(model.geom_dataid[g])
            faces = model.mesh_face[model.mesh_faceadr[m] :][: model.mesh_facenum[m]]
            triangles = model.mesh_vert[model.mesh_vertadr[m] :][faces].astype(np.float64)
            found.append(Shape(body, "mesh", centre, (1.0, 1.0, 1.0), turn, triangles))
        elif kind == kinds.mjGEOM_CYLINDER:
            found.append(Shape(body, "cylinder", centre, (2 * a, 2 * a, 2 * b), turn))
        elif kind == kinds.mjGEOM_BOX:
            found.append(Shape(body, "cube", centre, (2 * a, 2 * b, 2 * c), turn))
        else:
            size = (2 * a, 2 * b, 2 * c) if kind == kinds.mjGEOM_ELLIPSOID else (2 * a,) * 3
            found.append(Shape(body, "sphere", centre, size, turn))
    clad = set(model.geom_bodyid[shown_geoms(model)].tolist())
    bare = [(b, begin, end, float(np.linalg.norm(end - begin))) for b, begin, end in sticks(model, clad)]
    for b, begin, end, length in bare:
        along = np.zeros(4)
        mujoco().mju_quatZ2Vec(along, end - begin)
        thick = THICK * max(far for *_, far in bare)
        found += _rod(bodies[b], _vector((begin + end) / 2), _turn(along), thick, length)
    return tuple(found)


def _rod(body: str, centre: Vector, turn: Turn, thick: float, length: float) -> list[Shape]:
    """A cylinder with two round ends."""
    x, y, z, w = turn
    half = np.array([x * z + w * y, y * z - w * x, 0.5 - x * x - y * y]) * length
    balls = [_vector(np.array(centre) + end) for end in (half, -half)]
    rod = Shape(body, "cylinder", centre, (thick, thick, length), turn)
    return [rod, *(Shape(body, "sphere", ball, (thick,) * 3, STRAIGHT) for ball in balls)]


def _vector(place: FloatArray) -> Vector:
    x, y, z = place.tolist()
    return x, y, z


def _turn(quaternion: FloatArray) -> Turn:
    """x, y, z, w of MuJoCo's order."""
    w, x, y, z = quaternion.tolist()
    return x, y, z, w
