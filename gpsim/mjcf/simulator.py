"""A MuJoCo model as a simulator: rates are its accelerations, its integration is its own."""

from __future__ import annotations

import copy
from collections import defaultdict
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from functools import lru_cache
from typing import Any, ClassVar

import numpy as np

from gpsim.channels import BoolArray, Channels, FloatArray, difference
from gpsim.effects import Term, Values
from gpsim.errors import UsageError
from gpsim.mjcf.actuators import KEY, given
from gpsim.mjcf.batches import Pool, parts
from gpsim.mjcf.body import Body, body_of, places_of
from gpsim.mjcf.geometry import Moved
from gpsim.mjcf.layout import Layout, contacts, dense, pressed, turned_by
from gpsim.mjcf.loading import Loaded, load
from gpsim.mjcf.naming import POSE, TWIST, axes_of
from gpsim.mjcf.optional import mujoco
from gpsim.mjcf.plan import FORCE, Fields, Plan
from gpsim.mjcf.rolling import Asked, Rolling
from gpsim.recordings import evenly
from gpsim.simulators import Integrator, Memory, Parameters, Simulator

NEAR, LOOKED_AT = 0.02, 2000  # m between bodies, and states that are looked at for it
STANDS = 0.1  # of the states, in which what stands or walks touches at least
MARKERS = 0.01  # m, that a motion capture's or an odometry's place of a whole robot is off the ground's
SINKS = 0.02  # m, that what lands goes into a soft ground
WHOLE = 1e-6  # of a step: a transition so little longer than its steps is made of them
LIFTING = ("z", "qx", "qy")  # what of a pose lifts feet, all of them or one side's
UPRIGHT = 0.9  # cosine of a slide to gravity, beyond which it lifts what stands
AFLOAT = 3  # joints without a motor between the world and a body that floats, in a plane
TORQUE = "_tau"  # ends the column of a torque or force that was measured at a joint, or of its motor


