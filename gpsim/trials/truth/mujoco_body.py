"""The truth by MuJoCo: the same bodies as small MJCF models, with joint friction, damping and springs of MuJoCo's own.

An independent second source of truth: equations, friction (`frictionloss`, a constraint) and integration are its own.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from gpsim.channels import FloatArray
from gpsim.errors import UsageError
from gpsim.trials.worlds import SYSTEMS, TrueEffect

NATIVE = ("coulomb_friction", "viscous_friction", "spring", "constant_force", "parameter_offset")
"""Families of the body that MuJoCo has itself; those of actuators and sensors act outside of it."""
FRICTION = 'solreffriction="-1 -{stop}" solimpfriction="0.9999 0.9999 0.001 0.5 2"'
"""A body that friction can hold stops within a step: the constraint takes its speed away at the rate 2 / h."""
MODEL = """
<mujoco>
  <compiler angle="radian" inertiafromgeom="false" autolimits="true"/>
  <option timestep="{h}" integrator="RK4" gravity="0 0 -{gravity}" iterations="200" tolerance="1e-14">
    <flag contact="disable"/>
  </option>
  <worldbody>{bodies}</worldbody>
  <actuator><motor joint="{first}" gear="1"/></actuator>
</mujoco>
"""
CART = """
<body><inertial pos="0 0 0" mass="{cart_mass}" diaginertia="1 1 1"/>
  <joint name="x" type="slide" axis="1 0 0" {x}/>
  <body><inertial pos="0 0 {pole_half_length}" mass="{pole_mass}" diaginertia="{rod} {rod} {thin}"/>
    <joint name="theta" type="hinge" axis="0 1 0" {theta}/></body></body>
"""
SLIDER = """
<body><inertial pos="0 0 0" mass="{mass}" diaginertia="1 1 1"/><joint name="q" type="slide" axis="1 0 0" {q}/></body>
"""
PENDULUM = """
<body><inertial pos="0 0 -{length}" mass="{mass}" diaginertia="1e-10 1e-10 1e-10"/>
  <joint name="theta" type="hinge" axis="0 1 0" {theta}/></body>
"""
BODIES = {"cartpole": CART, "slider": SLIDER, "pendulum": PENDULUM}


def native(effect: TrueEffect) -> bool:
    """Whether MuJoCo can play this effect of a body by itself."""
    return effect.family in NATIVE and not effect.gated and "coefficient" not in effect.values


class MujocoBody:
    """Steps a batch of a mechanical system, one MuJoCo world an episode; the same calls as `body.Body`."""

    def __init__(
        self, system: str, parameters: Mapping[str, float], effects: Sequence[TrueEffect], h: float
    ) -> None:
        mujoco = _mujoco()
        p, joints = dict(parameters), dict.fromkeys(SYSTEMS[system].coordinates, "")
        self._push = np.zeros(len(joints))
        for effect in effects:
            k = effect.values
            if effect.family == "parameter_offset":
                p[effect.on] *= k["ratio"]
            elif effect.family == "coulomb_friction":
                joints[effect.on] += f' frictionloss="{k["force"]!r}" {FRICTION.format(stop=2.0 / h)}'
            elif effect.family == "viscous_friction":
                joints[effect.on] += f' damping="{k["damping"]!r}"'
            elif effect.family == "spring":
                joints[effect.on] += f' stiffness="{k["stiffness"]!r}" springref="{k["rest_position"]!r}"'
            elif effect.family == "constant_force":
                self._push[list(joints).index(effect.on)] += k["force"]
        if system == "cartpole":
            rod = p["pole_mass"] * (2 * p["pole_half_length"]) ** 2 / 12
            p |= {"rod": rod, "thin": rod / 1e3}
        bodies = BODIES[system].format(**p, **joints)
        text = MODEL.format(h=h, gravity=p.get("gravity", 9.81), bodies=bodies, first=next(iter(joints)))
        self._step = mujoco.mj_step
        self._model = mujoco.MjModel.from_xml_string(text)
        self._make: Any = mujoco.MjData
        self._data: list[Any] = []

    def begin(self, s: FloatArray) -> FloatArray:
        """Worlds at the given states; nothing is hidden."""
        self._data = [self._make(self._model) for _ in s]
        for data, row in zip(self._data, s, strict=True):
            data.qpos[:], data.qvel[:] = row[0::2], row[1::2]
            data.qfrc_applied[:] = self._push
        return np.empty((len(s), 0))

    def step(
        self, s: FloatArray, z: FloatArray, u: FloatArray, t: FloatArray, wall: FloatArray, h: float
    ) -> tuple[FloatArray, FloatArray]:
        """State after h s; the worlds remember theirs, `s` is what this returned last."""
        out = np.empty_like(s)
        for i, data in enumerate(self._data):
            data.ctrl[0] = u[i, 0]
            self._step(self._model, data)
            out[i, 0::2], out[i, 1::2] = data.qpos, data.qvel
        return out, z


def _mujoco() -> Any:
    try:
        import mujoco
    except ImportError as error:
        raise UsageError(
            "a concealed world needs MuJoCo; install it with: pip install 'gpsim[prove]'"
        ) from error
    return mujoco
