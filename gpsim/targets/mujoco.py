"""A MuJoCo model with physics that its file leaves out: it stands in for the robot where the simulator is that file."""

from __future__ import annotations

import copy
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from gpsim.channels import Channels, FloatArray
from gpsim.errors import UsageError
from gpsim.mjcf import MjcfSimulator, load_mjcf
from gpsim.simulators import Memory

HOLDS = (0.9999, 0.9999, 0.001, 0.5, 2.0)
"""solimp of dry friction that holds a joint still."""


@dataclass(frozen=True)
class ChangedModel:
    """`model` as it is in truth: more friction in joints, other masses, weaker and later motors.

    friction: joint -> N or N m; damping: joint -> N s/m or N m s; mass: body -> times what the model says; gain and
    delay: actuator -> times its command, and s. It is stepped `finer` times as finely as the model says, by the
    classical Runge-Kutta method, whatever the model says: a robot knows no step. Commands are held to the actuators'
    ranges.
    """

    model: str
    dt: float
    friction: Mapping[str, float] | None = None
    damping: Mapping[str, float] | None = None
    mass: Mapping[str, float] | None = None
    gain: Mapping[str, float] | None = None
    delay: Mapping[str, float] | None = None
    finer: int = 4

    def __post_init__(self) -> None:
        if not self.dt > 0.0:
            raise ValueError(f"dt must be positive, got {self.dt:g}")
        if self.finer < 1:
            raise ValueError(f"finer must be at least 1, got {self.finer}")
        for name in ("friction", "damping", "mass", "delay"):
            for where, value in self.changes(name).items():
                if not value >= 0.0:
                    raise ValueError(f"{name}.{where} must be at least 0, got {value:g}")

    def changes(self, kind: str) -> Mapping[str, float]:
        """What is other of one kind, by name: `friction`, say."""
        given: Mapping[str, float] | None = getattr(self, kind)
        return given or {}

    @property
    def state(self) -> Channels:
        """The model's."""
        return self._simulator.state

    @property
    def action(self) -> Channels:
        """The model's actuators."""
        return self._simulator.action

    @cached_property
    def substeps(self) -> int:
        """Steps of a control step."""
        return self.finer * self._simulator.steps_of(self.dt)

    def begin(self, count: int, rng: np.random.Generator) -> Memory:
        """Nothing was commanded before."""
        longest = max(self.changes("delay").values(), default=0.0)
        return {"commands": np.zeros((count, int(np.ceil(longest / self.dt)) + 1, len(self.action)))}

    def step(
        self, state: FloatArray, action: FloatArray, memory: Memory, rng: np.random.Generator
    ) -> FloatArray:
        """(B, S): the state after one control step."""
        from mujoco import rollout

        sent = memory["commands"]
        sent[:] = np.concatenate([action[:, None], sent[:, :-1]], axis=1)
        begun = np.zeros((len(state), self._size))  # time, then positions and velocities
        begun[:, 1:] = np.concatenate(self._simulator.layout.full(state), axis=1)
        ended, _ = rollout.rollout(
            self._model, self._data, initial_state=begun, control=self._arriving(sent), skip_checks=False
        )
        last, nq = ended[:, -1], int(self._model.nq)
        return self._simulator.layout.state(last[:, 1 : 1 + nq], last[:, 1 + nq :])

    def measure(self, state: FloatArray, memory: Memory, rng: np.random.Generator) -> FloatArray:
        """The state itself."""
        return state

    def _arriving(self, sent: FloatArray) -> FloatArray:
        """(B, K, A): the commands of the control step's K steps, of those sent (B, H, A), the newest first."""
        begins = self.dt * (np.arange(self.substeps) + 0.5) / self.substeps
        out = np.empty((len(sent), self.substeps, len(self.action)))
        for i, name in enumerate(self.action.names):
            ages = np.ceil((self.changes("delay").get(name, 0.0) - begins) / self.dt - 1e-9)
            out[:, :, i] = (
                self.changes("gain").get(name, 1.0) * sent[:, np.maximum(ages, 0).astype(np.int64), i]
            )
        return out

    @cached_property
    def _simulator(self) -> MjcfSimulator:
        return load_mjcf(self.model)

    @cached_property
    def _data(self) -> Any:
        import mujoco

        return mujoco.MjData(self._model)

    @cached_property
    def _size(self) -> int:
        import mujoco

        return int(mujoco.mj_stateSize(self._model, mujoco.mjtState.mjSTATE_FULLPHYSICS))

    @cached_property
    def _model(self) -> Any:
        """The changed model: its commands come clamped already, and a gain acts on what was clamped."""
        import mujoco

        body = self._simulator.body
        model = copy.copy(body.base)
        model.opt.timestep = self.dt / self.substeps
        model.opt.integrator = int(mujoco.mjtIntegrator.mjINT_RK4)
        model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_CLAMPCTRL)
        dofs = dict(zip((c.name for c in body.names.coordinates), body.names.dofs, strict=True))
        for joint, force in self.changes("friction").items():
            dof = _place(joint, dofs, "friction")
            model.dof_frictionloss[dof] += force
            model.dof_solref[dof], model.dof_solimp[dof] = (-1.0, -2.0 / model.opt.timestep), HOLDS
        for joint, damping in self.changes("damping").items():
            model.dof_damping[_place(joint, dofs, "damping")] += damping
        bodies = {name: i for i, name in enumerate(body.names.bodies)}
        for name, ratio in self.changes("mass").items():
            model.body_mass[_place(name, bodies, "mass")] *= ratio
            model.body_inertia[bodies[name]] *= ratio
        for kind in ("gain", "delay"):
            for name in self.changes(kind):
                _place(name, {n: i for i, n in enumerate(self.action.names)}, kind)
        mujoco.mj_setConst(model, mujoco.MjData(model))
        return model


def _place(name: str, places: Mapping[str, int], what: str) -> int:
    if name not in places:
        raise UsageError(f"target.{what}: the model has no {name}; it has: {', '.join(places)}")
    return places[name]
