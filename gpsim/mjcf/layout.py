"""Where a simulator's channels lie in a model's positions and velocities, and what touches in such states."""

from __future__ import annotations

import copy
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from gpsim.channels import BoolArray, Channels, FloatArray
from gpsim.mjcf.body import Body
from gpsim.mjcf.naming import POSE
from gpsim.mjcf.optional import mujoco, quiet


@dataclass(frozen=True)
class Layout:
    """The columns of positions and velocities, and their places in qpos and qvel.

    simple: of every hinge and slide joint its places in both; freed: of every free joint the first of them; turned:
    of every free joint the columns of its quaternion.
    """

    size: int
    q_columns: tuple[int, ...]
    q_places: tuple[int, ...]
    v_columns: tuple[int, ...]
    v_places: tuple[int, ...]
    simple: tuple[tuple[int, int], ...]
    freed: tuple[tuple[int, int], ...]
    qpos: FloatArray
    qvel: FloatArray
    turned: tuple[tuple[int, ...], ...] = ()

    @classmethod
    def of(cls, body: Body, state: Channels, fixed: Mapping[str, float]) -> Layout:
        """The layout of the channels `state` of a model, whose other ones are `fixed`."""
        names, model = body.names, body.model
        every = dict(zip(names.state.names, zip(names.positions, names.velocities, strict=True), strict=True))
        at = [every[c.name] for c in state]
        qpos, qvel = np.array(model.qpos0), np.zeros(model.nv)
        for name, value in fixed.items():
            q, v = every[name]
            where, place = (qpos, q) if q >= 0 else (qvel, v)
            where[place] = value
        places = [(int(model.jnt_qposadr[j]), int(model.jnt_dofadr[j])) for j in range(model.njnt)]
        return cls(
            len(state),
            tuple(i for i, (q, _) in enumerate(at) if q >= 0),
            tuple(q for q, _ in at if q >= 0),
            tuple(i for i, (_, v) in enumerate(at) if v >= 0),
            tuple(v for _, v in at if v >= 0),
            tuple(places[j] for j in names.joints),
            tuple(p for j, p in enumerate(places) if j not in names.joints),
            qpos,
            qvel,
            tuple(
                tuple(state.index(f"{name}.{part}") for part in POSE[3:])
                for name in names.free
                if all(f"{name}.{part}" in state.names for part in POSE[3:])
            ),
        )

    def full(self, state: FloatArray) -> tuple[FloatArray, FloatArray]:
        """(B, nq), (B, nv) of states (B, S)."""
        qpos, qvel = np.tile(self.qpos, (len(state), 1)), np.tile(self.qvel, (len(state), 1))
        qpos[:, self.q_places] = state[:, self.q_columns]
        qvel[:, self.v_places] = state[:, self.v_columns]
        return qpos, qvel

    def state(self, qpos: FloatArray, qvel: FloatArray) -> FloatArray:
        """(..., S) of (..., nq) and (..., nv)."""
        out = np.empty((*qpos.shape[:-1], self.size))
        out[..., self.q_columns] = qpos[..., self.q_places]
        out[..., self.v_columns] = qvel[..., self.v_places]
        return out

    def motion(self, path: FloatArray) -> tuple[FloatArray, FloatArray]:
        """(N, S) states and (N, nv) accelerations along positions (3, N, Q), with their first two derivatives by time.

        Of a quaternion the second derivative is half its product with the angular acceleration, and more of itself.
        """
        count, nv = path.shape[1], len(self.qvel)
        every = np.zeros((3, count, len(self.qpos)))
        every[0], every[:, :, self.q_places] = self.qpos, path
        moved = np.zeros((2, count, nv))
        for q, v in self.simple:
            moved[:, :, v] = every[1:, :, q]
        for q, v in self.freed:
            quat = every[:, :, q + 3 : q + 7] / np.linalg.norm(every[0, :, q + 3 : q + 7], axis=1)[:, None]
            every[0, :, q + 3 : q + 7] = quat[0]
            moved[:, :, v : v + 3] = every[1:, :, q : q + 3]
            moved[:, :, v + 3 : v + 6] = [turned_by(quat[0], slope) for slope in quat[1:]]
        return self.state(every[0], moved[0]), moved[1]

    def state_error(self, measured: FloatArray, said: FloatArray, plain: FloatArray) -> FloatArray:
        """(..., S): `plain` with what lies between two quaternions: how their lengths differ, and the half angle.

        The imaginary part of said^-1 measured, the shorter way round: the same for q and -q. To first order it is half
        the rotation vector, in the frame of `said`.
        """
        for columns in self.turned:
            q, m = said[..., columns], measured[..., columns]
            length = np.linalg.norm(q, axis=-1)
            turn = _times(q * [1.0, -1.0, -1.0, -1.0], m) / np.where(length > 0.0, length, 1.0)[..., None]
            plain[..., columns[0]] = np.linalg.norm(m, axis=-1) - length
            plain[..., columns[1:]] = turn[..., 1:] * np.where(turn[..., :1] < 0.0, -1.0, 1.0)
        return plain

    def ahead(self, state: FloatArray, step: FloatArray) -> FloatArray:
        """(B, S): about where a substep ends that begins in state (B, S)."""
        qpos, qvel = self.full(state)
        for q, v in self.simple:
            qpos[:, q] += step * qvel[:, v]
        return self.state(qpos, qvel)

    def slope(self, state: FloatArray, acceleration: FloatArray) -> FloatArray:
        """(B, S): d state / dt; a free joint's quaternion is turned by its angular velocity."""
        qpos, qvel = self.full(state)
        moves = np.zeros_like(qpos)
        for q, v in self.simple:
            moves[:, q] = qvel[:, v]
        for q, v in self.freed:
            moves[:, q : q + 3] = qvel[:, v : v + 3]
            w, x, y, z = qpos[:, q + 3 : q + 7].T
            a, b, c = qvel[:, v + 3 : v + 6].T  # rad/s of the body's own frame
            real, i = -x * a - y * b - z * c, w * a + y * c - z * b
            j, k = w * b + z * a - x * c, w * c + x * b - y * a
            moves[:, q + 3 : q + 7] = 0.5 * np.stack([real, i, j, k], axis=1)
        return self.state(moves, acceleration)


