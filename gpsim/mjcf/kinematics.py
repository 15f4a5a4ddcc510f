"""Where a model says that markers are, and how that changes with each number of its geometry.

Every number moves what lies behind it as a rigid body: the slope of a point x is d along an axis, or a x (x - p)
about one through p (Hollerbach, Khalil and Gautier, Model Identification, Handbook of Robotics, 2016).
"""

from __future__ import annotations

import copy
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from gpsim.channels import FloatArray
from gpsim.mjcf.body import Body
from gpsim.mjcf.geometry import AXES, Moved, Place, Target, ancestors, places_of, target_of, written
from gpsim.mjcf.optional import mujoco

SMALL = 1e-6  # rad, below which a turn's slope is that of none


@dataclass(frozen=True)
class Poses:
    """points (N, T, 3) m and axes (N, T, 3, 3) of all targets, in the motion capture's frame.

    Or a unit's slopes of places: by how much points (N, T, 3, P) move, and axes turn (N, T, 3, P) rad in the frame.
    """

    points: FloatArray
    axes: FloatArray


@dataclass(frozen=True)
class _Passed:
    """The model as it is moved, and what a pass over all samples found of bodies, joints and targets, in its world."""

    model: Any
    xpos: FloatArray
    xmat: FloatArray
    anchor: FloatArray
    axis: FloatArray
    points: FloatArray
    axes: FloatArray


