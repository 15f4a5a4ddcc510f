"""What truly moves where a robot floats or stands, and who keeps it up.

MuJoCo in fine steps, drag, wind and actuators by own lines. Where nothing touches by MuJoCo's Runge-Kutta scheme; on a
floor by the model's own scheme, which is what its contacts are made for. Drag, wind, gains, lags and delays are worked
out anew at every fine step, for its middle: a test holds that against Newton's and Euler's equations in an ODE solver.
Pilots go by the noisy readings and the model as it is believed, and are stirred so that what may be missing shows:
paths that wind, turns, steps of the legs. Nothing of `gpsim.mjcf` or `gpsim.effects` is used.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from gpsim.channels import FloatArray, IntArray
from gpsim.trials.bodies import mujoco
from gpsim.trials.robots.models import FREE, layout_of, spec_of
from gpsim.trials.robots.moving import apply_friction, changed_model, pieces
from gpsim.trials.truth import noise_of
from gpsim.trials.worlds import Run, TrueEffect, World

Pilot = Callable[[float, FloatArray], FloatArray]
"""pilot(t, reading (S,)) -> command (A,), before it is clipped; a negative t is before the recording."""
NOMINAL = {"hopper": np.array([-0.15, -0.55, 0.3]), "dog": np.tile([0.0, 0.75, -1.5], 4)}
"""Joints as they stand, in the order of the channels."""
LEAN = -0.4  # rad, of a hopper's torso, so that its weight is above the foot
HOVERS = np.array([0.0, 0.0, 1.0])  # m, where a quadrotor's path winds about
TAU = 2.0 * np.pi
STEPS = {"quadrotor": 5e-4, "boat": 1e-3, "hopper": 5e-4, "dog": 5e-4}  # s, of the truth
AXES = ("surge", "sway", "heave", "roll", "pitch", "yaw")  # along and about the body's own axes
WORLD_AXES = ("x", "y", "z", "roll", "pitch", "yaw")
HORIZON = {"quadrotor": 1.0, "boat": 4.0, "hopper": 0.4, "dog": 0.15}  # s of a piece that is replayed
MOST = 12  # such pieces
LOW, ASIDE, TILTED = 0.2, 6.0, 1.0  # m, m, rad: what is lower, farther or more tilted has fallen
SQUATS = 0.8  # m below which a hopper's hip has fallen
SETTLES = 0.5  # s that legs stand before they are recorded
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
            elif e.family == "viscous_friction":
                model.dof_damping[int(model.jnt_dofadr[layout.joints.index(e.on)])] += value
            elif e.family == "coulomb_friction":
                apply_friction(model, int(model.jnt_dofadr[layout.joints.index(e.on)]), value, self.h)
        self._forces = bool(np.any([self._linear, self._square, self._push]))
        believed = float(changed_model(robot, ()).body_mass.sum()) if robot == "quadrotor" else 0.0
        self.rest = np.full(model.nu, 9.81 * believed / model.nu)

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
        at = {name: i for i, name in enumerate(names)}
        pilot = PILOTS[world.system](spec_of(world.system).compile(), at, rng)
        data, acting, sent = begins(world, mover, rng), mover.rest, [mover.rest]
        for i in range(count + 1):
            k, state = i - settle, mover.state(data)
            if fell(world.system, state):
                break
            reading = state + noise[max(k, 0), e]
            if len(state) >= len(FREE):  # an orientation stays one
                reading[3:7] /= np.linalg.norm(reading[3:7])
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


def kept_afloat(truth: Run) -> FloatArray:
    """(E,) samples before each episode's fall."""
    return np.asarray(truth.free.sum(axis=0))


def shown_afloat(world: World, truth: Run, kept: FloatArray) -> list[float]:
    """Of every effect how far its absence moves the readings within the horizon: root mean square, in noise's.

    In the channel where that is most, of those that are recorded, and in the median piece: feet that slip or not part
    some without measure. What all actuators have alike is absent together.
    """
    layout, length = layout_of(world.system), round(HORIZON[world.system] / world.dt)
    picks = pieces(kept, length, MOST)
    if not len(picks):
        return [0.0] * len(world.effects)
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
    world: World, truth: Run, effects: Sequence[TrueEffect], picks: IntArray, length: int
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


def turned(quaternion: FloatArray) -> FloatArray:
    """(3, 3) the body's axes in the world; (4,) real part first."""
    w, x, y, z = quaternion / np.linalg.norm(quaternion)
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


