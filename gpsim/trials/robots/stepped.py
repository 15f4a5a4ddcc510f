"""Whole robots as they truly move: MuJoCo's Runge-Kutta scheme of fourth order at an eighth of the model's step.

Every effect is a field of the model, so that a sample is one call; dry friction is as stiff as the step allows. It is a
code of its own beside `plant`, which works laws out at every stage; a test steps both side by side.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import ceil
from typing import Any

import numpy as np

from gpsim.channels import FloatArray
from gpsim.trials.robots.driving import drive, starts
from gpsim.trials.robots.models import layout_of, mujoco, spec_of
from gpsim.trials.robots.plant import HOLDING, changed_model
from gpsim.trials.robots.running import noise_of
from gpsim.trials.worlds import Run, TrueEffect, World

FINER, LONGEST = 8, 0.00025  # times than the model's step at least; s


def step_of(robot: str) -> float:
    """The truth's step [s]."""
    own = float(spec_of(robot).compile().opt.timestep)
    return own / (FINER * ceil(own / FINER / LONGEST))


class Stepped:
    """One robot with all of its effects, an episode each in data of its own. late: fine steps of its commands."""

    def __init__(self, robot: str, effects: Sequence[TrueEffect], h: float) -> None:
        self._mj, joints = mujoco(), layout_of(robot).joints
        self.model, self.h = changed_model(robot, effects), h
        self.model.opt.integrator = self._mj.mjtIntegrator.mjINT_RK4
        self.model.opt.timestep = h
        self._push = np.zeros(self.model.nv)
        for e in effects:
            j = joints.index(e.on) if e.on in joints else -1
            if e.family == "viscous_friction":
                self.model.dof_damping[j] += e.values["damping"]
            elif e.family == "coulomb_friction":
                self.model.dof_frictionloss[j] += e.values["force"]
                self.model.dof_solref[j] = (-1.0, -1.0 / h)
                self.model.dof_solimp[j] = HOLDING
            elif e.family == "constant_force":
                self._push[j] += e.values["force"]
        delays = {round(e.values["delay"] / h) for e in effects if e.family == "actuator_delay"}
        self.late = max(delays, default=0)  # all commands are as late
        self._data: list[Any] = []

    def begin(self, state: FloatArray) -> None:
        """Episodes begin at states (E, S); columns are joint, its velocity, the next joint."""
        self._data = [self._mj.MjData(self.model) for _ in state]
        for data, row in zip(self._data, state, strict=True):
            data.qpos[:], data.qvel[:], data.qfrc_applied[:] = row[0::2], row[1::2], self._push

    def sample(self, before: FloatArray, command: FloatArray, n: int) -> FloatArray:
        """(E, S) states n fine steps on: commands `before` (E, A) act until the newer ones arrive."""
        for data, old, new in zip(self._data, before, command, strict=True):
            first = min(self.late, n)
            for acting, count in ((old, first), (new, n - first)):
                if count:
                    data.ctrl[:] = acting
                    self._mj.mj_step(self.model, data, count)
        return self.states()

    def states(self) -> FloatArray:
        """(E, S) now."""
        out = np.empty((len(self._data), 2 * self.model.nv))
        for row, data in zip(out, self._data, strict=True):
            row[0::2], row[1::2] = data.qpos, data.qvel
        return out

    def free(self) -> FloatArray:
        """(E,) 1 where nothing touches and no joint is at its limit."""
        stop = int(self._mj.mjtConstraint.mjCNSTR_LIMIT_JOINT)
        return np.array([float(d.ncon == 0 and not np.any(d.efc_type == stop)) for d in self._data])


def run_whole(world: World, h: float | None = None) -> tuple[Run, FloatArray]:
    """Drive the world; and (K + 1, E) 1 where nothing touched up to then. A fine state is a sample's."""
    driving, state, noise = drive(world), starts(world), noise_of(world)
    plant = Stepped(world.system, world.effects, h or step_of(world.system))
    n = round(world.dt / plant.h)
    held = plant.late // n  # samples
    plant.late -= held * n
    plant.begin(state)
    fine = np.empty((world.steps + 1, *state.shape))
    fine[0], free = state, np.ones((world.steps + 1, world.episodes))
    commands = np.empty((world.steps, world.episodes, len(layout_of(world.system).action)))
    for k in range(world.steps):
        commands[k] = driving.command(k, fine[k] + noise[k])
        # Nothing else was commanded before the start.
        before, now = (commands[max(k - back, 0)] for back in (held + 1, held))
        fine[k + 1] = np.nan_to_num(np.clip(plant.sample(before, now, n), -1e3, 1e3))
        free[k + 1] = free[k] * plant.free()
    empty = np.empty((world.steps + 1, world.episodes, 0))
    clock = np.zeros(world.episodes)
    return Run(fine, world.dt, commands, fine, fine + noise, empty, clock, world.offsets), free
