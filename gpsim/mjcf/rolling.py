"""Rollouts of a model: whole windows at once where their fields stand, substep by substep where something changes.

What acts between one substep and the next: laws that MuJoCo has no field for, gates, accelerations from outside, and
what yields and remembers how far, elastic drives and friction with bristles.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from gpsim.channels import BoolArray, Channels, FloatArray, IntArray
from gpsim.effects import (
    BristleEffect,
    ElasticDrive,
    ForceEffect,
    RateEffect,
    Values,
    bend_key,
    bent,
    mean_force,
    transmitted,
    turned,
)
from gpsim.mjcf.actuators import KEY, given
from gpsim.mjcf.batches import Pool, parts
from gpsim.mjcf.body import Body
from gpsim.mjcf.layout import Layout, dense
from gpsim.mjcf.naming import Axis
from gpsim.mjcf.optional import mujoco, quiet
from gpsim.mjcf.plan import FORCE, Fields, Plan, add_friction
from gpsim.simulators import Memory, Simulator

FAR = 1e6  # where a simulation is that MuJoCo gave up
BAD = ("mjWARN_BADQPOS", "mjWARN_BADQVEL", "mjWARN_BADQACC")
Columns = Mapping[str, tuple[int, int, int]]
"""Of a coordinate the columns of its position and velocity in a state, and its degree of freedom."""


@dataclass(frozen=True)
class Moment:
    """Where a batch is when a substep begins: state (B, S), command (B, A), clock and length of the substep (B,) s."""

    state: FloatArray
    command: FloatArray
    t: FloatArray
    step: FloatArray


@dataclass(frozen=True)
class Asked:
    """What is to be rolled out: a plan, its terms' values (B,), state (B, S), commands (B, K, A), step, clock (B,) s.

    simulator: whom laws of rates ask; extra: (B, nv) accelerations from outside.
    """

    simulator: Simulator
    plan: Plan
    values: Sequence[Values]
    state: FloatArray
    commands: FloatArray
    step: FloatArray
    t: FloatArray
    extra: FloatArray | None = None

    def part(self, rows: IntArray) -> Asked:
        """The same of some rows."""
        values = [{name: value[rows] for name, value in v.items()} for v in self.values]
        extra = None if self.extra is None else self.extra[rows]
        made = replace(self, values=values, state=self.state[rows], commands=self.commands[rows], extra=extra)
        return replace(made, step=self.step[rows], t=self.t[rows])

    def at(self, k: int, state: FloatArray) -> Moment:
        """Where it is in a state (B, S) when substep k begins."""
        return Moment(state, self.commands[:, k], self.t + k * self.step, self.step)


@dataclass(frozen=True)
class Rolling:
    """A model in the channels of a simulator; axes: of free joints, by their places."""

    body: Body
    layout: Layout
    channels: Channels
    columns: Columns
    axes: Mapping[str, Axis]

    def rolled(self, asked: Asked, strained: Memory | None = None) -> FloatArray:
        """(B, K, S): see `gpsim.effects.BlackBoxStepper`."""
        out = np.empty((*asked.commands.shape[:2], self.layout.size))
        for rows, lasting in self._alike(asked):
            shares = {i: share[rows] for i, share in lasting.items()}
            kept = {key: value[rows] for key, value in (strained or {}).items()}
            out[rows] = self._rolled(asked.part(rows), shares, kept)
            for key, value in kept.items():
                strained[key][rows] = value  # type: ignore[index]  # there are none otherwise
        return out

    def _alike(self, asked: Asked) -> Iterator[tuple[IntArray, dict[int, FloatArray]]]:
        """Rows that are simulated together, and the shares of gated terms that stay the same in them throughout."""
        rows = np.arange(len(asked.state))
        if asked.extra is not None or not asked.plan.timed:
            yield from ((rows[part], {}) for part in parts(len(rows)))
            return
        whole = replace(asked.at(0, asked.state), step=asked.commands.shape[1] * asked.step)
        shares = self._shares(asked, whole, asked.state)
        same = np.all([(share == 0.0) | (share == 1.0) for share in shares.values()], axis=0)
        for some, lasting in ((rows[same], shares), (rows[~same], {})):
            yield from ((some[part], lasting) for part in parts(len(some)))

    def _rolled(self, asked: Asked, shares: Mapping[int, FloatArray], strained: Memory) -> FloatArray:
        plan, step, commands = asked.plan, asked.step, asked.commands
        if len(step) and step[0] < 0.0:
            return self._backwards(asked)
        count = len(step)
        fields = self._lasting(asked, step)
        plan.write(list(shares), fields, asked.values, shares)
        pool = self._begun(plan, fields, asked.state, step)
        acts, b = self.body.activations, pool.simulations
        if acts:
            b.bind("ctrl")[:count] = commands[:, 0]
            alone = np.where(acts.integrates, np.nan, acts.held(commands[:, 0]))
            acts.begin(pool, strained.get(KEY, alone))
        if (plan.passing and not shares) or asked.extra is not None:
            return self._stepwise(asked, pool, fields, strained)
        if FORCE in fields:
            b.bind(FORCE)[:count] = fields[FORCE]
        with quiet():
            made = b.rollout(commands.shape[1], commands, record=("qpos", "qvel"), ids=np.arange(count))
        out = self.layout.state(made["qpos"], made["qvel"])
        (gone,) = np.nonzero(_gave_up(pool, count))
        for row in gone:
            moves = np.flatnonzero((out[row, 1:] != out[row, :-1]).any(axis=1))
            out[row, moves[-1] + 1 if len(moves) else 0 :] = FAR
        if KEY in strained:
            strained[KEY][:] = b.bind("act")[:count]
        return out

    def _stepwise(self, asked: Asked, pool: Pool, fields: Fields, strained: Memory) -> FloatArray:
        """Substep by substep: laws, gates and rates that are added are looked at where each begins."""
        commands, step, count, b = asked.commands, asked.step, len(asked.step), pool.simulations
        qpos, qvel, force = (b.bind(name)[:count] for name in ("qpos", "qvel", FORCE))
        out = np.empty((*commands.shape[:2], self.layout.size))
        lasting = {name: np.array(v) for name, v in fields.items()}
        gone = np.zeros(count, dtype=np.bool_)
        yielding = Yielding(asked.plan, self.columns)
        bends = yielding.begun(count, strained)
        for k in range(commands.shape[1]):
            at = asked.at(k, self.layout.state(qpos, qvel))
            self._write_passing(asked, pool, lasting, at)
            added = self._added(asked, at)
            if added is not None:
                qvel += step[:, None] * added
            b.bind("ctrl")[:count] = commands[:, k]
            pushed = yielding.push(pool, at, asked.values, bends, lasting) if yielding else None
            with quiet():
                b.step(np.arange(count))
            gone |= _gave_up(pool, count)
            out[:, k] = self.layout.state(qpos, qvel)
            if pushed is not None:
                yielding.move_on(pushed, at, out[:, k], asked.values, bends)
            out[gone, k] = FAR
        force[:] = 0.0
        if KEY in strained:
            strained[KEY][:] = b.bind("act")[:count]
        return out

    def _write_passing(self, asked: Asked, pool: Pool, lasting: Mapping[str, FloatArray], at: Moment) -> None:
        """Write what changes from substep to substep."""
        plan, count = asked.plan, len(at.step)
        names = (*plan.moving_fields, FORCE)
        now = Fields(self.body, at.step, {n: np.array(lasting[n]) for n in names if n in lasting})
        self._write_laws(asked, now, at, self.layout.ahead(at.state, at.step), lasting)
        pool.simulations.bind(FORCE)[:count] = now[FORCE]
        pool.write_some({n: now[n] for n in plan.moving_fields}, count)

    def _shares(self, asked: Asked, at: Moment, ahead: FloatArray) -> dict[int, FloatArray]:
        """(B,) of each gated term: how much of the substep it acts; ahead (B, S): about where the substep ends."""
        gates = {i: asked.plan.terms[i].gate for i in asked.plan.passing}
        looked = at.command, at.t, at.step, self.channels
        return {i: g.share((at.state, ahead), *looked, asked.values[i]) for i, g in gates.items() if g}

    def _write_laws(
        self, asked: Asked, fields: Fields, at: Moment, ahead: FloatArray, lasting: Mapping[str, FloatArray]
    ) -> None:
        """What passes: fields of gated terms, forces and grips of laws that look at the state and at what motors give.

        lasting: the fields (B, ...) that stand meanwhile.
        """
        plan, values, shares = asked.plan, asked.values, self._shares(asked, at, ahead)
        plan.write([i for i in plan.passing if not plan.acts_on_state(i)], fields, values, shares)
        known = {**lasting, **fields}
        for i in plan.passing:
            if not plan.acts_on_state(i):
                continue
            term, share = plan.terms[i], shares.get(i, 1.0)
            effect = term.effect
            assert isinstance(effect, ForceEffect)
            for on in term.places:
                if on in self.axes:
                    speed, direction = self.axes[on].along(at.state)
                    force = effect.force(speed, speed, values[i])
                    assert force is not None, term.family
                    fields[FORCE][:, self.axes[on].dofs] += (share * force)[:, None] * direction
                    continue
                position, velocity, dof = self.columns[on]
                where, speed = at.state[:, position], at.state[:, velocity]
                force = effect.force(where, speed, values[i])
                if force is not None:
                    fields[FORCE][:, dof] += share * force
                load = None
                if effect.loaded_by_command:
                    motors = self.body.motors[on]
                    load = np.abs(given(self.body.model, motors, at.command, where, speed, known))
                grip = effect.friction_limit(where, speed, values[i], load)
                if grip is not None:
                    add_friction(fields, dof, share * grip)

    def _added(self, asked: Asked, at: Moment) -> FloatArray | None:
        """(B, nv): accelerations that come from outside."""
        total, plan, values = asked.extra, asked.plan, asked.values
        for i in plan.passing:
            term = plan.terms[i]
            if isinstance(term.effect, RateEffect):
                seen = (at.state, at.command, plan.parameters, values[i], term.on)
                more = term.effect.added(asked.simulator, *seen)
                if term.gate:
                    more = more * self._shares(asked, at, at.state)[i][:, None]
                total = more if total is None else total + more
        return total

    def _backwards(self, asked: Asked) -> FloatArray:
        """Where the system was, by Heun's method on its accelerations: MuJoCo itself only goes forward."""
        plan, commands, step, state = asked.plan, asked.commands, asked.step, asked.state
        out, h = np.empty((*commands.shape[:2], state.shape[1])), step[:, None]

        def slope(at: FloatArray, k: int, when: FloatArray) -> FloatArray:
            fields = self._lasting(asked, np.full(len(at), self.body.own_step))
            moment = Moment(at, commands[:, k], when, np.zeros(len(at)))
            self._write_laws(asked, fields, moment, at, {})
            return self.layout.slope(at, self.forward(plan, fields, at, commands[:, k])[0])

        for k in range(commands.shape[1]):
            when = asked.t + k * step
            first = slope(state, k, when)
            second = slope(state + h * first, k, when + step)
            state = state + h / 2 * (first + second)
            state = np.clip(np.nan_to_num(state, nan=FAR), -FAR, FAR)
            out[:, k] = state
        return out

    def _lasting(self, asked: Asked, step: FloatArray) -> Fields:
        fields = Fields(self.body, step)
        asked.plan.believed(fields)
        asked.plan.write(asked.plan.lasting, fields, asked.values, {})
        return fields

    def _begun(self, plan: Plan, fields: Fields, state: FloatArray, step: FloatArray) -> Pool:
        pool = self.body.pool(plan.fields | frozenset(fields) - {FORCE})
        pool.begin(*self.layout.full(state), step)
        pool.write(fields, len(state))
        return pool

    def forward(
        self, plan: Plan, fields: Fields, state: FloatArray, action: FloatArray
    ) -> tuple[FloatArray, Pool]:
        """(B, R) accelerations, and the batch in which they were found."""
        count = len(state)
        pool = self._begun(plan, fields, state, np.full(count, self.body.own_step))
        b = pool.simulations
        b.bind("ctrl")[:count] = action
        if FORCE in fields:
            b.bind(FORCE)[:count] = fields[FORCE]
        if self.body.activations:
            self.body.activations.begin(pool, self.body.activations.held(action))
        acc, *_ = (b.bind(name) for name in ("qacc", "M", "ncon", "nl"))
        with quiet():
            b.forward(np.arange(count))
        return np.array(acc[:count]), pool


