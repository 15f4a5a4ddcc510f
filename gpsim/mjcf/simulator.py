"""A MuJoCo model as a simulator: rates are its accelerations, its integration is its own."""

from __future__ import annotations

import copy
from collections.abc import Collection, Iterator, Mapping, Sequence
from functools import lru_cache
from typing import Any, ClassVar

import numpy as np

from gpsim.channels import BoolArray, Channels, FloatArray, IntArray, difference
from gpsim.effects import Term, Values
from gpsim.errors import UsageError
from gpsim.mjcf.batches import Pool, parts
from gpsim.mjcf.body import Body, body_of
from gpsim.mjcf.loading import Loaded, load
from gpsim.mjcf.native import FORCE, Fields
from gpsim.mjcf.optional import mujoco, quiet
from gpsim.mjcf.places import places_of
from gpsim.mjcf.stepping import Moment, Plan, shares_of, write_laws
from gpsim.simulators import Integrator, Parameters, Simulator

FAR = 1e6  # where a simulation is that MuJoCo gave up
WHOLE = 1e-6  # of a step: a transition so little longer than its steps is made of them
BAD = ("mjWARN_BADQPOS", "mjWARN_BADQVEL", "mjWARN_BADQACC")


class MjcfSimulator(Simulator):
    """A MuJoCo model in the channels of its joints. Copies in other processes load the same files anew.

    fixed: states that a recording does not show, at these values; held: joints among them that something holds still.
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
    ) -> None:
        self._exact = exact
        self._loaded, self._fixed, self._held = loaded, dict(fixed or {}), tuple(sorted(held))
        self._body = _body(loaded.source.reference, loaded.source.digest, self._held, exact)
        names = self._body.names
        every = state or names.state
        self.state = Channels(tuple(c for c in every if c.name not in self._fixed))  # type: ignore[misc]
        self.name = loaded.source.reference  # type: ignore[misc]
        self.action = names.action  # type: ignore[misc]
        self.rate = names.rate  # type: ignore[misc]
        self.parameters = dict(self._body.parameters)  # type: ignore[misc]
        own = [i for i, c in enumerate(names.coordinates) if not {c.name, c.velocity} & set(self._fixed)]
        self.coordinates = tuple(names.coordinates[i] for i in own)  # type: ignore[misc]
        self.own_step = self._body.own_step
        self._dofs = [names.dofs[i] for i in own]
        self.model_places = places_of(self._body, [self.state.names, [c.name for c in self.coordinates]])
        self._places()

    def __reduce__(self) -> tuple[Any, tuple[Any, ...]]:
        source = self._loaded.source
        return _again, (source.reference, source.digest, self.state, self._fixed, self._held, self._exact)

    @property
    def own_grid(self) -> bool:
        """Whether it steps as the model says, not by a method of higher order."""
        return not self._exact

    @property
    def body(self) -> Body:
        """The model, its names and its knobs."""
        return self._body

    @property
    def rest_state(self) -> FloatArray:
        """(S,): the model's own reference, standing still."""
        return self._state(self._qpos0, self._qvel0)

    def free_model(self) -> Any:
        """A copy of the model that keeps its energy: without damping, friction, motors, contacts and limits."""
        mj, model = mujoco(), copy.copy(self._body.base)
        bits = ("DAMPER", "ACTUATION", "CONTACT", "LIMIT", "FRICTIONLOSS")
        for bit in bits:
            model.opt.disableflags |= int(getattr(mj.mjtDisableBit, f"mjDSBL_{bit}"))
        return model

    @property
    def control_step(self) -> float | None:
        """The control step [s] of the environment that the model came from; None of a file."""
        return self._loaded.control_step

    def with_state(self, state: Channels) -> MjcfSimulator:
        """The same with channels of the same names, of which others wrap."""
        return MjcfSimulator(self._loaded, state, self._fixed, self._held, self._exact)

    def without(self, fixed: Mapping[str, float], held: Collection[str]) -> MjcfSimulator:
        """The same without the states `fixed`; joints `held` among them stand in a mount."""
        return MjcfSimulator(
            self._loaded, self.state, {**self._fixed, **fixed}, {*self._held, *held}, self._exact
        )

    def as_modelled(self) -> MjcfSimulator:
        """The same by the model's own method."""
        return MjcfSimulator(self._loaded, self.state, self._fixed, self._held)

    def exact(self) -> MjcfSimulator:
        """The same by the classical Runge-Kutta scheme, whatever the model says."""
        return MjcfSimulator(self._loaded, self.state, self._fixed, self._held, exact=True)

    def steps_of(self, dt: float) -> int:
        """How many of the model's own steps a transition of dt [s] takes."""
        return max(1, int(np.ceil(dt / self.own_step - WHOLE)))

    def rates(
        self, state: FloatArray, action: FloatArray, parameters: Parameters, forces: FloatArray | None = None
    ) -> FloatArray:
        """(B, R): MuJoCo's accelerations."""
        plan = self._plan((), {})
        every: list[FloatArray] = []
        for rows in parts(len(state)):
            fields = Fields(
                self._body, rows.stop - rows.start, np.full(rows.stop - rows.start, self.own_step), {}
            )
            self._believe(fields, parameters, rows)
            if forces is not None:
                fields[FORCE][:, self._dofs] += forces[rows]
            every.append(self._forward(plan, fields, state[rows], action[rows])[0])
        return np.concatenate(every) if every else np.empty((0, len(self.rate)))

    def derivative(self, state: FloatArray, rates: FloatArray) -> FloatArray:
        """(B, S): velocities and accelerations, a free joint's quaternion turned by its angular velocity."""
        _, qvel = self._full(state)
        slope = np.zeros((len(state), self._body.model.nq))
        for q, v in self._simple:
            slope[:, q] = qvel[:, v]
        qpos, _ = self._full(state)
        for q, v in self._freed:
            slope[:, q : q + 3] = qvel[:, v : v + 3]
            slope[:, q + 3 : q + 7] = _quaternion_slope(qpos[:, q + 3 : q + 7], qvel[:, v + 3 : v + 6])
        return self._shown(slope, rates)

    def measured_rates(self, state: FloatArray, next_state: FloatArray, dt: FloatArray) -> FloatArray:
        """(B, R): velocity differences over dt."""
        change = difference(next_state, state, self.state)
        out = np.zeros((len(state), self._body.model.nv))
        out[:, self._v_dofs] = change[:, self._v_columns] / dt[:, None]
        return out

    def measures(self, rate: str) -> bool:
        """Whether the states that are left say what a rate was."""
        return self.rate.index(rate) in self._v_dofs

    def mobility(self, state: FloatArray, parameters: Parameters, coordinate: int) -> FloatArray:
        """(B, R): a column of the inverse of the mass matrix."""
        return np.asarray(np.linalg.inv(self.inertia(state, parameters))[:, :, self._dofs[coordinate]])

    def inertia(self, state: FloatArray, parameters: Parameters) -> FloatArray:
        """(B, nv, nv): the mass matrix, the motors' armature in it."""
        plan, every = self._plan((), {}), []
        action = np.zeros((len(state), len(self.action)))
        for rows in parts(len(state)):
            fields = Fields(
                self._body, rows.stop - rows.start, np.full(rows.stop - rows.start, self.own_step), {}
            )
            self._believe(fields, parameters, rows)
            pool = self._forward(plan, fields, state[rows], action[rows])[1]
            every.append(_dense(self._body.model, pool.simulations.bind("M")[: fields.count]))
        return np.concatenate(every)

    def touching(self, state: FloatArray) -> BoolArray:
        """(B,): whether something touches, or a joint is at its limit, in each state."""
        action = np.zeros((len(state), len(self.action)))
        plan, every = self._plan((), {}), []
        for rows in parts(len(state)):
            fields = Fields(
                self._body, rows.stop - rows.start, np.full(rows.stop - rows.start, self.own_step), {}
            )
            simulations = self._forward(plan, fields, state[rows], action[rows])[1].simulations
            count = fields.count
            every.append(
                (simulations.bind("ncon")[:count] + simulations.bind("nl")[:count]).reshape(count) > 0
            )
        return np.concatenate(every) if every else np.empty(0, dtype=np.bool_)

    @property
    def tolerated_penetration(self) -> float:
        """How deep [m] bodies may touch in a first state: soft contacts do, and joints are read inexactly."""
        return max(0.02 * max(self._body.lengths().values(), default=0.0), 0.002)

    def penetration(self, state: FloatArray) -> tuple[FloatArray, list[str]]:
        """(B,) m: the least distance of what touches, negative inside, 0 where nothing does; and which bodies."""
        mj, model = mujoco(), self._body.base
        data, deepest, pairs = mj.MjData(model), np.zeros(len(state)), [""] * len(state)
        qpos, _ = self._full(state)
        for i, q in enumerate(qpos):
            data.qpos[:] = q
            mj.mj_fwdPosition(model, data)
            for contact in data.contact[: data.ncon]:
                if contact.dist < deepest[i]:
                    deepest[i] = contact.dist
                    bodies = [self._body.names.bodies[model.geom_bodyid[g]] for g in contact.geom]
                    pairs[i] = " and ".join(bodies)
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
        said = {n: float(np.ravel(v)[0]) for n, v in parameters.items()}
        return self.rolled((), said, (), state, held, dt / count, np.zeros(len(state)))[:, -1]

    def plus(self, state: FloatArray, change: FloatArray) -> FloatArray:
        """(B, S): the state moved by a tangent vector (B, 2 nv): of positions, then of velocities."""
        mj, model = mujoco(), self._body.model
        qpos, qvel = self._full(state)
        for i in range(len(state)):
            mj.mj_integratePos(model, qpos[i], np.ascontiguousarray(change[i, : model.nv]), 1.0)
        return self._state(qpos, qvel + change[:, model.nv :])

    def minus(self, after: FloatArray, before: FloatArray) -> FloatArray:
        """(B, 2 nv): the tangent vector that leads from one state to the other."""
        mj, model = mujoco(), self._body.model
        (q1, v1), (q0, v0) = self._full(after), self._full(before)
        moved = np.empty((len(after), model.nv))
        for i in range(len(after)):
            mj.mj_differentiatePos(model, moved[i], 1.0, q0[i], q1[i])
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
    ) -> FloatArray:
        """(B, K, S): see `gpsim.effects.ClosedStep`."""
        plan = self._plan(tuple(terms), parameters)
        out = np.empty((*commands.shape[:2], state.shape[1]))
        for rows, lasting in self._alike(plan, values, state, commands, step, t, extra is None):
            part = [{name: value[rows] for name, value in v.items()} for v in values]
            more = None if extra is None else extra[rows]
            shares = {i: share[rows] for i, share in lasting.items()}
            out[rows] = self._rolled(
                plan, part, state[rows], commands[rows], step[rows], t[rows], more, shares
            )
        return out

    def _alike(
        self,
        plan: Plan,
        values: Sequence[Values],
        state: FloatArray,
        commands: FloatArray,
        step: FloatArray,
        t: FloatArray,
        alone: bool,
    ) -> Iterator[tuple[IntArray, dict[int, FloatArray]]]:
        """Rows that are simulated together, and the shares of gated terms that stay the same in them throughout."""
        rows = np.arange(len(state))
        if not (alone and plan.timed):
            yield from ((rows[part], {}) for part in parts(len(rows)))
            return
        whole = Moment(state, commands[:, 0], t, commands.shape[1] * step)
        shares = shares_of(plan, self.state + self.action, whole, state, values)
        same = np.all([(share == 0.0) | (share == 1.0) for share in shares.values()], axis=0)
        for some, lasting in ((rows[same], shares), (rows[~same], {})):
            yield from ((some[part], lasting) for part in parts(len(some)))

    def _rolled(
        self,
        plan: Plan,
        values: Sequence[Values],
        state: FloatArray,
        commands: FloatArray,
        step: FloatArray,
        t: FloatArray,
        extra: FloatArray | None,
        shares: Mapping[int, FloatArray],
    ) -> FloatArray:
        if len(step) and step[0] < 0.0:
            return self._backwards(plan, values, state, commands, step, t)
        count = len(state)
        fields = self._lasting(plan, values, count, step)
        plan.write(list(shares), fields, values, shares)
        pool = self._body.pools.of(plan.fields)
        qpos, qvel = self._full(state)
        pool.begin(qpos, qvel, step)
        pool.write(fields.own, count)
        if (plan.passing and not shares) or extra is not None:
            return self._stepwise(plan, values, pool, fields, commands, step, t, extra)
        if FORCE in fields:
            pool.simulations.bind(FORCE)[:count] = fields[FORCE]
        with quiet():
            made = pool.simulations.rollout(
                commands.shape[1], commands, record=("qpos", "qvel"), ids=np.arange(count)
            )
        out = self._state(made["qpos"], made["qvel"])
        (gone,) = np.nonzero(_gave_up(pool, count))
        for row in gone:
            same = (out[row, 1:] == out[row, :-1]).all(axis=1)
            stuck = np.flatnonzero(~same)
            out[row, stuck[-1] + 1 if len(stuck) else 0 :] = FAR
        return out

    def _stepwise(
        self,
        plan: Plan,
        values: Sequence[Values],
        pool: Pool,
        fields: Fields,
        commands: FloatArray,
        step: FloatArray,
        t: FloatArray,
        extra: FloatArray | None,
    ) -> FloatArray:
        """Substep by substep: laws, gates and rates that are added are looked at where each begins."""
        count, ids, b = len(step), np.arange(len(step)), pool.simulations
        qpos, qvel, force = (b.bind(name)[:count] for name in ("qpos", "qvel", FORCE))
        out = np.empty((*commands.shape[:2], len(self.state)))
        lasting = {name: np.array(v) for name, v in fields.own.items()}
        gone = np.zeros(count, dtype=np.bool_)
        for k in range(commands.shape[1]):
            state = self._state(qpos, qvel)
            at = Moment(state, commands[:, k], t + k * step, step)
            self._write_passing(plan, values, pool, lasting, at, count)
            added = self._added(plan, at, values, extra)
            if added is not None:
                qvel += step[:, None] * added
            b.bind("ctrl")[:count] = commands[:, k]
            with quiet():
                b.step(ids)
            gone |= _gave_up(pool, count)
            out[:, k] = self._state(qpos, qvel)
            out[gone, k] = FAR
        force[:] = 0.0
        return out

    def _write_passing(
        self,
        plan: Plan,
        values: Sequence[Values],
        pool: Pool,
        lasting: Mapping[str, FloatArray],
        at: Moment,
        count: int,
    ) -> None:
        """Write what changes from substep to substep."""
        names = (*plan.moving_fields, FORCE)
        now = Fields(self._body, count, at.step, {n: np.array(lasting[n]) for n in names if n in lasting})
        ahead = self._ahead(at)
        shares = shares_of(plan, self.state + self.action, at, ahead, values)
        plan.write([i for i in plan.passing if not plan.acts_on_state(i)], now, values, shares)
        write_laws(plan, now, self._columns, at, values, shares)
        pool.simulations.bind(FORCE)[:count] = now[FORCE]
        pool.write_some({n: now[n] for n in plan.moving_fields}, count)

    def _added(
        self, plan: Plan, at: Moment, values: Sequence[Values], extra: FloatArray | None
    ) -> FloatArray | None:
        """(B, nv): accelerations that come from outside."""
        total = extra
        for i in plan.passing:
            effect = plan.terms[i].effect
            if effect.site == "rate":
                more = effect.added(self, at.state, at.command, plan.parameters, values[i])  # type: ignore[attr-defined]
                if plan.terms[i].gate:
                    more = more * shares_of(plan, self.state + self.action, at, at.state, values)[i][:, None]
                total = more if total is None else total + more
        return total

    def _ahead(self, at: Moment) -> FloatArray:
        """(B, S): about where a substep ends."""
        qpos, qvel = self._full(at.state)
        for q, v in self._simple:
            qpos[:, q] += at.step * qvel[:, v]
        return self._state(qpos, qvel)

    def _backwards(
        self,
        plan: Plan,
        values: Sequence[Values],
        state: FloatArray,
        commands: FloatArray,
        step: FloatArray,
        t: FloatArray,
    ) -> FloatArray:
        """Where the system was, by Heun's method on its accelerations: MuJoCo itself only goes forward."""
        out, h = np.empty((*commands.shape[:2], state.shape[1])), step[:, None]

        def slope(at: FloatArray, k: int, when: FloatArray) -> FloatArray:
            fields = self._lasting(plan, values, len(at), np.full(len(at), self.own_step))
            moment = Moment(at, commands[:, k], when, np.zeros(len(at)))
            shares = shares_of(plan, self.state + self.action, moment, at, values)
            plan.write([i for i in plan.passing if not plan.acts_on_state(i)], fields, values, shares)
            write_laws(plan, fields, self._columns, moment, values, shares)
            return self.derivative(at, self._forward(plan, fields, at, commands[:, k])[0])

        for k in range(commands.shape[1]):
            when = t + k * step
            first = slope(state, k, when)
            second = slope(state + h * first, k, when + step)
            state = state + h / 2 * (first + second)
            state = np.clip(np.nan_to_num(state, nan=FAR), -FAR, FAR)
            out[:, k] = state
        return out

    def _lasting(self, plan: Plan, values: Sequence[Values], count: int, step: FloatArray) -> Fields:
        fields = Fields(self._body, count, step, {})
        plan.believed(fields)
        plan.write(plan.lasting, fields, values, {})
        return fields

    def _forward(
        self, plan: Plan, fields: Fields, state: FloatArray, action: FloatArray
    ) -> tuple[FloatArray, Pool]:
        """(B, R) accelerations, and the batch in which they were found."""
        count = len(state)
        pool = self._body.pools.of(plan.fields | frozenset(fields.own) - {FORCE})
        qpos, qvel = self._full(state)
        b = pool.simulations
        acc = b.bind("qacc")
        pool.begin(qpos, qvel, np.full(count, self.own_step))
        pool.write(fields.own, count)
        b.bind("ctrl")[:count] = action
        if FORCE in fields:
            b.bind(FORCE)[:count] = fields[FORCE]
        for name in ("M", "ncon", "nl"):
            b.bind(name)
        with quiet():
            b.forward(np.arange(count))
        return np.array(acc[:count]), pool

    def _believe(self, fields: Fields, parameters: Parameters, rows: slice) -> None:
        """Write parameters, one number each or one a row, where they are not the model's."""
        for name, value in parameters.items():
            if name in self.parameters and not np.all(value == self.parameters[name].default):
                own = np.asarray(value, dtype=np.float64)
                own = np.full(fields.count, own) if own.ndim == 0 else own[rows]
                self._body.knobs[name].write(fields, own)

    def _plan(self, terms: tuple[Term, ...], parameters: Mapping[str, float]) -> Plan:
        return Plan(self._body, terms, parameters)

    def _dof(self, on: str) -> int:
        names = self._body.names
        return names.dofs[[c.name for c in names.coordinates].index(on)]

    def _places(self) -> None:
        """Where the channels lie in qpos and qvel, and what stands where no channel is."""
        names, model = self._body.names, self._body.model
        every = {
            c.name: (q, v) for c, q, v in zip(names.state, names.positions, names.velocities, strict=True)
        }
        at = [every[c.name] for c in self.state]
        self._q_columns = [i for i, (q, _) in enumerate(at) if q >= 0]
        self._q_places = [q for q, _ in at if q >= 0]
        self._v_columns = [i for i, (_, v) in enumerate(at) if v >= 0]
        self._v_dofs = [v for _, v in at if v >= 0]
        self._qpos0, self._qvel0 = np.array(model.qpos0), np.zeros(model.nv)
        for name, value in self._fixed.items():
            q, v = every[name]
            if q >= 0:
                self._qpos0[q] = value
            else:
                self._qvel0[v] = value
        self._simple = [(int(model.jnt_qposadr[j]), int(model.jnt_dofadr[j])) for j in names.joints]
        free = [j for j in range(model.njnt) if j not in names.joints]
        self._freed = [(int(model.jnt_qposadr[j]), int(model.jnt_dofadr[j])) for j in free]
        self._columns = {
            c.name: (self.state.index(c.name), self.state.index(c.velocity), dof)
            for c, dof in zip(self.coordinates, self._dofs, strict=True)
        }

    def _full(self, state: FloatArray) -> tuple[FloatArray, FloatArray]:
        """(B, nq), (B, nv) of states (B, S)."""
        qpos, qvel = np.tile(self._qpos0, (len(state), 1)), np.tile(self._qvel0, (len(state), 1))
        qpos[:, self._q_places] = state[:, self._q_columns]
        qvel[:, self._v_dofs] = state[:, self._v_columns]
        return qpos, qvel

    def _state(self, qpos: FloatArray, qvel: FloatArray) -> FloatArray:
        """(..., S) of (..., nq) and (..., nv)."""
        out = np.empty((*qpos.shape[:-1], len(self.state)))
        out[..., self._q_columns] = qpos[..., self._q_places]
        out[..., self._v_columns] = qvel[..., self._v_dofs]
        return out

    def _shown(self, slope: FloatArray, rates: FloatArray) -> FloatArray:
        """(B, S) of the slopes of positions (B, nq) and velocities (B, nv)."""
        return self._state(slope, rates)


