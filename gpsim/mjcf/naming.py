"""What a MuJoCo model's joints, actuators and bodies are called as channels, actions and parameters.

A hinge or slide joint NAME is the channel NAME with the velocity NAME_dot; a free joint has its pose NAME.x .y .z
.qw .qx .qy .qz and its twist NAME.vx .vy .vz .wx .wy .wz (MuJoCo's: linear in the world, angular in the body); what
acts along or about the axes of its body is at NAME.surge .sway .heave .roll .pitch .yaw (SNAME 1950, Technical and
Research Bulletin 1-5), along those of the world at NAME.x .y .z. What has no name is joint0, actuator0, body0 by its
number.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from gpsim.channels import Channel, Channels, FloatArray
from gpsim.errors import UsageError
from gpsim.mjcf.optional import mujoco
from gpsim.recordings import check_channels, check_name
from gpsim.simulators import Coordinate

POSE = ("x", "y", "z", "qw", "qx", "qy", "qz")
TWIST = ("vx", "vy", "vz", "wx", "wy", "wz")
MOTIONS = ("surge", "sway", "heave", "roll", "pitch", "yaw")
POSE_UNITS = ("m", "m", "m", "1", "1", "1", "1")
TWIST_UNITS = ("m/s", "m/s", "m/s", "rad/s", "rad/s", "rad/s")


@dataclass(frozen=True)
class Names:
    """The channels of a model and where they lie in it.

    positions, velocities: of every state channel the place in qpos, or in qvel; -1 where it is of the other kind.
    dofs: of every coordinate its degree of freedom; joints: its joint. drives: action -> the joint that it moves.
    """

    state: Channels
    action: Channels
    rate: Channels
    coordinates: tuple[Coordinate, ...]
    positions: tuple[int, ...]
    velocities: tuple[int, ...]
    dofs: tuple[int, ...]
    joints: tuple[int, ...]
    bodies: tuple[str, ...]
    free: tuple[str, ...]
    drives: Mapping[str, str]

    def afloat(self, place: str) -> tuple[str, int] | None:
        """Of a place at a free joint the joint and its degree of freedom, 0 to 5; None of any other place."""
        joint, _, axis = place.rpartition(".")
        where = MOTIONS if axis in MOTIONS else POSE[:3]
        return (joint, where.index(axis)) if joint in self.free and axis in where else None

    def dof(self, place: str) -> int:
        """The degree of freedom of a coordinate, or of a place at a free joint: in the world for the first three."""
        if (free := self.afloat(place)) is not None:
            twist = self.state.names.index(f"{free[0]}.{TWIST[free[1]]}")
            return self.velocities[twist]
        return self.dofs[[c.name for c in self.coordinates].index(place)]


def names_of(model: Any, where: str) -> Names:
    """The names of a compiled model; raises UsageError for what gpsim cannot diagnose."""
    mj = mujoco()
    # Names become columns and lines of text: refuse one that breaks them, as of a log's columns.
    bodies = tuple(called(model, "body", b) for b in range(model.nbody))
    for index, body in enumerate(bodies):
        check_name(body, f"{where}: body number {index}")
    for element, count in (("joint", model.njnt), ("actuator", model.nu)):
        for index in range(count):
            check_channels([called(model, element, index)], f"{where}: {element} number {index}")
    state: list[tuple[Channel, int, int]] = []
    rate: list[Channel] = []
    coordinates, dofs, joints, free = [], [], [], []
    for j in range(model.njnt):
        name, kind = called(model, "joint", j), int(model.jnt_type[j])
        q, v = int(model.jnt_qposadr[j]), int(model.jnt_dofadr[j])
        if kind == mj.mjtJoint.mjJNT_BALL:
            raise UsageError(
                f"{where}: {name} is a ball joint, which gpsim does not support; use three hinges instead, or weld it"
            )
        if kind == mj.mjtJoint.mjJNT_FREE:
            free.append(name)
            state += [(Channel(f"{name}.{p}", POSE_UNITS[i]), q + i, -1) for i, p in enumerate(POSE)]
            state += [(Channel(f"{name}.{p}", TWIST_UNITS[i]), -1, v + i) for i, p in enumerate(TWIST)]
            parts = [f"a{p[1:]}" if p[0] == "v" else f"{p}_rate" for p in TWIST]
            rate += [Channel(f"{name}.{p}", f"{u}^2") for p, u in zip(parts, TWIST_UNITS, strict=True)]
            continue
        hinge = kind == mj.mjtJoint.mjJNT_HINGE
        unit, force = ("rad", "N m") if hinge else ("m", "N")
        # Known modulo a turn only where nothing in the model tells one turn from the next.
        held = bool(model.jnt_limited[j]) or float(model.jnt_stiffness[j]) != 0.0 or servoed(model, j)
        state.append((Channel(name, unit, hinge and not held), q, -1))
        state.append((Channel(f"{name}_dot", f"{unit}/s"), -1, v))
        rate.append(Channel(f"{name}_acc", f"{unit}/s^2"))
        damped, grips = float(model.dof_damping[v]), float(model.dof_frictionloss[v])
        coordinates.append(Coordinate(name, f"{name}_dot", f"{name}_acc", force, damped, grips))
        dofs.append(v)
        joints.append(j)
    if not coordinates and not free:
        raise UsageError(f"{where}: it has no joint, so no physics could be missing")
    actions = [Channel(called(model, "actuator", i), _command_unit(model, i)) for i in range(model.nu)]
    both = {c.name for c in actions} & {c.name for c, _, _ in state}
    if both:
        # A joint and its motor often share a name; the recording's columns cannot.
        actions = [Channel(f"{c.name}_cmd" if c.name in both else c.name, c.unit) for c in actions]
    kinds = (mj.mjtTrn.mjTRN_JOINT, mj.mjtTrn.mjTRN_JOINTINPARENT)
    drives = {
        action.name: called(model, "joint", int(model.actuator_trnid[i, 0]))
        for i, action in enumerate(actions)
        if int(model.actuator_trntype[i]) in kinds
    }
    return Names(
        Channels(tuple(c for c, _, _ in state)),
        Channels(tuple(actions)),
        Channels(tuple(rate)),
        tuple(coordinates),
        tuple(p for _, p, _ in state),
        tuple(v for _, _, v in state),
        tuple(dofs),
        tuple(joints),
        bodies,
        tuple(free),
        drives,
    )


def called(model: Any, kind: str, index: int) -> str:
    """The name of a joint, actuator, body or other element; of one that has none its kind and number."""
    return str(getattr(model, kind)(index).name) or f"{kind}{index}"


def servoed(model: Any, joint: int) -> bool:
    """Whether an actuator's force depends on where the joint is."""
    own = [i for i in range(model.nu) if int(model.actuator_trnid[i, 0]) == joint]
    return any(float(model.actuator_biasprm[i, 1]) != 0.0 for i in own)