def _gave_up(pool: Pool, count: int) -> BoolArray:
    """(B,) whether MuJoCo warned of numbers that are none."""
    which = [int(getattr(mujoco().mjtWarning, name)) for name in BAD]
    return np.asarray(pool.simulations.warning[:count][:, which, 1].any(axis=1))


Pushed = tuple[FloatArray, Mapping[int, FloatArray]]
"""Of what yields before a substep: (B, nv, nv) the inverse mass matrix, and what was commanded of drives (B,)."""


@dataclass(frozen=True)
class Yielding:
    """The terms of a plan that yield.

    MuJoCo says before each substep how joints accelerate without them, and the mass matrix what a force changes. The
    laws are `gpsim.effects.elastic` and `gpsim.effects.bristles`: exact over a substep, however stiff.
    """

    plan: Plan
    columns: Columns

    def __bool__(self) -> bool:
        return bool(self._drives or self._bristles)

    @cached_property
    def _drives(self) -> list[tuple[int, int, float, str]]:
        """Of elastic drives the term, the motor, the force of a unit of its command, and what it drives."""
        coupled, names = self.plan.body.coupled, self.plan.body.names.action
        terms = [(i, t.on) for i, t in enumerate(self.plan.terms) if isinstance(t.effect, ElasticDrive)]
        return [(i, names.index(on), coupled[on][1], coupled[on][0]) for i, on in terms]

    @cached_property
    def _bristles(self) -> list[tuple[int, str]]:
        return [(i, t.on) for i, t in enumerate(self.plan.terms) if isinstance(t.effect, BristleEffect)]

    def begun(self, count: int, known: Memory) -> Memory:
        """How far each is bent or twisted: as is known, else not at all."""
        rest: Memory = {bend_key(i): np.zeros((count, 2)) for i, *_ in self._drives}
        rest |= {bend_key(i): np.zeros(count) for i, _ in self._bristles}
        return {key: known.get(key, none) for key, none in rest.items()}

    def push(
        self, pool: Pool, at: Moment, values: Sequence[Values], bends: Memory, known: Mapping[str, FloatArray]
    ) -> Pushed:
        """Put the mean of what reaches joints over the substep in the place of what motors give, and beside all else.

        known: the model's fields (B, ...) that stand meanwhile.
        """
        count, b, model = len(at.step), pool.simulations, self.plan.body.model
        ctrl, force, commanded = b.bind("ctrl")[:count], b.bind(FORCE)[:count], dict[int, FloatArray]()
        for i, motor, strength, on in self._drives:  # what each turns with, in units of the command
            where, speed = (at.state[:, column] for column in self.columns[on][:2])
            commanded[i] = given(model, (motor,), at.command, where, speed, known) / strength
            ctrl[:, motor] = 0.0
        acc, inertia = b.bind("qacc"), b.bind("M")
        with quiet():
            b.forward(np.arange(count))
        own = np.array(acc[:count])
        mobility = np.asarray(np.linalg.inv(dense(model, inertia[:count])), dtype=np.float64)

        def reach(dof: int, gets: FloatArray) -> None:
            nonlocal own
            force[:, dof] += gets
            own += mobility[:, :, dof] * gets[:, None]

        for i, _, strength, on in self._drives:
            dof, bend = self.columns[on][2], bends[bend_key(i)]
            reacts = strength * mobility[:, dof, dof]
            reach(dof, strength * transmitted(bend, commanded[i], own[:, dof], reacts, at.step, values[i]))
        for i, on in self._bristles:
            _, velocity, dof = self.columns[on]
            speed, reacts = at.state[:, velocity], mobility[:, dof, dof]
            reach(dof, mean_force(bends[bend_key(i)], speed, own[:, dof], reacts, at.step, values[i]))
        return mobility, commanded

    def move_on(
        self, pushed: Pushed, at: Moment, after: FloatArray, values: Sequence[Values], bends: Memory
    ) -> None:
        """Twist drives and bend bristles on to the state (B, S) after the substep."""
        mobility, commanded = pushed
        for i, _, strength, on in self._drives:
            _, velocity, dof = self.columns[on]
            moved, reacts = (after - at.state)[:, velocity] / at.step, strength * mobility[:, dof, dof]
            bend = bends[bend_key(i)]
            bend[:] = turned(bend, commanded[i], moved, reacts, at.step, values[i])
        for i, on in self._bristles:
            bend, speed = bends[bend_key(i)], 0.5 * (at.state + after)[:, self.columns[on][1]]
            bend[:], _ = bent(bend, speed * at.step, speed, values[i])
