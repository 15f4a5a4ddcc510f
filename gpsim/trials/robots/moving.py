"""What truly moves where a simulator is a MuJoCo model, the run of a world, what is recorded, and how much of it shows.

Worlds of few effects (`Plant`): Kutta's method of third order (1901), which is not MuJoCo's own, at a quarter of the
model's step or less. Laws of position and velocity are forces that are worked out anew at every stage; dry friction is
MuJoCo's, as stiff as the step allows; masses are fields of the model or bodies welded to it.

A whole robot (`Stepped`) truly moves by MuJoCo's Runge-Kutta scheme of fourth order at an eighth of the model's step.
Every effect is a field of the model, so that a sample is one call. It is a code of its own beside `Plant`; a test steps
both side by side. Nothing of `gpsim.mjcf` is used.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import ceil
from typing import Any

import numpy as np

from gpsim.channels import Channels, FloatArray, IntArray
from gpsim.recordings import Episode, Recording, evenly
from gpsim.trials import catalogue
from gpsim.trials.bodies import Moving, Now, mujoco
from gpsim.trials.robots.models import layout_of, robot_of, spec_of
from gpsim.trials.truth import Frame, Replay, picked
from gpsim.trials.worlds import Run, TrueEffect, Values, World

QUARTER, LONGEST = 4, 0.002
"""Fine steps in one of the model's at least, and how long [s] they are at most."""
FRICTION = 4
"""As many times finer with dry friction, which meets a stop at the ends of steps only."""
FINER, LONGEST_FINER = 8, 0.00025  # the same of whole robots
TINY = 1e-9  # kg m^2 of a payload that is a point
HOLDING = (0.9999, 0.9999, 0.001, 0.5, 2.0)  # solimp of friction that does not creep
FAR = 1e3  # where a state that runs away is held
HORIZON, MOST = 0.4, 24  # s; pieces of the run that are replayed
SHOWS = 4.0  # standard deviations of the noise


def touch_free(data: Sequence[Any]) -> FloatArray:
    """(E,) 1 where nothing touches and no joint is at its limit, as seen in the last step of each of MuJoCo's data."""
    stop = int(mujoco().mjtConstraint.mjCNSTR_LIMIT_JOINT)
    return np.array([float(d.ncon == 0 and not np.any(d.efc_type == stop)) for d in data])


def apply_friction(model: Any, dof: int, force: float, h: float) -> None:
    """Dry friction of MuJoCo's own on a degree of freedom, as stiff as a step of h s allows."""
    model.dof_frictionloss[dof] += force
    model.dof_solref[dof], model.dof_solimp[dof] = (-1.0, -1.0 / h), HOLDING


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
        for j, _, _ in self._grips:
            apply_friction(self.model, j, 0.0, self.h)
        self._own_grip = np.array(self.model.dof_frictionloss)
        moved = {layout.driven[a]: i for i, a in enumerate(layout.action) if a in layout.servos}
        zeros = [e for e in effects if e.family == "joint_offset" and e.on in moved]
        self._zeros = [(moved[e.on], e.values["offset"]) for e in zeros]
        self._data: list[Any] = []

    def begin(self, s: FloatArray) -> FloatArray:
        """Forget what was; an episode a state begins."""
        self._data = [self._mj.MjData(self.model) for _ in s]
        return np.empty((len(s), 0))

    def step(self, s: FloatArray, z: FloatArray, now: Now, h: float) -> tuple[FloatArray, FloatArray]:
        """Its step is its own, whatever h says."""
        return self.after(s, now.u), z

    def after(self, state: FloatArray, acting: FloatArray) -> FloatArray:
        """(E, S) states after a fine step with acting (E, A); columns are joint, its velocity, the next joint."""
        out, h = np.empty_like(state), self.h
        for row, data, was, u in zip(out, self._data, state, acting, strict=True):
            q, v = was[0::2], was[1::2]
            a1 = self.acceleration(data, q, v, u)
            v2 = v + h / 2 * a1
            a2 = self.acceleration(data, q + h / 2 * v, v2, u)
            v3 = v + h * (2 * a2 - a1)
            a3 = self.acceleration(data, q + h * (2 * v2 - v), v3, u)
            row[0::2], row[1::2] = q + h / 6 * (v + 4 * v2 + v3), v + h / 6 * (a1 + 4 * a2 + a3)
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
                data.qfrc_applied[j] += float(law(values, q[j : j + 1], v[j : j + 1])[0])
        if self._grips:
            self.model.dof_frictionloss[:] = self._own_grip
            for j, grip, values in self._grips:
                self.model.dof_frictionloss[j] += float(grip(values, v[j : j + 1], v[j : j + 1])[0])
        self._mj.mj_forward(self.model, data)
        return np.array(data.qacc)


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
            _retune(model, list(layout.action), e.on, e.values)
    mj.mj_setConst(model, mj.MjData(model))
    return model