def _gave_up(pool: Pool, count: int) -> BoolArray:
    """(B,) whether MuJoCo warned of numbers that are none."""
    mj = mujoco()
    which = [int(getattr(mj.mjtWarning, name)) for name in BAD]
    return np.asarray(pool.simulations.warning[:count][:, which, 1].any(axis=1))


def _quaternion_slope(quat: FloatArray, omega: FloatArray) -> FloatArray:
    """(B, 4): of unit quaternions (B, 4), real part first, turned by omega (B, 3) rad/s of their own frame."""
    w, x, y, z = quat.T
    a, b, c = omega.T
    parts_ = [-x * a - y * b - z * c, w * a + y * c - z * b, w * b + z * a - x * c, w * c + x * b - y * a]
    return np.asarray(0.5 * np.stack(parts_, axis=1))


def _dense(model: Any, packed: FloatArray) -> FloatArray:
    """(B, nv, nv) symmetric of MuJoCo's packed lower triangles (B, nC)."""
    out = np.zeros((len(packed), model.nv, model.nv))
    for row in range(model.nv):
        first, count = int(model.M_rowadr[row]), int(model.M_rownnz[row])
        columns = np.asarray(model.M_colind[first : first + count])
        out[:, row, columns] = packed[:, first : first + count]
        out[:, columns, row] = packed[:, first : first + count]
    return out


@lru_cache(maxsize=8)
def _body(reference: str, digest: str, held: tuple[str, ...], exact: bool) -> Body:
    return body_of(load(reference), held, exact=exact)


def load_mjcf(reference: str) -> MjcfSimulator:
    """The simulator of robot.xml, robot.urdf, FILE.py:function or gym:ID; raises UsageError for every fault of it."""
    return MjcfSimulator(load(reference))


def _again(
    reference: str,
    digest: str,
    state: Channels,
    fixed: Mapping[str, float],
    held: tuple[str, ...],
    exact: bool,
) -> MjcfSimulator:
    """The same simulator in another process; raises UsageError where its files have changed meanwhile."""
    loaded = load(reference)
    if loaded.source.digest != digest:
        raise UsageError(f"{reference}: changed while it was being diagnosed; start again")
    made = MjcfSimulator(loaded, None, fixed, held, exact)
    return made if made.state == state else made.with_state(state)
