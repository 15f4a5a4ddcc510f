"""What truly moves: a robot's model with its effects, by MuJoCo's accelerations and a scheme that is not MuJoCo's own.

Kutta's method of third order (1901), at a quarter of the model's step or less. Laws of position and velocity are
forces that are worked out anew at every stage; dry friction is MuJoCo's, as stiff as the step allows; masses are fields
of the model or bodies welded to it. Nothing of `gpsim.mjcf` is used.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from math import ceil
from typing import Any

import numpy as np

from gpsim.channels import FloatArray
from gpsim.trials import catalogue
from gpsim.trials.robots.models import layout_of, spec_of
from gpsim.trials.truth import Moving, mujoco
from gpsim.trials.worlds import TrueEffect, Values

QUARTER, LONGEST = 4, 0.002
"""Fine steps in one of the model's at least, and how long [s] they are at most."""
FRICTION = 4
"""As many times finer with dry friction, which meets a stop at the ends of steps only."""
TINY = 1e-9  # kg m^2 of a payload that is a point
HOLDING = (0.9999, 0.9999, 0.001, 0.5, 2.0)  # solimp of friction that does not creep


def touch_free(data: Sequence[Any]) -> FloatArray:
    """(E,) 1 where nothing touches and no joint is at its limit, as seen in the last step of each of MuJoCo's data."""
    stop = int(mujoco().mjtConstraint.mjCNSTR_LIMIT_JOINT)
    return np.array([float(d.ncon == 0 and not np.any(d.efc_type == stop)) for d in data])


class Plant(Moving):
    """One robot with some effects; steps any number of episodes, each with MuJoCo's data of its own. h: s, its step."""

    def __init__(self, robot: str, effects: Sequence[TrueEffect], h: float | None = None) -> None:
        self._mj, layout = mujoco(), layout_of(robot)
        self.model = changed_model(robot, effects)
        self._smooth, self._grips = (
            [(layout.joints.index(e.on), laws[e.family], e.values) for e in effects if e.family in laws]
            for laws in (catalogue.SMOOTH, catalogue.GRIP)
        )
        own = float(self.model.opt.timestep)
        self.h = h or own / (QUARTER * ceil(own / QUARTER / LONGEST) * (FRICTION if self._grips else 1))
        for j in {j for j, _, _ in self._grips}:
            self.model.dof_solref[j] = (-1.0, -1.0 / self.h)
            self.model.dof_solimp[j] = HOLDING
        self._own_grip = np.array(self.model.dof_frictionloss)
        actions = tuple(layout.action)
        self._zeros = [
            (i, e.values["offset"])
            for e in effects
            if e.family == "joint_offset"
            for i, action in enumerate(actions)
            if action in layout.servos and layout.driven[action] == e.on
        ]
        self._data: list[Any] = []

    def begin(self, s: FloatArray) -> FloatArray:
        """Forget what was; an episode a state begins."""
        self._data = [self._mj.MjData(self.model) for _ in s]
        return np.empty((len(s), 0))

    def step(
        self, s: FloatArray, z: FloatArray, u: FloatArray, t: FloatArray, wall: FloatArray, h: float
    ) -> tuple[FloatArray, FloatArray]:
        """Its step is its own, whatever h says."""
        return self.after(s, u), z

    def after(self, state: FloatArray, acting: FloatArray) -> FloatArray:
        """(E, S) states after a fine step with acting (E, A); columns are joint, its velocity, the next joint."""
        out = np.empty_like(state)
        for i, data in enumerate(self._data):
            out[i, 0::2], out[i, 1::2] = self._moved(data, state[i, 0::2], state[i, 1::2], acting[i])
        return out

    def free(self) -> FloatArray:
        """(E,) 1 where nothing touches and no joint is at its limit, as seen in the last step."""
        return touch_free(self._data)

    def acceleration(self, data: Any, q: FloatArray, v: FloatArray, u: FloatArray) -> FloatArray:
        """(C,) joint accelerations at positions q and velocities v (C,), u (A,) acting."""
        data.qpos[:], data.qvel[:], data.ctrl[:] = q, v, u
        for i, offset in self._zeros:  # the servo goes by an encoder that says more than there is
            data.ctrl[i] -= offset
        if self._smooth:
            data.qfrc_applied[:] = 0.0
            for j, law, values in self._smooth:
                data.qfrc_applied[j] += _at(law, values, q[j : j + 1], v[j : j + 1])
        if self._grips:
            self.model.dof_frictionloss[:] = self._own_grip
            for j, grip, values in self._grips:
                self.model.dof_frictionloss[j] += _at(grip, values, v[j : j + 1], v[j : j + 1])
        self._mj.mj_forward(self.model, data)
        return np.array(data.qacc)

    def _moved(self, data: Any, q: FloatArray, v: FloatArray, u: FloatArray) -> tuple[FloatArray, FloatArray]:
        h = self.h
        a1 = self.acceleration(data, q, v, u)
        v2 = v + h / 2 * a1
        a2 = self.acceleration(data, q + h / 2 * v, v2, u)
        v3 = v + h * (2 * a2 - a1)
        a3 = self.acceleration(data, q + h * (2 * v2 - v), v3, u)
        return q + h / 6 * (v + 4 * v2 + v3), v + h / 6 * (a1 + 4 * a2 + a3)


