"""What each effect of a whole robot asks of its joints' torques along the motion that was recorded."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from gpsim.channels import FloatArray
from gpsim.trials.robots.driving import bare_torques
from gpsim.trials.robots.models import layout_of
from gpsim.trials.robots.plant import changed_model
from gpsim.trials.worlds import Run, TrueEffect, World

ROWS = ("viscous_friction", "coulomb_friction", "armature")
"""Families that every joint of a whole robot has a row of."""
OF_BODIES = ("mass", "inertia", "com_x", "com_y", "com_z")


class Motion(NamedTuple):
    """(N, C) positions, velocities and accelerations of the joints, from the samples of all episodes."""

    q: FloatArray
    v: FloatArray
    a: FloatArray


def motion_of(world: World, truth: Run, kept: FloatArray) -> Motion:
    """The motion of what was kept; kept: (E,) samples of every episode."""
    parts = [truth.fine[: int(kept[e]), e] for e in np.flatnonzero(kept)]
    rates = [np.gradient(p[:, 1::2], world.dt, axis=0) for p in parts]
    states = np.concatenate(parts)
    return Motion(states[:, 0::2], states[:, 1::2], np.concatenate(rates))


def of_body(effect: TrueEffect) -> bool:
    """Whether an effect changes a body's mass, its centre or its inertia."""
    changed = effect.on.rpartition(".")[2] in OF_BODIES
    return effect.family == "payload" or (effect.family == "parameter_offset" and changed)


def body_torques(robot: str, effects: Sequence[TrueEffect], motion: Motion) -> FloatArray:
    """(N, C) what changed bodies ask for more than those that are believed."""
    bodies = [e for e in effects if of_body(e)]
    more, bare = (bare_torques(changed_model(robot, es), *motion) for es in (bodies, ()))
    return np.asarray(more - bare)


def joint_torques(world: World, motion: Motion) -> FloatArray:
    """(C,) root mean square of the torque that moves a joint; of one without an actuator, of its weight's."""
    layout = layout_of(world.system)
    total = bare_torques(changed_model(world.system, [e for e in world.effects if of_body(e)]), *motion)
    weight = bare_torques(changed_model(world.system, ()), motion.q, motion.v, np.zeros_like(motion.a))
    for e in world.effects:
        if e.family in (*ROWS, "constant_force"):
            j = layout.joints.index(e.on)
            total[:, j] += _of_joint(e, motion, j)
    moved = [joint in layout.driven.values() for joint in layout.joints]
    return np.asarray(np.where(moved, _rms(total), _rms(weight)))


def shares_of(world: World, motion: Motion) -> list[float | None]:
    """Of every effect the share of its joint's torque, of a body the largest; None of commands."""
    layout, whole = layout_of(world.system), np.maximum(joint_torques(world, motion), 1e-12)
    out: list[float | None] = []
    for e in world.effects:
        if of_body(e):
            out.append(float((_rms(body_torques(world.system, [e], motion)) / whole).max()))
        elif e.on in layout.joints:
            j = layout.joints.index(e.on)
            out.append(float(_rms(_of_joint(e, motion, j)) / whole[j]))
        else:
            out.append(None)
    return out


def _of_joint(effect: TrueEffect, motion: Motion, j: int) -> FloatArray:
    """(N,) what a row asks for, or an offset."""
    v, values = motion.v[:, j], effect.values
    match effect.family:
        case "viscous_friction":
            return np.asarray(values["damping"] * v)
        case "coulomb_friction":
            return np.asarray(values["force"] * np.sign(v))
        case "armature":
            return np.asarray(values["inertia"] * motion.a[:, j])
        case _:
            return np.full(len(v), -values["force"])


def _rms(values: FloatArray) -> FloatArray:
    return np.asarray(np.sqrt(np.mean(values**2, axis=0)))
