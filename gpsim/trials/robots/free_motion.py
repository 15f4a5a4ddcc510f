"""What truly moves where a robot floats or stands: MuJoCo in fine steps, drag, wind and actuators by own lines.

Where nothing touches by MuJoCo's Runge-Kutta scheme; on a floor by the model's own scheme, which is what its contacts
are made for. Drag, wind, gains, lags and delays are worked out anew at every fine step, for its middle: a test holds
that against Newton's and Euler's equations in an ODE solver. Nothing of `gpsim.mjcf` or `gpsim.effects` is used.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from gpsim.channels import FloatArray
from gpsim.recordings import evenly
from gpsim.trials.robots.models import FREE, layout_of
from gpsim.trials.robots.pilots import LEAN, NOMINAL, SETTLES, pilot_of, turned
from gpsim.trials.robots.plant import HOLDING, changed_model
from gpsim.trials.truth import mujoco, noise_of
from gpsim.trials.worlds import Run, TrueEffect, World

STEPS = {"quadrotor": 5e-4, "boat": 1e-3, "hopper": 5e-4, "dog": 5e-4}  # s, of the truth
AXES = ("surge", "sway", "heave", "roll", "pitch", "yaw")  # along and about the body's own axes
WORLD_AXES = ("x", "y", "z", "roll", "pitch", "yaw")
HORIZON = {"quadrotor": 1.0, "boat": 4.0, "hopper": 0.4, "dog": 0.15}  # s of a piece that is replayed
MOST = 12  # such pieces
LOW, ASIDE, TILTED = 0.2, 6.0, 1.0  # m, m, rad: what is lower, farther or more tilted has fallen
SQUATS = 0.8  # m below which a hopper's hip has fallen
TOGETHER = ("actuator_lag", "actuator_delay")  # all actuators have them alike


class Mover:
    """One robot with some effects; steps data of its own. rest: (A,) what its actuators give before any command."""

    def __init__(self, robot: str, effects: Sequence[TrueEffect], h: float | None = None) -> None:
        self._mj, layout = mujoco(), layout_of(robot)
        self.model, self.h = changed_model(robot, effects), h or STEPS[robot]
        model, actions = self.model, list(layout.action)
        model.opt.timestep = self.h
        self._free = int(model.jnt_type[0]) == self._mj.mjtJoint.mjJNT_FREE
        if not layout.driven:  # rotors and thrusters: nothing touches
            model.opt.integrator = self._mj.mjtIntegrator.mjINT_RK4
        self._linear, self._square, self._push = np.zeros(6), np.zeros(6), np.zeros(6)
        self._gain, self._lag, self.late = np.ones(model.nu), np.zeros(model.nu), 0
        for e in effects:
            (value, *_), axis = e.values.values(), e.on.removeprefix("base.")
            if e.family in ("viscous_friction", "quadratic_drag") and axis in AXES:
                into = self._linear if e.family == "viscous_friction" else self._square
                into[AXES.index(axis)] += value
            elif e.family == "constant_force":
                self._push[WORLD_AXES.index(axis)] += value
            elif e.family == "actuator_gain":
                self._gain[actions.index(e.on)] *= value
            elif e.family == "actuator_lag":
                self._lag[actions.index(e.on)] = value
            elif e.family == "actuator_delay":
                self.late = round(value / self.h)
            elif e.family in ("viscous_friction", "coulomb_friction"):
                self._rub(e.family, int(model.jnt_dofadr[layout.joints.index(e.on)]), value)
        self._forces = bool(np.any([self._linear, self._square, self._push]))
        believed = float(changed_model(robot, ()).body_mass.sum()) if robot == "quadrotor" else 0.0
        self.rest = np.full(model.nu, 9.81 * believed / model.nu)

    def _rub(self, family: str, dof: int, value: float) -> None:
        if family == "viscous_friction":
            self.model.dof_damping[dof] += value
            return
        self.model.dof_frictionloss[dof] += value
        self.model.dof_solref[dof], self.model.dof_solimp[dof] = (-1.0, -1.0 / self.h), HOLDING

    def data(self, q: FloatArray, v: FloatArray) -> Any:
        """MuJoCo's data at positions (nq,) and velocities (nv,)."""
        data = self._mj.MjData(self.model)
        data.qpos[:], data.qvel[:] = q, v
        return data

    def sample(self, data: Any, given: FloatArray, commands: FloatArray, n: int) -> FloatArray:
        """(A,) what the actuators give n fine steps on.

        given: (A,) what they give now; commands: (B, A), of this sample and, before it, as many as are still on their
        way.
        """
        lag = np.maximum(self._lag, 1e-12)
        keeps = np.exp(-self.h / lag)
        mean = (1.0 - keeps) * lag / self.h  # of what is kept, over a step
        for i in range(n):
            arrives = commands[max(len(commands) - 1 + (i - self.late) // n, 0)]
            data.ctrl[:] = self._gain * (arrives + mean * (given - arrives))
            given = arrives + keeps * (given - arrives)
            if self._forces:
                self._carried(data)
            self._mj.mj_step(self.model, data)
        return given

    def _carried(self, data: Any) -> None:
        axes, middle = turned(data.qpos[3:7]), data.qvel + 0.5 * self.h * data.qacc
        twist = np.concatenate([axes.T @ middle[:3], middle[3:6]])
        drag = -(self._linear + self._square * np.abs(twist)) * twist
        data.qfrc_applied[:3] = axes @ drag[:3] + self._push[:3]
        data.qfrc_applied[3:6] = drag[3:] + self._push[3:]

    def state(self, data: Any) -> FloatArray:
        """(S,) the channels: of a free joint pose and twist, then each joint and its velocity."""
        free = len(FREE) * self._free
        q, v = (data.qpos[7:], data.qvel[6:]) if self._free else (data.qpos, data.qvel)
        head = [data.qpos[:7], data.qvel[:6]] if self._free else []
        out = np.concatenate([*head, np.empty(2 * len(q))])
        out[free::2], out[free + 1 :: 2] = q, v
        return out

    def places(self, state: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Positions (nq,) and velocities (nv,) of channels (S,)."""
        free = len(FREE) * self._free
        head = (state[:7], state[7:13]) if self._free else (state[:0], state[:0])
        q, v = np.concatenate([head[0], state[free::2]]), np.concatenate([head[1], state[free + 1 :: 2]])
        return q, v


def fell(robot: str, state: FloatArray) -> bool:
    """Whether somebody would stop the recording here."""
    if robot == "hopper":
        return not (state[2] > SQUATS and abs(state[4] - LEAN) < TILTED)
    if robot == "boat":
        return not np.isfinite(state).all()
    upright = turned(state[3:7])[2, 2] > np.cos(TILTED)
    return not (state[2] > LOW and upright and np.abs(state[:3]).max() < ASIDE)


def begins(world: World, mover: Mover, rng: np.random.Generator) -> Any:
    """MuJoCo's data where an episode begins, or where legs begin to stand."""
    q, v = np.array(mover.model.qpos0), np.zeros(mover.model.nv)
    if world.system == "hopper":
        q[1:] = 1.22, LEAN, *NOMINAL["hopper"]
    elif world.system == "dog":
        q[2], q[7:] = 0.325, NOMINAL["dog"]
    else:
        yaw = rng.uniform(-0.5, 0.5)
        q[:2], q[3], q[6] = rng.uniform(-0.5, 0.5, 2), np.cos(yaw / 2), np.sin(yaw / 2)
    return mover.data(q, v)


def run_afloat(world: World) -> Run:
    """Drive a world; hidden is what its actuators give, free is 0 from where it has fallen.

    Commands before the recording are those of legs that come to stand; of others the first.
    """
    names, mover = layout_of(world.system).names, Mover(world.system, world.effects)
    n = round(world.dt / mover.h)
    settle = round(SETTLES / world.dt) if layout_of(world.system).driven else 0
    low, high = np.array(mover.model.actuator_ctrlrange, dtype=np.float64).T
    noise, count = noise_of(world, names), settle + world.steps
    states = np.zeros((world.steps + 1, world.episodes, len(names)))
    measured, free = states.copy(), np.zeros(states.shape[:2])
    commands = np.zeros((world.steps, world.episodes, mover.model.nu))
    given = np.zeros((world.steps + 1, world.episodes, mover.model.nu))
    for e in range(world.episodes):
        rng = np.random.default_rng([world.seed, world.number, world.attempt, 1, e])
        pilot, data, acting, sent = pilot_of(world, rng), begins(world, mover, rng), mover.rest, [mover.rest]
        for i in range(count + 1):
            k, state = i - settle, mover.state(data)
            if fell(world.system, state):
                break
            reading = _read(state, noise[max(k, 0), e])
            if k >= 0:
                states[k, e], measured[k, e], given[k, e], free[k, e] = state, reading, acting, 1.0
            if k == world.steps:
                break
            sent.append(np.clip(pilot(k * world.dt, reading), low, high))
            if k >= 0:
                commands[k, e] = sent[-1]
            acting = mover.sample(data, acting, np.array(sent[-2 - mover.late // n :]), n)
    clock = np.zeros(world.episodes)
    return Run(states, world.dt, commands, states, measured, given, clock, world.offsets, free)


def _read(state: FloatArray, noise: FloatArray) -> FloatArray:
    """(S,) with noise; an orientation stays one."""
    out = state + noise
    if len(state) >= len(FREE):
        out[3:7] /= np.linalg.norm(out[3:7])
    return out


def kept_afloat(truth: Run) -> FloatArray:
    """(E,) samples before each episode's fall."""
    return np.asarray(truth.free.sum(axis=0))


def shown_afloat(world: World, truth: Run, kept: FloatArray) -> list[float]:
    """Of every effect how far its absence moves the readings within the horizon: root mean square, in noise's.

    In the channel where that is most, of those that are recorded, and in the median piece: feet that slip or not part
    some without measure. What all actuators have alike is absent together.
    """
    layout, length = layout_of(world.system), round(HORIZON[world.system] / world.dt)
    rows = [(k, e) for e in np.flatnonzero(kept > length) for k in range(0, int(kept[e]) - length, length)]
    if not rows:
        return [0.0] * len(world.effects)
    picks = np.array(rows)[evenly(len(rows), MOST)]
    seen = [layout.names.index(n) for n in (layout.names if world.velocities else layout.places)]
    noise = np.array([world.noise[n] for n in layout.names])[seen]
    own = _replayed(world, truth, world.effects, picks, length)
    out: dict[str, float] = {}
    for key in {_key(e) for e in world.effects}:
        rest = [e for e in world.effects if _key(e) != key]
        off = _replayed(world, truth, rest, picks, length) - own
        far = np.sqrt(np.mean(off[:, :, seen] ** 2, axis=1)) / noise
        out[key] = float(np.max(np.median(np.nan_to_num(far, nan=np.inf), axis=0)))
    return [out[_key(e)] for e in world.effects]


def _key(effect: TrueEffect) -> str:
    return effect.family if effect.family in TOGETHER else effect.name


def _replayed(
    world: World, truth: Run, effects: Sequence[TrueEffect], picks: FloatArray, length: int
) -> FloatArray:
    """(P, L, S) the states after samples (k, e), by these effects, under the commands that were given."""
    mover = Mover(world.system, effects)
    n = round(world.dt / mover.h)
    back = 1 + mover.late // n
    out = np.empty((len(picks), length, truth.clean.shape[2]))
    for row, (k, e) in zip(out, picks, strict=True):
        data, acting = mover.data(*mover.places(truth.clean[k, e])), truth.hidden[k, e]
        for j in range(length):
            acting = mover.sample(data, acting, truth.commands[max(k + j - back, 0) : k + j + 1, e], n)
            row[j] = mover.state(data)
    return out