def _command_unit(model: Any, index: int) -> str:
    """Of a servo the joint's own, or its speed's; of a motor of gear 1 its force; else a number."""
    mj = mujoco()
    kind, joint = int(model.actuator_trntype[index]), int(model.actuator_trnid[index, 0])
    units = {int(mj.mjtJoint.mjJNT_HINGE): ("rad", "N m"), int(mj.mjtJoint.mjJNT_SLIDE): ("m", "N")}
    on_joint = kind in (mj.mjtTrn.mjTRN_JOINT, mj.mjtTrn.mjTRN_JOINTINPARENT)
    if not on_joint or int(model.jnt_type[joint]) not in units:
        return "1"
    length, force = units[int(model.jnt_type[joint])]
    if float(model.actuator_biasprm[index, 1]) != 0.0:
        integrates = int(model.actuator_dyntype[index]) == mj.mjtDyn.mjDYN_INTEGRATOR
        return f"{length}/s" if integrates else length
    if float(model.actuator_biasprm[index, 2]) != 0.0:
        return f"{length}/s"
    plain = float(model.actuator_gear[index, 0]) == 1.0 == float(model.actuator_gainprm[index, 0])
    return force if plain else "1"


@dataclass(frozen=True)
class Axis:
    """One of the six: velocities and orientation are in these columns of a state, dofs in the model.

    axis: 0 to 2, of the body's own frame. A free joint's linear velocities are in the world, its angular ones and their
    forces in the body (MuJoCo's).
    """

    axis: int
    linear: bool
    velocities: tuple[int, ...]
    orientation: tuple[int, ...]
    dofs: tuple[int, ...]

    def along(self, state: FloatArray) -> tuple[FloatArray, FloatArray]:
        """(B,) m/s or rad/s along it or about it in states (B, S), and (B, 3) its direction in their frame."""
        if not self.linear:
            return state[:, self.velocities[self.axis]], np.tile(np.eye(3)[self.axis], (len(state), 1))
        w, *v = state[:, self.orientation].T
        i, j, k = self.axis, (self.axis + 1) % 3, (self.axis + 2) % 3
        out = np.empty((len(state), 3))
        out[:, i] = w * w + v[i] * v[i] - v[j] * v[j] - v[k] * v[k]
        out[:, j] = 2.0 * (v[i] * v[j] + w * v[k])
        out[:, k] = 2.0 * (v[i] * v[k] - w * v[j])
        out /= (state[:, self.orientation] ** 2).sum(axis=1)[:, None]
        return np.asarray((out * state[:, self.velocities]).sum(axis=1)), out


def axes_of(names: Names, state: Channels) -> dict[str, Axis]:
    """Of every free joint the axes of its body by their places, in these channels."""
    found = {}
    for joint in names.free:
        orientation = tuple(state.index(f"{joint}.{part}") for part in POSE[3:])
        for i, motion in enumerate(MOTIONS):
            half = 3 * (i // 3)
            velocities = tuple(state.index(f"{joint}.{part}") for part in TWIST[half : half + 3])
            places = POSE[:3] if half == 0 else MOTIONS[3:]
            dofs = tuple(names.dof(f"{joint}.{part}") for part in places)
            found[f"{joint}.{motion}"] = Axis(i - half, half == 0, velocities, orientation, dofs)
    return found