def turned_by(quat: FloatArray, slope: FloatArray) -> FloatArray:
    """(K, 3) rad/s of their own frame by which quaternions (K, 4) turn that change by slope (K, 4) a second."""
    return 2.0 * _times(quat * [1.0, -1.0, -1.0, -1.0], slope)[:, 1:]


def _times(a: FloatArray, b: FloatArray) -> FloatArray:
    """(..., 4): Hamilton's product of quaternions, real part first."""
    (w, x, y, z), (s, i, j, k) = np.moveaxis(a, -1, 0), np.moveaxis(b, -1, 0)
    first = w * s - x * i - y * j - z * k, w * i + x * s + y * k - z * j
    last = w * j - x * k + y * s + z * i, w * k + x * j - y * i + z * s
    return np.asarray(np.stack([*first, *last], axis=-1))


def dense(model: Any, packed: FloatArray) -> FloatArray:
    """(B, nv, nv) symmetric of MuJoCo's packed lower triangles (B, nC)."""
    out = np.zeros((len(packed), model.nv, model.nv))
    for row in range(model.nv):
        first, count = int(model.M_rowadr[row]), int(model.M_rownnz[row])
        columns = np.asarray(model.M_colind[first : first + count])
        out[:, row, columns] = packed[:, first : first + count]
        out[:, columns, row] = packed[:, first : first + count]
    return out


def pressed(body: Body, layout: Layout, state: FloatArray, margin: float) -> BoolArray:
    """(B, nv): the degrees of freedom that what touches pushes, or would if it were nearer by margin [m]."""
    model = copy.copy(body.base)
    model.geom_margin[:] += margin
    carried = np.zeros((model.nbody, model.nv), dtype=np.bool_)
    for b in range(1, model.nbody):  # parents come first
        own = slice(int(model.body_dofadr[b]), int(model.body_dofadr[b]) + int(model.body_dofnum[b]))
        carried[b] = carried[model.body_parentid[b]]
        carried[b, own] = bool(model.body_dofnum[b])
    out = np.zeros((len(state), model.nv), dtype=np.bool_)
    for i, data in contacts(model, layout, state):
        one, other = model.geom_bodyid[data.contact.geom[: data.ncon]].T
        out[i] = (carried[one] ^ carried[other]).any(axis=0)
    return out


def contacts(model: Any, layout: Layout, state: FloatArray) -> Iterator[tuple[int, Any]]:
    """The numbers of the states (B, S) in which something touches, with MuJoCo's data of that moment."""
    mj, data = mujoco(), mujoco().MjData(model)
    with quiet():
        for i, q in enumerate(layout.full(state)[0]):
            data.qpos[:] = q
            mj.mj_fwdPosition(model, data)
            if data.ncon:
                yield i, data