def _quadrotor(model: Any, at: Mapping[str, int], rng: np.random.Generator) -> Pilot:
    """Tracks a Lissajous path on SO(3) (Lee, Leok and McClamroch 2010), its torques stirred."""
    amplitude = rng.uniform(0.6, 1.3, 3) * [1.0, 1.0, 0.4]
    rate, phase = rng.uniform(0.1, 0.35, 4), rng.uniform(0.0, TAU, 3)
    mass, inertia = float(model.body_mass[1]), np.array(model.body_inertia[1])
    gear, place = np.array(model.actuator_gear), np.array(model.site_pos)
    mixed = np.stack([gear[:, 2], gear[:, 2] * place[:, 1], -gear[:, 2] * place[:, 0], gear[:, 5]])
    pose = [at[f"base.{part}"] for part in ("x", "y", "z")]
    quaternion = [at[f"base.{part}"] for part in ("qw", "qx", "qy", "qz")]
    linear, angular = ([at[f"base.{kind}{a}"] for a in "xyz"] for kind in "vw")

    def command(t: float, s: FloatArray) -> FloatArray:
        path = HOVERS + amplitude * np.sin(TAU * rate[:3] * t + phase)
        wanted = 4.0 * (path - s[pose]) - 2.5 * s[linear] + [0.0, 0.0, 9.81]
        axes, yaw = turned(s[quaternion]), 0.8 * np.sin(TAU * rate[3] * t)
        up = wanted / np.linalg.norm(wanted)
        side = np.cross(up, [np.cos(yaw), np.sin(yaw), 0.0])
        side /= np.linalg.norm(side)
        goal = np.stack([np.cross(side, up), side, up], axis=1)
        off = 0.5 * (goal.T @ axes - axes.T @ goal)
        turn = -90.0 * np.array([off[2, 1], off[0, 2], off[1, 0]]) - 14.0 * s[angular]
        turn[:2] += 3.0 * rng.normal(size=2)
        return np.asarray(np.linalg.solve(mixed, [mass * wanted @ axes[:, 2], *inertia * turn]))

    return command


def _boat(model: Any, at: Mapping[str, int], rng: np.random.Generator) -> Pilot:
    """Keeps to a speed and a turn, each held for a second and a half to five."""
    quaternion = [at[f"base.{part}"] for part in ("qw", "qx", "qy", "qz")]
    linear, yaw = [at[f"base.v{a}"] for a in "xyz"], at["base.wz"]
    mass, inertia = float(model.body_mass[1]), float(model.body_inertia[1, 2])
    held = {"until": -1.0, "speed": 0.0, "turn": 0.0}

    def command(t: float, s: FloatArray) -> FloatArray:
        if t >= held["until"]:
            held["until"] = t + rng.uniform(1.5, 5.0)
            held["speed"], held["turn"] = rng.uniform(-0.2, 1.0), rng.uniform(-0.8, 0.8)
        ahead = float(turned(s[quaternion])[:, 0] @ s[linear])
        push, torque = mass * (held["speed"] - ahead), 1.5 * inertia * (held["turn"] - s[yaw])
        return np.array([0.5 * push - torque / 0.2, 0.5 * push + torque / 0.2])

    return command


def _hopper(model: Any, at: Mapping[str, int], rng: np.random.Generator) -> Pilot:
    """Squats and sways on its foot by torques that hold its joints."""
    joints = [at[f"{j}_joint"] for j in ("thigh", "leg", "foot")]
    rates = [i + 1 for i in joints]
    size, rate = rng.uniform(0.02, 0.12, 3), rng.uniform(0.4, 2.0, 3)
    phase, gear = rng.uniform(0.0, TAU, 3), np.array(model.actuator_gear)[:, 0]

    def command(t: float, s: FloatArray) -> FloatArray:
        wanted = NOMINAL["hopper"] + size * [1.0, 2.0, 1.0] * np.sin(TAU * rate * t + phase)
        torque = 600.0 * (wanted - s[joints]) - 50.0 * s[rates]
        return np.asarray(torque / gear)

    return command


def _dog(model: Any, at: Mapping[str, int], rng: np.random.Generator) -> Pilot:
    """Trots on the spot by torques towards winding references of its joints."""
    joints = [i for name, i in at.items() if f"{name}_dot" in at]
    rates = [i + 1 for i in joints]
    stride, lift = rng.uniform(1.2, 2.2), rng.uniform(0.08, 0.26)
    size, rate, phase = rng.uniform(0.02, 0.13, 12), rng.uniform(0.4, 1.5, 12), rng.uniform(0.0, TAU, 12)

    def command(t: float, s: FloatArray) -> FloatArray:
        begun = float(np.clip((t + SETTLES) / SETTLES, 0.0, 1.0))
        wanted = NOMINAL["dog"] + begun * size * np.sin(TAU * rate * t + phase)
        up = np.maximum(np.sin(TAU * stride * t + np.array([0.0, np.pi, np.pi, 0.0])), 0.0) * begun * lift
        wanted[1::3] += 1.2 * up
        wanted[2::3] -= 2.4 * up
        return np.asarray(60.0 * (wanted - s[joints]) - 1.2 * s[rates])

    return command


PILOTS: Mapping[str, Callable[[Any, Mapping[str, int], np.random.Generator], Pilot]] = {
    "quadrotor": _quadrotor,
    "boat": _boat,
    "hopper": _hopper,
    "dog": _dog,
}