def _at(
    law: Callable[[Values, FloatArray, FloatArray], FloatArray], values: Values, q: FloatArray, v: FloatArray
) -> float:
    return float(law(values, q, v)[0])


def changed_model(robot: str, effects: Sequence[TrueEffect]) -> Any:
    """The compiled model with every effect in it that is one of its bodies, its gravity or its servos."""
    mj, spec, layout = mujoco(), spec_of(robot), layout_of(robot)
    off, flags = mj.mjtDisableBit, int(spec.option.disableflags)
    if flags & int(off.mjDSBL_CONSTRAINT):  # nothing touches in it, but a real joint may rub all the same
        others = int(off.mjDSBL_EQUALITY) | int(off.mjDSBL_LIMIT) | int(off.mjDSBL_CONTACT)
        spec.option.disableflags = flags & ~int(off.mjDSBL_CONSTRAINT) | others
    for e in (e for e in effects if e.family == "payload"):
        load = spec.body(e.on).add_body(pos=[e.values[axis] for axis in "xyz"])
        load.explicitinertial, load.mass, load.inertia = True, e.values["mass"], [TINY] * 3
        load.ipos = [0.0, 0.0, 0.0]
    model = spec.compile()
    # Commands stay within their ranges; what an actuator makes of them need not.
    model.opt.disableflags |= int(mj.mjtDisableBit.mjDSBL_CLAMPCTRL)
    for e in effects:
        if e.family == "armature":
            model.dof_armature[model.jnt_dofadr[layout.joints.index(e.on)]] += e.values["inertia"]
        elif e.family == "gravity_tilt":
            model.opt.gravity[:] = tilted(np.array(model.opt.gravity), e.values["roll"], e.values["pitch"])
        elif e.family == "parameter_offset":
            _retune(model, layout.action, e.on, e.values)
    mj.mj_setConst(model, mj.MjData(model))
    return model


def _retune(model: Any, actions: Any, on: str, values: Values) -> None:
    """A parameter as gpsim names it, other than is believed: of a body, a servo, or gravity."""
    owner, _, what = on.rpartition(".")
    ratio = values.get("ratio", 1.0)
    if what == "gravity":
        model.opt.gravity[:] *= ratio
    elif what == "mass":
        model.body_mass[model.body(owner).id] *= ratio
    elif what == "inertia":
        model.body_inertia[model.body(owner).id] *= ratio
    elif what == "friction":  # of what stands on it, too, of which the rougher one decides
        model.geom_friction[:, 0] *= ratio
    elif what.startswith("com_"):
        model.body_ipos[model.body(owner).id, "xyz".index(what[-1])] += values["offset"]
    else:
        i = list(actions).index(owner)
        if what == "kp":  # the command and the joint's place are weighed alike
            model.actuator_gainprm[i, 0] *= ratio
        model.actuator_biasprm[i, {"kp": 1, "kv": 2}[what]] *= ratio


def tilted(gravity: FloatArray, roll: float, pitch: float) -> FloatArray:
    """(3,) gravity as a base sees it that was turned by roll about its x, then by pitch about its y."""
    about_x = np.array([[1, 0, 0], [0, np.cos(roll), -np.sin(roll)], [0, np.sin(roll), np.cos(roll)]])
    about_y = np.array([[np.cos(pitch), 0, np.sin(pitch)], [0, 1, 0], [-np.sin(pitch), 0, np.cos(pitch)]])
    return np.asarray((about_y @ about_x).T @ gravity)
