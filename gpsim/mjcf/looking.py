"""What a model is like in given positions: its mass matrix, what touches, tangent vectors."""

from __future__ import annotations

import copy
from typing import Any

import numpy as np

from gpsim.channels import BoolArray, FloatArray
from gpsim.mjcf.body import Body
from gpsim.mjcf.layout import Layout
from gpsim.mjcf.optional import mujoco, quiet


def dense(model: Any, packed: FloatArray) -> FloatArray:
    """(B, nv, nv) symmetric of MuJoCo's packed lower triangles (B, nC)."""
    out = np.zeros((len(packed), model.nv, model.nv))
    for row in range(model.nv):
        first, count = int(model.M_rowadr[row]), int(model.M_rownnz[row])
        columns = np.asarray(model.M_colind[first : first + count])
        out[:, row, columns] = packed[:, first : first + count]
        out[:, columns, row] = packed[:, first : first + count]
    return out


@quiet()
def penetration(body: Body, layout: Layout, state: FloatArray) -> tuple[FloatArray, list[str]]:
    """(B,) m: the least distance of what touches, negative inside, 0 where nothing does; and which bodies."""
    mj, model = mujoco(), body.base
    data, deepest, pairs = mj.MjData(model), np.zeros(len(state)), [""] * len(state)
    qpos, _ = layout.full(state)
    for i, q in enumerate(qpos):
        data.qpos[:] = q
        mj.mj_fwdPosition(model, data)
        for contact in data.contact[: data.ncon]:
            if contact.dist < deepest[i]:
                deepest[i] = contact.dist
                pairs[i] = " and ".join(body.names.bodies[model.geom_bodyid[g]] for g in contact.geom)
    return deepest, pairs


@quiet()
def meetings(body: Body, layout: Layout, state: FloatArray) -> frozenset[frozenset[int]]:
    """Pairs of geoms that touch in any of these states (B, S)."""
    mj, model, found = mujoco(), body.base, set()
    data = mj.MjData(model)
    for q in layout.full(state)[0]:
        data.qpos[:] = q
        mj.mj_fwdPosition(model, data)
        found |= {frozenset(pair) for pair in data.contact.geom[: data.ncon].tolist()}
    return frozenset(found)


@quiet()
def pressed(body: Body, layout: Layout, state: FloatArray, margin: float) -> BoolArray:
    """(B, nv): the degrees of freedom that what touches pushes, or would if it were nearer by margin [m]."""
    mj, model = mujoco(), copy.copy(body.base)
    model.geom_margin[:] += margin
    data, carried = mj.MjData(model), np.zeros((model.nbody, model.nv), dtype=np.bool_)
    for b in range(1, model.nbody):  # parents come first
        own = slice(int(model.body_dofadr[b]), int(model.body_dofadr[b]) + int(model.body_dofnum[b]))
        carried[b] = carried[model.body_parentid[b]]
        carried[b, own] = bool(model.body_dofnum[b])
    out = np.zeros((len(state), model.nv), dtype=np.bool_)
    for row, q in zip(out, layout.full(state)[0], strict=True):
        data.qpos[:] = q
        mj.mj_fwdPosition(model, data)
        if data.ncon:
            one, other = model.geom_bodyid[data.contact.geom[: data.ncon]].T
            row[:] = (carried[one] ^ carried[other]).any(axis=0)
    return out


@quiet()
def comes_near(body: Body, layout: Layout, state: FloatArray, margin: float) -> bool:
    """Whether in any of these states (B, S) two bodies that may touch are nearer to each other than margin [m]."""
    mj, model = mujoco(), copy.copy(body.base)
    model.geom_margin[:] += margin
    model.pair_margin[:] += margin
    data = mj.MjData(model)
    for q in layout.full(state)[0]:
        data.qpos[:] = q
        mj.mj_fwdPosition(model, data)
        if data.ncon:
            return True
    return False


def plus(body: Body, layout: Layout, state: FloatArray, change: FloatArray) -> FloatArray:
    """(B, S): states moved by tangent vectors (B, 2 nv): of positions, then of velocities."""
    mj, model = mujoco(), body.model
    qpos, qvel = layout.full(state)
    for i in range(len(state)):
        mj.mj_integratePos(model, qpos[i], np.ascontiguousarray(change[i, : model.nv]), 1.0)
    return layout.state(qpos, qvel + change[:, model.nv :])


def minus(body: Body, layout: Layout, after: FloatArray, before: FloatArray) -> FloatArray:
    """(B, 2 nv): the tangent vectors that lead from one state to the other."""
    mj, model = mujoco(), body.model
    (q1, v1), (q0, v0) = layout.full(after), layout.full(before)
    moved = np.empty((len(after), model.nv))
    for i in range(len(after)):
        mj.mj_differentiatePos(model, moved[i], 1.0, q0[i], q1[i])
    return np.concatenate([moved, v1 - v0], axis=1)


def free_model(body: Body) -> Any:
    """A copy of the model that keeps its energy: without damping, friction, motors, contacts and limits."""
    mj, model = mujoco(), copy.copy(body.base)
    for bit in ("DAMPER", "ACTUATION", "CONTACT", "LIMIT", "FRICTIONLOSS"):
        model.opt.disableflags |= int(getattr(mj.mjtDisableBit, f"mjDSBL_{bit}"))
    return model