def _retune(model: Any, actions: list[str], on: str, values: Values) -> None:
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
        i = actions.index(owner)
        if what == "kp":  # the command and the joint's place are weighed alike
            model.actuator_gainprm[i, 0] *= ratio
        model.actuator_biasprm[i, {"kp": 1, "kv": 2}[what]] *= ratio


def tilted(gravity: FloatArray, roll: float, pitch: float) -> FloatArray:
    """(3,) gravity as a base sees it that was turned by roll about its x, then by pitch about its y."""
    about_x = np.array([[1, 0, 0], [0, np.cos(roll), -np.sin(roll)], [0, np.sin(roll), np.cos(roll)]])
    about_y = np.array([[np.cos(pitch), 0, np.sin(pitch)], [0, 1, 0], [-np.sin(pitch), 0, np.cos(pitch)]])
    return np.asarray((about_y @ about_x).T @ gravity)


def frame_of(robot: str) -> Frame:
    """What a robot's world of few effects is made of."""
    layout = layout_of(robot)
    return Frame(layout.names, tuple(layout.action), lambda effects, h: Plant(robot, effects, h), FAR)


def recorded(world: World, readings: FloatArray, truth: Run, kept: FloatArray) -> Recording:
    """The readings (K + 1, E, S) of the first kept (E,) samples of every episode; velocities where they are read."""
    layout = layout_of(world.system)
    names = list(layout.names if world.velocities else layout.places)
    columns = [layout.names.index(n) for n in names]
    episodes: list[Episode] = []
    for e in np.flatnonzero(kept):
        count = int(kept[e])
        t = np.round(world.dt * np.arange(count), 9)
        states, actions = readings[:count, e][:, columns].copy(), truth.commands[: count - 1, e]
        episodes.append(Episode(str(len(episodes)), t, states, actions))
    return Recording(
        system="mjcf",
        state=Channels.of({n: layout.state[n] for n in names}),
        action=Channels.of(layout.action),
        episodes=tuple(episodes),
        dt=world.dt,
        velocities=world.velocities,
        noise={n: world.noise[n] for n in names} if world.noise_known else {},
        model=robot_of(world.system).file,
    )


def pieces(kept: FloatArray, length: int, most: int) -> IntArray:
    """(P, 2) sample and episode at which pieces of `length` transitions begin, evenly spread; none: no rows."""
    rows = [(k, e) for e in np.flatnonzero(kept > length) for k in range(0, int(kept[e]) - length, length)]
    return np.array(rows)[evenly(len(rows), most)] if rows else np.empty((0, 2), dtype=np.int64)


def shown(world: World, truth: Run, kept: FloatArray) -> list[float]:
    """Of every effect how far its absence moves the readings within the horizon: root mean square, in noise's.

    In the channel where that is most, of those that are recorded. kept: (E,) samples of every episode.
    """
    length = max(round(HORIZON / world.dt), 10)
    picks, frame = pieces(kept, length, MOST).T, frame_of(world.system)
    if not picks.size:
        return [0.0] * len(world.effects)
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
    return own / (FINER * ceil(own / FINER / LONGEST_FINER))


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
                apply_friction(self.model, j, e.values["force"], h)
            elif e.family == "constant_force":
                self._push[j] += e.values["force"]
        delays = {round(e.values["delay"] / h) for e in effects if e.family == "actuator_delay"}
        self.late = max(delays, default=0)  # all commands are as late
        self.data: list[Any] = []

    def begin(self, state: FloatArray) -> None:
        """Episodes begin at states (E, S); columns are joint, its velocity, the next joint."""
        self.data = [self._mj.MjData(self.model) for _ in state]
        for data, row in zip(self.data, state, strict=True):
            data.qpos[:], data.qvel[:], data.qfrc_applied[:] = row[0::2], row[1::2], self._push

    def sample(self, before: FloatArray, command: FloatArray, n: int) -> FloatArray:
        """(E, S) states n fine steps on: commands `before` (E, A) act until the newer ones arrive."""
        out, first = np.empty((len(self.data), 2 * self.model.nv)), min(self.late, n)
        for row, data, old, new in zip(out, self.data, before, command, strict=True):
            for acting, count in ((old, first), (new, n - first)):
                if count:
                    data.ctrl[:] = acting
                    self._mj.mj_step(self.model, data, count)
            row[0::2], row[1::2] = data.qpos, data.qvel
        return out