@dataclass(frozen=True)
class Kinematics:
    """A model's forward kinematics to some targets, and the places that may be off."""

    body: Body
    targets: tuple[Target, ...]
    places: tuple[Place, ...]

    @classmethod
    def of(cls, body: Body, names: Sequence[str], turned: Sequence[bool]) -> Kinematics:
        """Of targets by their names; turned: of which the orientation was measured."""
        targets = tuple(target_of(body.base, body.names, name) for name in names)
        return cls(body, targets, places_of(body.base, body.names, targets, turned))

    @cached_property
    def pivot(self) -> FloatArray:
        """(3,) m: the first joint on the way to the first target, about which the frame turns; else the origin."""
        mj, model = mujoco(), self.body.base
        data = mj.MjData(model)
        data.qpos[:] = model.qpos0
        mj.mj_kinematics(model, data)
        chain = ancestors(model, self.targets[0].body)
        joints = [j for j in range(model.njnt) if int(model.jnt_bodyid[j]) in chain]
        return np.array(data.xanchor[joints[0]]) if joints else np.zeros(3)

    def poses(self, qpos: FloatArray, values: FloatArray) -> Poses:
        """Of positions (N, nq), what the encoders say, and a value (P,) of every place."""
        passed, turn = self._passed(qpos, values), rotation_of(values[:3])
        away = values[3:6] + self.pivot
        return Poses((passed.points - self.pivot) @ turn.T + away, turn @ passed.axes)

    def slopes(self, qpos: FloatArray, values: FloatArray) -> Poses:
        """The same places' slopes, exact at these values."""
        passed, turn = self._passed(qpos, values), rotation_of(values[:3])
        shape = (*passed.points.shape, len(self.places))
        points, axes = np.zeros(shape), np.zeros(shape)
        for i, place in enumerate(self.places):
            for k in range(len(self.targets)):
                found = self._slope(place, k, passed, values)
                if found is not None:
                    points[:, k, :, i], axes[:, k, :, i] = found[0] @ turn.T, found[1] @ turn.T
        swing = turn_slope(values[:3])
        arms = (passed.points - self.pivot) @ turn.T
        for i in range(3):
            points[..., i], axes[..., i] = np.cross(swing[:, i], arms), swing[:, i]
            points[..., i, 3 + i] = 1.0
        return Poses(points, axes)

    def _slope(
        self, place: Place, k: int, passed: _Passed, values: FloatArray
    ) -> tuple[FloatArray, FloatArray] | None:
        """(N, 3), (N, 3): of one target in the model's world; None where the place is not on its way."""
        target, names, model, none = self.targets[k], self.body.names, passed.model, np.zeros(3)
        i = AXES.index(place.axis) if place.axis else 0
        if place.kind == "joint zero":
            joint = self.body.joint(place.on)
            if int(model.jnt_bodyid[joint]) not in ancestors(model, target.body):
                return None
            axis = passed.axis[:, joint]
            if int(model.jnt_type[joint]) == int(mujoco().mjtJoint.mjJNT_SLIDE):
                return axis, none
            return np.cross(axis, passed.points[:, k] - passed.anchor[:, joint]), axis
        if place.kind in ("body place", "body turn"):
            b = names.bodies.index(place.on)
            if b not in ancestors(model, target.body):
                return None
            parent = int(model.body_parentid[b])
            carried = passed.xmat[:, parent]
            if place.kind == "body place":
                return carried[:, :, i], none
            own = matrix(self.body.base.body_quat[b]) @ turn_slope(self._own(place.kind, place.on, values))
            origin = passed.xpos[:, parent] + carried @ model.body_pos[b]
            axis = carried @ own[:, i]
            return np.cross(axis, passed.points[:, k] - origin), axis
        if place.kind.startswith("site") and place.on == target.name:
            carried = passed.xmat[:, target.body]
            if place.kind == "site place":
                return carried[:, :, i], none
            quat = self.body.base.site_quat[target.site] if target.site >= 0 else [1.0, 0.0, 0.0, 0.0]
            return none, carried @ (matrix(quat) @ turn_slope(self._own(place.kind, place.on, values)))[:, i]
        return None

    def _passed(self, qpos: FloatArray, values: FloatArray) -> _Passed:
        mj, model, count = mujoco(), copy.copy(self.body.base), len(qpos)
        moved = zip(self.places, values, strict=True)
        written(model, self.body.names, [Moved(place, float(value)) for place, value in moved])
        data = mj.MjData(model)
        xpos, xmat = np.empty((count, model.nbody, 3)), np.empty((count, model.nbody, 9))
        anchor, axis = np.empty((count, model.njnt, 3)), np.empty((count, model.njnt, 3))
        sites, frames = np.empty((count, model.nsite, 3)), np.empty((count, model.nsite, 9))
        held = [(xpos, data.xpos), (xmat, data.xmat), (anchor, data.xanchor), (axis, data.xaxis)]
        held += [(sites, data.site_xpos), (frames, data.site_xmat)]
        where = data.qpos
        for n, q in enumerate(qpos):
            where[:] = q
            mj.mj_kinematics(model, data)
            for out, now in held:
                out[n] = now
        of_bodies, of_sites = xmat.reshape(count, -1, 3, 3), frames.reshape(count, -1, 3, 3)
        bodies, marks, targets = (xpos, of_bodies), (sites, of_sites), self.targets
        points, axes = (
            np.stack([s[:, t.site] if t.site >= 0 else b[:, t.body] for t in targets], axis=1)
            for b, s in zip(bodies, marks, strict=True)
        )
        for k, target in enumerate(self.targets):
            if target.site < 0:  # a marker on a body, which the model has no place for
                points[:, k] += of_bodies[:, target.body] @ self._own("site place", target.name, values)
                axes[:, k] = axes[:, k] @ rotation_of(self._own("site turn", target.name, values))
        return _Passed(model, xpos, of_bodies, anchor, axis, points, axes)

    def _own(self, kind: str, on: str, values: FloatArray) -> FloatArray:
        """(3,): the whole turn or place of which a place is one part."""
        out = np.zeros(3)
        for place, value in zip(self.places, values, strict=True):
            if (place.kind, place.on) == (kind, on):
                out[AXES.index(place.axis)] = value
        return out


def rotation_of(vector: FloatArray) -> FloatArray:
    """(3, 3) of a rotation vector (3,) rad (Rodrigues)."""
    angle, k = float(np.linalg.norm(vector)), _cross_matrix(vector)
    if angle < SMALL:
        return np.asarray(np.eye(3) + k)
    return np.asarray(np.eye(3) + np.sin(angle) / angle * k + (1.0 - np.cos(angle)) / angle**2 * k @ k)


def turn_slope(vector: FloatArray) -> FloatArray:
    """(3, 3): the axes about which a rotation turns on, a unit more of each part of its vector (left Jacobian)."""
    angle, k = float(np.linalg.norm(vector)), _cross_matrix(vector)
    if angle < SMALL:
        return np.asarray(np.eye(3) + 0.5 * k)
    first, second = (1.0 - np.cos(angle)) / angle**2, (angle - np.sin(angle)) / angle**3
    return np.asarray(np.eye(3) + first * k + second * k @ k)


def matrix(quat: FloatArray | list[float]) -> FloatArray:
    """(3, 3) of a unit quaternion, real part first."""
    out = np.zeros(9)
    mujoco().mju_quat2Mat(out, np.asarray(quat, dtype=np.float64))
    return out.reshape(3, 3)


def _cross_matrix(vector: FloatArray) -> FloatArray:
    x, y, z = vector
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
