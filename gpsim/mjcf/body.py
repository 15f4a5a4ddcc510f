"""A model as gpsim asks it: a copy that takes commands as they come, its names, parameters and what it already has."""

from __future__ import annotations

import copy
import math
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np

from gpsim.errors import UsageError
from gpsim.mjcf.activation import Activations, activations_of
from gpsim.mjcf.batches import Pools
from gpsim.mjcf.geometry import Moved, corrected
from gpsim.mjcf.knobs import HEAVIEST, Knob, gain_knob, place_knob, scale_knob
from gpsim.mjcf.loading import Loaded
from gpsim.mjcf.motors import motors_on
from gpsim.mjcf.naming import Names, names_of
from gpsim.mjcf.optional import mujoco
from gpsim.mjcf.surfaces import Surface, surfaces_of
from gpsim.simulators import Parameter

HELD = 1e9  # of inertia: what is held by a mount heavier than anything
LENGTHS = 5.0  # a centre of mass lies no more than so many lengths of its body from where it is believed
SHORT = 0.02  # m, the least length of a body
LIGHT = 1e-5  # of a robot's mass: a part that moves nothing which a recording shows


@dataclass
class Body:
    """A compiled model with its names, parameters, and the batches that step it in this process.

    base: MuJoCo's own, its geometry corrected if that is known. model: commands are not clamped in it, since effects
    act on clamped ones, and nothing in it relies on where a body's centre of mass happens to be.
    """

    loaded: Loaded
    base: Any
    model: Any
    names: Names
    parameters: dict[str, Parameter]
    knobs: dict[str, Knob]
    surfaces: tuple[Surface, ...]
    activations: Activations
    pools: Pools = field(init=False)

    def __post_init__(self) -> None:
        self.pools = Pools(self.model)

    @cached_property
    def motors(self) -> dict[str, tuple[int, ...]]:
        """See `motors_on`."""
        return motors_on(self.model, self.names)

    @cached_property
    def coupled(self) -> dict[str, tuple[str, float]]:
        """Action -> the joint that it alone drives by a multiple of its command, and that multiple."""
        model, out = self.model, {}
        for on, motors in self.motors.items():
            i, none = motors[0], mujoco().mjtBias.mjBIAS_NONE
            strength = float(model.actuator_gear[i, 0] * model.actuator_gainprm[i, 0])
            if len(motors) == 1 and int(model.actuator_biastype[i]) == none and strength > 0.0:
                out[self.names.action.names[i]] = on, strength
        return out

    @property
    def own_step(self) -> float:
        """The model's step [s]."""
        return float(self.model.opt.timestep)

    def lengths(self) -> dict[str, float]:
        """Of every body that moves how long it is [m]."""
        return {self.names.bodies[b]: _length(self.base, b) for b in _moving(self.base)}


def body_of(
    loaded: Loaded,
    held: tuple[str, ...] = (),
    *,
    exact: bool = False,
    contacts: bool = True,
    geometry: tuple[Moved, ...] = (),
) -> Body:
    """What gpsim diagnoses of a model, its joints `held` in a mount; raises UsageError for what it cannot.

    exact: by the classical Runge-Kutta scheme, whatever the model says; contacts: whether bodies touch; geometry: by
    what that of the model is off.
    """
    mj, base = mujoco(), loaded.model
    where = loaded.source.reference
    names = names_of(base, where)
    _check(base, where)
    base = corrected(base, names, geometry) if geometry else base
    model = copy.copy(base)
    off = mj.mjtDisableBit
    model.opt.disableflags |= int(off.mjDSBL_CLAMPCTRL) | int(off.mjDSBL_ISLAND) | int(off.mjDSBL_SENSOR)
    _let_friction_act(model)
    if not contacts:
        model.opt.disableflags |= int(off.mjDSBL_CONTACT)
    if exact:
        model.opt.integrator = int(mj.mjtIntegrator.mjINT_RK4)
        # Which that scheme makes exact: the other one it makes slow, and longer steps must not act a step early.
        model.actuator_dyntype[model.actuator_dyntype == mj.mjtDyn.mjDYN_FILTEREXACT] = mj.mjtDyn.mjDYN_FILTER
        model.actuator_actearly[:] = False
    model.body_sameframe[:] = mj.mjtSameFrame.mjSAMEFRAME_NONE
    for coordinate, dof in zip(names.coordinates, names.dofs, strict=True):
        if coordinate.name in held:
            model.dof_armature[dof] += HELD
            model.dof_damping[dof] = 0.0
            model.dof_frictionloss[dof] = 0.0
    parameters, knobs = _parameters(base, names)
    surfaces = surfaces_of(base, names, where)
    parameters |= {s.parameter: s.declared for s in surfaces}
    knobs |= {s.parameter: s.knob for s in surfaces}
    return Body(loaded, base, model, names, parameters, knobs, surfaces, activations_of(base, where))


