"""Running a robot's world: of few effects by `plant`, of a whole robot by MuJoCo's own scheme; and what is recorded.

A whole robot truly moves by MuJoCo's Runge-Kutta scheme of fourth order at an eighth of the model's step. Every effect
is a field of the model, so that a sample is one call; dry friction is as stiff as the step allows. It is a code of its
own beside `plant`, which works laws out at every stage; a test steps both side by side.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import ceil
from typing import Any

import numpy as np

from gpsim.channels import Channels, FloatArray
from gpsim.recordings import Episode, Recording, evenly
from gpsim.trials.robots.driving import drive, starts
from gpsim.trials.robots.models import layout_of, robot_of, spec_of
from gpsim.trials.robots.plant import HOLDING, Plant, changed_model, touch_free
from gpsim.trials.truth import Frame, Replay, driven, mujoco, noise_of, picked
from gpsim.trials.worlds import Run, TrueEffect, World

SYSTEM = "mjcf"
FAR = 1e3  # where a state that runs away is held
HORIZON, MOST = 0.4, 24  # s; pieces of the run that are replayed
SHOWS = 4.0  # standard deviations of the noise
FINER, LONGEST = 8, 0.00025  # times than the model's step at least; s


def _frame_of(robot: str) -> Frame:
    layout = layout_of(robot)
    return Frame(layout.names, tuple(layout.action), lambda effects, h: Plant(robot, effects, h))


def run(world: World, effects: Sequence[TrueEffect]) -> Run:
    """Drive a world of few effects."""
    plant = Plant(world.system, effects)
    frame, state = _frame_of(world.system), starts(world)
    return driven(world, effects, frame, plant, drive(world), state, plant.h, FAR)


def recorded(world: World, readings: FloatArray, truth: Run, kept: FloatArray) -> Recording:
    """The readings (K + 1, E, S) of the first kept (E,) samples of every episode; velocities where they are read."""
    layout = layout_of(world.system)
    names = list(layout.names if world.velocities else layout.places)
    columns = [layout.names.index(n) for n in names]
    episodes = tuple(
        Episode(
            str(number),
            np.round(world.dt * np.arange(int(kept[e])), 9),
            readings[: int(kept[e]), e][:, columns].copy(),
            truth.commands[: int(kept[e]) - 1, e],
        )
        for number, e in enumerate(np.flatnonzero(kept))
    )
    return Recording(
        system=SYSTEM,
        state=Channels.of({n: layout.state[n] for n in names}),
        action=Channels.of(layout.action),
        episodes=episodes,
        dt=world.dt,
        velocities=world.velocities,
        noise={n: world.noise[n] for n in names} if world.noise_known else {},
        model=robot_of(world.system).file,
    )


def shown(world: World, truth: Run, kept: FloatArray) -> list[float]:
    """Of every effect how far its absence moves the readings within the horizon: root mean square, in noise's.

    In the channel where that is most, of those that are recorded. kept: (E,) samples of every episode.
    """
    length = max(round(HORIZON / world.dt), 10)
    rows = [(k, e) for e in np.flatnonzero(kept > length) for k in range(0, int(kept[e]) - length, length)]
    if not rows:
        return [0.0] * len(world.effects)
    picks, frame = np.array(rows)[evenly(len(rows), MOST)].T, _frame_of(world.system)
    noise = np.array([world.noise[name] for name in frame.names])
    out = []
    for absent in range(len(world.effects)):
        rest = tuple(e for i, e in enumerate(world.effects) if i != absent)
        # Whoever knows nothing of the effect takes what is read for where the robot is.
        said = Replay(world, truth, rest, frame).readings(picks, length)
        steps = zip(said, picked(truth.clean, picks, length), strict=True)
        squares = sum((np.mean((a - b) ** 2, axis=0) / length for a, b in steps), np.zeros(len(noise)))
        far = np.sqrt(np.nan_to_num(squares, nan=np.inf)) / noise
        out.append(float(np.max(far if world.velocities else far[0::2])))
    return out


def step_of(robot: str) -> float:
    """The step [s] of a whole robot's truth."""
    own = float(spec_of(robot).compile().opt.timestep)
    return own / (FINER * ceil(own / FINER / LONGEST))


class Stepped:
    """A whole robot with all of its effects, an episode each in data of its own. late: fine steps of its commands."""

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
        out, first = np.empty((len(self._data), 2 * self.model.nv)), min(self.late, n)
        for row, data, old, new in zip(out, self._data, before, command, strict=True):
            for acting, count in ((old, first), (new, n - first)):
                if count:
                    data.ctrl[:] = acting
                    self._mj.mj_step(self.model, data, count)
            row[0::2], row[1::2] = data.qpos, data.qvel
        return out

    def free(self) -> FloatArray:
        """(E,) 1 where nothing touches and no joint is at its limit."""
        return touch_free(self._data)


def run_whole(world: World, h: float | None = None) -> Run:
    """Drive a whole robot; a fine state is a sample's."""
    names = layout_of(world.system).names
    driving, state, noise = drive(world), starts(world), noise_of(world, names)
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
        fine[k + 1] = np.nan_to_num(np.clip(plant.sample(before, now, n), -FAR, FAR))
        free[k + 1] = free[k] * plant.free()
    empty, clock = np.empty((world.steps + 1, world.episodes, 0)), np.zeros(world.episodes)
    return Run(fine, world.dt, commands, fine, fine + noise, empty, clock, world.offsets, free)