class MjcfSimulator(Simulator):
    """A MuJoCo model in the channels of its joints. Copies in other processes load the same files anew.

    fixed: states that a recording does not show, at these values; held: joints among them that something holds still;
    exact: by a scheme of higher order than the model's; contacts: whether bodies touch; geometry: by what the model's
    is off. body: the model, its names and its knobs; believed: the compiled model as its files say, which is nobody's
    to change; layout: where its channels lie in the model's positions and velocities; control_step: [s], of the
    environment that the model came from, None of a file; rest_state: (S,), the model's own reference, standing still;
    own_grid: whether it steps as the model says, not by a method of higher order.
    """

    name: ClassVar[str]
    guesses_speeds = True

    def __init__(
        self,
        loaded: Loaded,
        state: Channels | None = None,
        fixed: Mapping[str, float] | None = None,
        held: Collection[str] = (),
        exact: bool = False,
        contacts: bool = True,
        geometry: tuple[Moved, ...] = (),
    ) -> None:
        self.own_grid, self._contacts, self.geometry = not exact, contacts, geometry
        self._loaded, self._fixed, self._held = loaded, dict(fixed or {}), tuple(sorted(held))
        source, self.believed, self.control_step = loaded.source, loaded.model, loaded.control_step
        self.body = _body(source.reference, source.digest, self._held, exact, contacts, geometry)
        names = self.body.names
        every = state or names.state
        self.state = Channels(tuple(c for c in every if c.name not in self._fixed))  # type: ignore[misc]
        self.name = source.reference  # type: ignore[misc]
        self.action, self.rate = names.action, names.rate  # type: ignore[misc]
        self.parameters = dict(self.body.parameters)  # type: ignore[misc]
        own = [i for i, c in enumerate(names.coordinates) if not {c.name, c.velocity} & set(self._fixed)]
        self.coordinates = tuple(names.coordinates[i] for i in own)  # type: ignore[misc]
        self.own_step = self.body.own_step
        self.as_measured = tuple(n for n in self.state.names if n.rpartition(".")[0] in names.free)
        self.settled = tuple(f"{joint}.{POSE[3]}" for joint in names.free)
        self._dofs = [names.dofs[i] for i in own]
        self.model_places = places_of(self.body, [self.state.names, [c.name for c in self.coordinates]])
        self.layout = Layout.of(self.body, self.state, self._fixed)
        self.rest_state = self.layout.state(self.layout.qpos, self.layout.qvel)
        columns = {
            c.name: (self.state.index(c.name), self.state.index(c.velocity), dof)
            for c, dof in zip(self.coordinates, self._dofs, strict=True)
        }
        self._axes = axes_of(names, self.state)
        self._rolling = Rolling(self.body, self.layout, self.state + self.action, columns, self._axes)

    def __reduce__(self) -> tuple[Any, tuple[Any, ...]]:
        source = self._loaded.source
        how = (self._fixed, self._held, not self.own_grid, self._contacts, self.geometry)
        return _again, (source.reference, source.digest, self.state, *how)

    @property
    def levels(self) -> tuple[str, ...]:
        """None: whatever a model has beside joints, it integrates itself."""
        return ()

    @property
    def stand_ins(self) -> Mapping[str, tuple[str, ...]]:
        """Of a motor the torque that was measured at its joint, JOINT_tau, or ACTUATOR_tau: it drove the joint.

        A log of motor currents has no command beside them. A servo's torque says nothing of its command.
        """
        force = {c.name: c.force_unit for c in self.coordinates}
        return {
            action: tuple(f"{name}{TORQUE}" for name in (joint, action))
            for action, joint in self.drives.items()
            if self.action.units[action] == force.get(joint)
        }

    @property
    def drives(self) -> Mapping[str, str]:
        """Of every actuator on a joint which one it drives."""
        return self.body.names.drives

    def driven(self) -> dict[str, str]:
        """None: what its drives give is within its step."""
        return {}

    def coupled(self) -> dict[str, tuple[str, float]]:
        """See `Simulator.coupled`: motors, no servos."""
        known = {c.name for c in self.coordinates}
        return {action: drive for action, drive in self.body.coupled.items() if drive[0] in known}

    @property
    def served(self) -> tuple[str, ...]:
        """Joints whose motors' forces follow from commands and the joint alone."""
        return tuple(self.body.motors)

    def given(self, state: FloatArray, action: FloatArray, parameters: Parameters) -> dict[str, FloatArray]:
        """Coordinate -> (B,): what its motors give; gains and stiffness as the model has them."""
        index, out = self.state.index, {}
        velocities = {c.name: c.velocity for c in self.coordinates}
        for on, motors in self.body.motors.items():
            where, speed = state[:, index(on)], state[:, index(velocities[on])]
            out[on] = given(self.body.model, motors, action, where, speed, {})
        return out

    def rest(self, count: int) -> Memory:
        """See `gpsim.effects.BlackBoxStepper`: activations."""
        acts = self.body.activations
        return {KEY: acts.rest(count)} if acts else {}

    def led(
        self,
        first: FloatArray,
        before: FloatArray,
        commands: FloatArray,
        steps: FloatArray,
        commanded: FloatArray,
    ) -> Memory:
        """See `gpsim.effects.BlackBoxStepper`."""
        acts, model, names = self.body.activations, self.body.model, self.body.names
        begun = np.zeros((len(first), len(acts.actuators)))
        for k in np.flatnonzero(acts.follows):
            joint = names.drives.get(names.action.names[i := acts.actuators[k]], "")
            if joint in self.state.names:
                begun[:, k] = float(model.actuator_gear[i, 0]) * first[:, self.state.index(joint)]
        moved = (before != first[:, None]).any(axis=2) | (commands != 0.0).any(axis=2)
        known = np.maximum.accumulate(moved, axis=1)
        settled = np.where(known[:, :1], acts.held(commands[:, 0]), begun)
        integral = np.clip(begun + commanded[:, acts.actuators], acts.low, acts.high)
        level = np.where(acts.integrates, integral, settled)
        return {KEY: acts.after(commands, np.where(known, steps, 0.0), level)[0]}

    def acting(self, actions: FloatArray, t: FloatArray) -> FloatArray:
        """See `gpsim.effects.BlackBoxStepper`."""
        acts, out = self.body.activations, np.array(actions)
        if acts and len(actions):
            first = np.where(acts.integrates, 0.0, acts.held(actions[:1]))
            means = acts.after(actions[None], np.diff(t)[None], first)[1][0]
            out[:, acts.actuators[~acts.flows]] = means[:, ~acts.flows]
        return out

    def with_state(self, state: Channels) -> MjcfSimulator:
        """The same with channels of the same names, of which others wrap."""
        return self._like(state=state)

    def without(self, fixed: Mapping[str, float], held: Collection[str]) -> MjcfSimulator:
        """The same without the states `fixed`; joints `held` among them stand in a mount."""
        return self._like(fixed={**self._fixed, **fixed}, held={*self._held, *held})

    def in_geometry(self, geometry: Sequence[Moved]) -> MjcfSimulator:
        """The same with the model's geometry off by so much, instead of what it was."""
        return self._like(geometry=tuple(geometry))

    def as_modelled(self) -> MjcfSimulator:
        """The same by the model's own method."""
        return self._like(exact=False)

    def exact(self) -> MjcfSimulator:
        """The same by the classical Runge-Kutta scheme, whatever the model says; currents are too fast for it."""
        return self if self.body.activations.flows.any() else self._like(exact=True)

    def around(self, states: FloatArray) -> MjcfSimulator:
        """The same for motion near these states (N, S): where nothing comes near anything, nothing is looked for."""
        model, some = copy.copy(self.body.base), states[evenly(len(states), LOOKED_AT)]
        model.geom_margin[:] += NEAR
        model.pair_margin[:] += NEAR
        return self if any(True for _ in contacts(model, self.layout, some)) else self._like(contacts=False)

    def _like(self, **changes: Any) -> MjcfSimulator:
        own = {"state": self.state, "fixed": self._fixed, "held": self._held, "exact": not self.own_grid}
        own |= {"contacts": self._contacts, "geometry": self.geometry}
        return MjcfSimulator(self._loaded, **{**own, **changes})

    def steps_of(self, dt: float) -> int:
        """How many of the model's own steps a transition of dt [s] takes."""
        return max(1, int(np.ceil(dt / self.own_step - WHOLE)))

    def state_error(self, measured: FloatArray, said: FloatArray) -> FloatArray:
        """(..., S): what lies between; of a free joint's orientation in the tangent space."""
        return self.layout.state_error(measured, said, difference(measured, said, self.state))

    def rates(
        self, state: FloatArray, action: FloatArray, parameters: Parameters, forces: FloatArray | None = None
    ) -> FloatArray:
        """(B, R): MuJoCo's accelerations."""
        found = [acc for acc, _ in self._looked(state, action, parameters, forces)]
        return np.concatenate(found) if found else np.empty((0, len(self.rate)))

    def derivative(self, state: FloatArray, rates: FloatArray) -> FloatArray:
        """(B, S): velocities and accelerations, a free joint's quaternion turned by its angular velocity."""
        return self.layout.slope(state, rates)

    def measured_rates(self, state: FloatArray, next_state: FloatArray, dt: FloatArray) -> FloatArray:
        """(B, R): velocity differences over dt."""
        change = difference(next_state, state, self.state)
        out = np.zeros((len(state), self.body.model.nv))
        out[:, self.layout.v_places] = change[:, self.layout.v_columns] / dt[:, None]
        return out

    def measures(self, rate: str) -> bool:
        """Whether the states that are left say what a rate was."""
        return self.rate.index(rate) in self.layout.v_places

    def mobility(self, state: FloatArray, parameters: Parameters, coordinate: int) -> FloatArray:
        """(B, R): a column of the inverse of the mass matrix."""
        return np.asarray(np.linalg.inv(self.inertia(state, parameters))[:, :, self._dofs[coordinate]])

    def inertia(self, state: FloatArray, parameters: Parameters) -> FloatArray:
        """(B, nv, nv): the mass matrix, the motors' armature in it."""
        action = np.zeros((len(state), len(self.action)))
        model, every = self.body.model, self._looked(state, action, parameters)
        return np.concatenate([dense(model, pool.simulations.bind("M")[: len(acc)]) for acc, pool in every])

    def lacking_force(
        self,
        state: FloatArray,
        action: FloatArray,
        acceleration: FloatArray,
        parameters: Parameters,
        terms: Sequence[Term] = (),
    ) -> FloatArray:
        """(B, C): `gpsim.effects.BlackBoxStepper`; MuJoCo's inverse dynamics less actuation, where nothing touches."""
        plan, found = Plan(self.body, tuple(terms), _numbers(parameters)), []
        every = zip(parts(len(state)), self._looked(state, action, parameters, plan=plan), strict=True)
        for rows, (acc, pool) in every:
            inertia = dense(self.body.model, pool.simulations.bind("M")[: len(acc)])
            found.append((inertia @ (acceleration[rows] - acc)[..., None])[:, self._dofs, 0])
        return np.concatenate(found)

    def touching(self, state: FloatArray) -> BoolArray:
        """(B,): whether something touches, or a joint is at its limit, in each state."""
        action, found = np.zeros((len(state), len(self.action))), []
        for acc, pool in self._looked(state, action, {}):
            touched = [pool.simulations.bind(name)[: len(acc)].reshape(-1) for name in ("ncon", "nl")]
            found.append(np.add(*touched) > 0)
        return np.concatenate(found) if found else np.empty(0, dtype=np.bool_)

    def speed(self, on: str, state: FloatArray) -> FloatArray:
        """(B,) m/s or rad/s along or about an axis of a body that floats."""
        if on in self._axes:
            return self._axes[on].along(state)[0]
        joint, _, axis = on.rpartition(".")
        return state[:, self.state.index(f"{joint}.v{axis}")]

    @property
    def velocities(self) -> frozenset[str]:
        """Those of its coordinates and of free joints."""
        twists = (f"{joint}.{part}" for joint in self.body.names.free for part in TWIST)
        return super().velocities | frozenset(twists)

    @property
    def unlikely(self) -> frozenset[str]:
        """Every body but the ones at free joints and the ground, and their numbers; a push along gravity."""
        model, names = self.body.base, self.body.names
        free = set(model.jnt_bodyid[~np.isin(model.jnt_dofadr, names.dofs)].tolist())
        others = {name for b, name in enumerate(names.bodies) if b not in free}
        falls = zip("xyz", np.abs(model.opt.gravity) > 0.0, strict=True)
        pushes = {f"{joint}.{axis}" for axis, pulled in falls if pulled for joint in names.free}
        return frozenset(others | pushes | {p for p in self.parameters if p.rpartition(".")[0] in others})

    def followed(
        self, name: str, columns: Mapping[str, FloatArray], slope: Callable[[FloatArray], FloatArray]
    ) -> FloatArray | None:
        """(K,) a free joint's velocity by the slope of its place, or of its orientation, where they were recorded."""
        joint, _, part = name.rpartition(".")
        needed = [f"{joint}.{p}" for p in ((part[1:],) if part in TWIST[:3] else POSE[3:])]
        if joint not in self.body.names.free or part not in TWIST or not set(needed) <= set(columns):
            return None
        if part in TWIST[:3]:
            return slope(columns[needed[0]])
        quat = np.stack([columns[n] for n in needed], axis=1)
        return turned_by(quat, np.stack([slope(q) for q in quat.T], axis=1))[:, TWIST.index(part) - 3]

    def stands(self, state: FloatArray) -> bool:
        """Whether something touches in a good part of these states (N, S)."""
        return bool(self.touching(state[evenly(len(state), LOOKED_AT)]).mean() > STANDS)

    @property
    def heights(self) -> tuple[int, ...]:
        """Columns of a state that lift what may stand on something."""
        model = self.body.model
        lifts = np.abs(model.jnt_axis @ model.opt.gravity) > UPRIGHT * np.linalg.norm(model.opt.gravity)
        lifts &= model.body_parentid[model.jnt_bodyid] == 0
        found = [f"{free}.{part}" for free in self.body.names.free for part in LIFTING]
        found += [c.name for c in self.coordinates if c.force_unit == "N" and lifts[self.body.joint(c.name)]]
        return tuple(map(self.state.index, found)) if self._contacts else ()

    @property
    def floating(self) -> frozenset[str]:
        """Those of a body that three or more joints without a motor tie to the world, as one that moves in a plane."""
        model, driven = self.body.model, set(self.drives.values())
        free: dict[int, list[str]] = defaultdict(list)
        for coordinate, joint in zip(self.coordinates, model.dof_jntid[self._dofs], strict=True):
            body = int(model.jnt_bodyid[joint])
            if model.body_parentid[body] == 0 and coordinate.name not in driven:
                free[body].append(coordinate.name)
        return frozenset(n for names in free.values() if len(names) >= AFLOAT for n in names)

    def untouched(self, state: FloatArray) -> frozenset[str]:
        """Friction and stiffness of what nothing stands on in any of these states (B, S)."""
        of_contacts = frozenset(s.parameter for s in self.body.surfaces)
        if not of_contacts:
            return of_contacts
        meet = state[self.touching(state)]
        met = contacts(self.body.base, self.layout, meet[evenly(len(meet), LOOKED_AT)])
        pairs = {frozenset(pair) for _, data in met for pair in data.contact.geom[: data.ncon].tolist()}
        touch = [s for s in self.body.surfaces if any(frozenset((s.geom, g)) in pairs for g in s.others)]
        return of_contacts - {s.parameter for s in touch}

    def hindered(self, state: FloatArray) -> BoolArray:
        """(B, C): which coordinates a limit of theirs pushes, or what bodies touch that they carry."""
        model, margin = self.body.model, MARKERS if self.body.names.free else 0.0
        out = np.zeros((len(state), len(self.coordinates)), dtype=np.bool_)
        if self._contacts:
            out = pressed(self.body, self.layout, state, margin)[:, self._dofs]
        joints = model.dof_jntid[self._dofs]
        for column, joint, coordinate in zip(out.T, joints, self.coordinates, strict=True):
            if model.jnt_limited[joint]:
                q, (low, high) = state[:, self.state.index(coordinate.name)], model.jnt_range[joint]
                margin = float(model.jnt_margin[joint])
                column |= (q < low + margin) | (q > high - margin)
        return out

    @property
    def tolerated_penetration(self) -> float:
        """How deep [m] bodies may touch in a first state: soft contacts do, joints and places are read inexactly."""
        least = SINKS if self.body.names.free or self.floating else 0.002
        return max(0.02 * max(self.body.lengths().values(), default=0.0), least)

    def penetration(self, state: FloatArray) -> tuple[FloatArray, list[str]]:
        """(B,) m: the least distance of what touches, negative inside, 0 where nothing does; and which bodies."""
        model, deepest, pairs = self.body.base, np.zeros(len(state)), [""] * len(state)
        for i, data in contacts(model, self.layout, state):
            for contact in data.contact[: data.ncon]:
                if contact.dist < deepest[i]:
                    bodies = (self.body.names.bodies[model.geom_bodyid[g]] for g in contact.geom)
                    deepest[i], pairs[i] = contact.dist, " and ".join(bodies)
        return deepest, pairs

    def step(
        self,
        state: FloatArray,
        action: FloatArray,
        parameters: Parameters,
        dt: FloatArray,
        integrator: Integrator,
    ) -> FloatArray:
        """(B, S): the state after dt (B,) s, in steps of the model's own or a little shorter."""
        count = self.steps_of(float(np.max(dt, initial=self.own_step)))
        held = np.repeat(action[:, None], count, axis=1)
        return self.rolled((), _numbers(parameters), (), state, held, dt / count, np.zeros(len(state)))[:, -1]

    @property
    def positions(self) -> tuple[int, ...]:
        """State columns of places and orientations."""
        return self.layout.q_columns

    def motion(self, path: FloatArray) -> tuple[FloatArray, FloatArray]:
        """(N, S) states and (N, R) rates along `positions` (3, N, Q) with their first two derivatives by time."""
        return self.layout.motion(path)

    def plus(self, state: FloatArray, change: FloatArray) -> FloatArray:
        """(B, S): the state moved by a tangent vector (B, 2 nv): of positions, then of velocities."""
        model, (qpos, qvel) = self.body.model, self.layout.full(state)
        for q, moved in zip(qpos, change[:, : model.nv], strict=True):
            mujoco().mj_integratePos(model, q, np.ascontiguousarray(moved), 1.0)
        return self.layout.state(qpos, qvel + change[:, model.nv :])

    def minus(self, after: FloatArray, before: FloatArray) -> FloatArray:
        """(B, 2 nv): the tangent vector that leads from one state to the other."""
        (q1, v1), (q0, v0) = self.layout.full(after), self.layout.full(before)
        moved = np.empty_like(v1)
        for row, one, other in zip(moved, q0, q1, strict=True):
            mujoco().mj_differentiatePos(self.body.model, row, 1.0, one, other)
        return np.concatenate([moved, v1 - v0], axis=1)

    def rolled(
        self,
        terms: Sequence[Term],
        parameters: Mapping[str, float],
        values: Sequence[Values],
        state: FloatArray,
        commands: FloatArray,
        step: FloatArray,
        t: FloatArray,
        extra: FloatArray | None = None,
        strained: Memory | None = None,
    ) -> FloatArray:
        """(B, K, S): see `gpsim.effects.BlackBoxStepper`."""
        plan = Plan(self.body, tuple(terms), parameters)
        return self._rolling.rolled(Asked(self, plan, values, state, commands, step, t, extra), strained)

    def _looked(
        self,
        state: FloatArray,
        action: FloatArray,
        parameters: Parameters,
        forces: FloatArray | None = None,
        plan: Plan | None = None,
    ) -> Iterator[tuple[FloatArray, Pool]]:
        """Accelerations (B, R), part by part, and the batch that holds what else was found until it is asked again."""
        plan = plan or Plan(self.body, (), {})
        for rows in parts(len(state)):
            count = rows.stop - rows.start
            fields = Fields(self.body, np.full(count, self.own_step))
            for name, value in parameters.items():  # one number each or one a row
                if name in self.parameters and not np.all(value == self.parameters[name].default):
                    own = np.asarray(value, dtype=np.float64)
                    own = np.full(count, own) if own.ndim == 0 else own[rows]
                    self.body.knobs[name].write(fields, own)
            values = [{k: np.full(count, v) for k, v in t.values.items()} for t in plan.terms]
            plan.write(plan.lasting, fields, values, {})
            if forces is not None:
                fields[FORCE][:, self._dofs] += forces[rows]
            yield self._rolling.forward(plan, fields, state[rows], action[rows])


def _numbers(parameters: Parameters) -> dict[str, float]:
    """One number each."""
    return {n: float(np.ravel(v)[0]) for n, v in parameters.items()}


@lru_cache(maxsize=8)
def _body(reference: str, digest: str, *how: Any) -> Body:
    return body_of(load(reference), *how)


def load_mjcf(reference: str) -> MjcfSimulator:
    """The simulator of robot.xml, robot.urdf, FILE.py:function or gym:ID; raises UsageError for every fault of it."""
    return MjcfSimulator(load(reference))


def _again(
    reference: str, digest: str, state: Channels, fixed: Mapping[str, float], *how: Any
) -> MjcfSimulator:
    """The same simulator in another process; raises UsageError where its files have changed meanwhile."""
    loaded = load(reference)
    if loaded.source.digest != digest:
        raise UsageError(f"{reference}: changed during the diagnosis; start again")
    made = MjcfSimulator(loaded, None, fixed, *how)
    return made if made.state == state else made.with_state(state)