def _let_friction_act(model: Any) -> None:
    """A model without constraints (or without dry friction) leaves dry friction out, which may be what is missing."""
    off, flags = mujoco().mjtDisableBit, int(model.opt.disableflags)
    if flags & int(off.mjDSBL_CONSTRAINT):
        flags |= int(off.mjDSBL_EQUALITY) | int(off.mjDSBL_LIMIT) | int(off.mjDSBL_CONTACT)
        flags |= int(off.mjDSBL_FRICTIONLOSS)
    if flags & int(off.mjDSBL_FRICTIONLOSS):
        model.dof_frictionloss[:] = 0.0
        model.tendon_frictionloss[:] = 0.0
    model.opt.disableflags = flags & ~int(off.mjDSBL_CONSTRAINT) & ~int(off.mjDSBL_FRICTIONLOSS)


def _check(model: Any, where: str) -> None:
    if int(getattr(model, "nhistory", 0)):
        raise UsageError(
            f"{where}: it delays actuators or sensors itself; take delay= out of the model: gpsim finds delays"
        )


def _moving(model: Any) -> list[int]:
    """Bodies that a joint moves, with a mass that counts."""
    least = LIGHT * float(model.body_mass.sum())
    return [
        b for b in range(1, model.nbody) if model.body_weldid[b] != 0 and float(model.body_mass[b]) > least
    ]


def _length(model: Any, body: int) -> float:
    """About how long a body is [m]: its geoms, and how far its centre of mass is from its frame."""
    first, count = int(model.body_geomadr[body]), int(model.body_geomnum[body])
    sizes = [float(model.geom_rbound[g]) for g in range(first, first + count)] if count else []
    gyration = math.sqrt(float(model.body_inertia[body].max()) / float(model.body_mass[body]))
    return max([*sizes, float(np.linalg.norm(model.body_ipos[body])), gyration, SHORT])


def _parameters(model: Any, names: Names) -> tuple[dict[str, Parameter], dict[str, Knob]]:
    """What may be other than the model believes, and how to write it."""
    found: dict[str, Parameter] = {}
    knobs: dict[str, Knob] = {}

    def add(
        name: str,
        unit: str,
        value: float,
        low: float,
        high: float,
        text: str,
        knob: Knob,
        additive: float = 0.0,
    ) -> None:
        found[name] = Parameter(unit, value, low, high, text, additive)
        knobs[name] = knob

    size = float(np.linalg.norm(model.opt.gravity))
    if size > 0.0:
        add(
            "gravity",
            "m/s^2",
            size,
            0.0,
            HEAVIEST * size,
            "acceleration of gravity",
            scale_knob(("opt.gravity",), (), size),
        )
    for b in _moving(model):
        name, mass, length = names.bodies[b], float(model.body_mass[b]), _length(model, b)
        add(
            f"{name}.mass",
            "kg",
            mass,
            mass / HEAVIEST,
            HEAVIEST * mass,
            f"mass of {name}",
            place_knob("body_mass", b),
        )
        if int(model.body_simple[b]) == 0:  # else MuJoCo takes its part of the mass matrix for diagonal
            for axis, letter in enumerate("xyz"):
                at = float(model.body_ipos[b, axis])
                text = f"centre of mass of {name} along its {letter}"
                knob, far = place_knob("body_ipos", b, axis), LENGTHS * length
                add(f"{name}.com_{letter}", "m", at, at - far, at + far, text, knob, length)
        inertia = float(model.body_inertia[b].max())
        if inertia > 0.0 and not _points(model, b):
            text = f"largest moment of inertia of {name} about its centre of mass"
            add(
                f"{name}.inertia",
                "kg m^2",
                inertia,
                inertia / HEAVIEST,
                HEAVIEST * inertia,
                text,
                scale_knob(("body_inertia",), (b,), inertia),
            )
    for i, action in enumerate(names.action.names):
        stiff, damped = -float(model.actuator_biasprm[i, 1]), -float(model.actuator_biasprm[i, 2])
        if stiff > 0.0:
            add(
                f"{action}.kp",
                "1",
                stiff,
                stiff / HEAVIEST,
                HEAVIEST * stiff,
                f"position gain of {action}",
                gain_knob(i, 1, stiff, moves=True),
            )
        if damped > 0.0:
            add(
                f"{action}.kv",
                "1",
                damped,
                damped / HEAVIEST,
                HEAVIEST * damped,
                f"velocity gain of {action}",
                gain_knob(i, 2, damped, moves=stiff <= 0.0),
            )
        most = float(np.abs(model.actuator_forcerange[i]).max())
        if model.actuator_forcelimited[i] and most > 0.0:
            add(
                f"{action}.forcerange",
                "1",
                most,
                most / HEAVIEST,
                HEAVIEST * most,
                f"the most that {action} gives, in force or torque",
                scale_knob(("actuator_forcerange",), (i,), most),
            )
    return found, knobs


def _points(model: Any, body: int) -> bool:
    """Whether a body only slides along lines: how it resists turning does not show."""
    turns = [
        j
        for j in range(model.njnt)
        if int(model.jnt_type[j]) != mujoco().mjtJoint.mjJNT_SLIDE
        and _carries(model, int(model.jnt_bodyid[j]), body)
    ]
    return not turns


def _carries(model: Any, ancestor: int, body: int) -> bool:
    while body > 0:
        if body == ancestor:
            return True
        body = int(model.body_parentid[body])
    return False
