"""Rollouts of a model: whole windows at once where their fields stand, substep by substep where something changes."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from gpsim.channels import BoolArray, Channels, FloatArray, IntArray
from gpsim.effects import RateEffect, Values
from gpsim.mjcf.activation import KEY
from gpsim.mjcf.afloat import Axis
from gpsim.mjcf.batches import Pool, parts
from gpsim.mjcf.body import Body
from gpsim.mjcf.layout import Layout
from gpsim.mjcf.native import FORCE, Fields
from gpsim.mjcf.optional import mujoco, quiet
from gpsim.mjcf.stepping import Moment, Plan, shares_of, write_laws
from gpsim.mjcf.yielding import Yielding
from gpsim.simulators import Memory, Simulator

FAR = 1e6  # where a simulation is that MuJoCo gave up
BAD = ("mjWARN_BADQPOS", "mjWARN_BADQVEL", "mjWARN_BADQACC")


@dataclass(frozen=True)
class Rolling:
    """A model in the channels of a simulator. columns: of a coordinate its position, velocity and degree of freedom.

    axes: of free joints, by their places.
    """

    body: Body
    layout: Layout
    channels: Channels
    columns: Mapping[str, tuple[int, int, int]]
    axes: Mapping[str, Axis]

    def rolled(
        self,
        simulator: Simulator,
        plan: Plan,
        values: Sequence[Values],
        state: FloatArray,
        commands: FloatArray,
        step: FloatArray,
        t: FloatArray,
        extra: FloatArray | None = None,
        strained: Memory | None = None,
    ) -> FloatArray:
        """(B, K, S): see `gpsim.effects.ClosedStep`; simulator: whom laws of rates ask."""
        out = np.empty((*commands.shape[:2], self.layout.size))
        for rows, lasting in self._alike(plan, values, state, commands, step, t, extra is None):
            part = [{name: value[rows] for name, value in v.items()} for v in values]
            more = None if extra is None else extra[rows]
            shares = {i: share[rows] for i, share in lasting.items()}
            kept = {key: value[rows] for key, value in (strained or {}).items()}
            out[rows] = self._rolled(
                simulator, plan, part, state[rows], commands[rows], step[rows], t[rows], more, shares, kept
            )
            for key, value in kept.items():
                strained[key][rows] = value  # type: ignore[index]  # there are none otherwise
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
        shares = shares_of(plan, self.channels, whole, state, values)
        same = np.all([(share == 0.0) | (share == 1.0) for share in shares.values()], axis=0)
        for some, lasting in ((rows[same], shares), (rows[~same], {})):
            yield from ((some[part], lasting) for part in parts(len(some)))

    def _rolled(
        self,
        simulator: Simulator,
        plan: Plan,
        values: Sequence[Values],
        state: FloatArray,
        commands: FloatArray,
        step: FloatArray,
        t: FloatArray,
        extra: FloatArray | None,
        shares: Mapping[int, FloatArray],
        strained: Memory,
    ) -> FloatArray:
        if len(step) and step[0] < 0.0:
            return self._backwards(plan, values, state, commands, step, t)
        count = len(state)
        fields = self._lasting(plan, values, count, step)
        plan.write(list(shares), fields, values, shares)
        pool = self.body.pools.of(plan.fields)
        qpos, qvel = self.layout.full(state)
        pool.begin(qpos, qvel, step)
        pool.write(fields.own, count)
        acts, b = self.body.activations, pool.simulations
        if acts:
            b.bind("ctrl")[:count] = commands[:, 0]
            alone = np.where(acts.integrates, np.nan, acts.held(commands[:, 0]))
            acts.begin(pool, strained.get(KEY, alone))
        if (plan.passing and not shares) or extra is not None:
            return self._stepwise(simulator, plan, values, pool, fields, commands, step, t, extra, strained)
        if FORCE in fields:
            b.bind(FORCE)[:count] = fields[FORCE]
        with quiet():
            made = b.rollout(commands.shape[1], commands, record=("qpos", "qvel"), ids=np.arange(count))
        out = self.layout.state(made["qpos"], made["qvel"])
        (gone,) = np.nonzero(_gave_up(pool, count))
        for row in gone:
            same = (out[row, 1:] == out[row, :-1]).all(axis=1)
            stuck = np.flatnonzero(~same)
            out[row, stuck[-1] + 1 if len(stuck) else 0 :] = FAR
        if KEY in strained:
            strained[KEY][:] = b.bind("act")[:count]
        return out

    def _stepwise(
        self,
        simulator: Simulator,
        plan: Plan,
        values: Sequence[Values],
        pool: Pool,
        fields: Fields,
        commands: FloatArray,
        step: FloatArray,
        t: FloatArray,
        extra: FloatArray | None,
        strained: Memory,
    ) -> FloatArray:
        """Substep by substep: laws, gates and rates that are added are looked at where each begins."""
        count, ids, b = len(step), np.arange(len(step)), pool.simulations
        qpos, qvel, force = (b.bind(name)[:count] for name in ("qpos", "qvel", FORCE))
        out = np.empty((*commands.shape[:2], self.layout.size))
        lasting = {name: np.array(v) for name, v in fields.own.items()}
        gone = np.zeros(count, dtype=np.bool_)
        yielding = Yielding(plan, self.columns)
        bends = yielding.begun(count, strained)
        for k in range(commands.shape[1]):
            state = self.layout.state(qpos, qvel)
            at = Moment(state, commands[:, k], t + k * step, step)
            self._write_passing(plan, values, pool, lasting, at, count)
            added = self._added(simulator, plan, at, values, extra)
            if added is not None:
                qvel += step[:, None] * added
            b.bind("ctrl")[:count] = commands[:, k]
            pushed = yielding.push(pool, at, values, bends, lasting) if yielding else None
            with quiet():
                b.step(ids)
            gone |= _gave_up(pool, count)
            out[:, k] = self.layout.state(qpos, qvel)
            if pushed is not None:
                yielding.move_on(pushed, at, out[:, k], values, bends)
            out[gone, k] = FAR
        force[:] = 0.0
        if KEY in strained:
            strained[KEY][:] = b.bind("act")[:count]
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
        now = Fields(self.body, count, at.step, {n: np.array(lasting[n]) for n in names if n in lasting})
        ahead = self.layout.ahead(at.state, at.step)
        shares = shares_of(plan, self.channels, at, ahead, values)
        plan.write([i for i in plan.passing if not plan.acts_on_state(i)], now, values, shares)
        write_laws(plan, now, self.columns, self.axes, at, values, shares, {**lasting, **now})
        pool.simulations.bind(FORCE)[:count] = now[FORCE]
        pool.write_some({n: now[n] for n in plan.moving_fields}, count)

    def _added(
        self, simulator: Simulator, plan: Plan, at: Moment, values: Sequence[Values], extra: FloatArray | None
    ) -> FloatArray | None:
        """(B, nv): accelerations that come from outside."""
        total = extra
        for i in plan.passing:
            term = plan.terms[i]
            if isinstance(term.effect, RateEffect):
                given = (at.state, at.command, plan.parameters, values[i], term.on)
                more = term.effect.added(simulator, *given)
                if term.gate:
                    more = more * shares_of(plan, self.channels, at, at.state, values)[i][:, None]
                total = more if total is None else total + more
        return total

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
            fields = self._lasting(plan, values, len(at), np.full(len(at), self.body.own_step))
            moment = Moment(at, commands[:, k], when, np.zeros(len(at)))
            shares = shares_of(plan, self.channels, moment, at, values)
            plan.write([i for i in plan.passing if not plan.acts_on_state(i)], fields, values, shares)
            write_laws(plan, fields, self.columns, self.axes, moment, values, shares, fields.own)
            return self.layout.slope(at, self.forward(plan, fields, at, commands[:, k])[0])

        for k in range(commands.shape[1]):
            when = t + k * step
            first = slope(state, k, when)
            second = slope(state + h * first, k, when + step)
            state = state + h / 2 * (first + second)
            state = np.clip(np.nan_to_num(state, nan=FAR), -FAR, FAR)
            out[:, k] = state
        return out

    def _lasting(self, plan: Plan, values: Sequence[Values], count: int, step: FloatArray) -> Fields:
        fields = Fields(self.body, count, step, {})
        plan.believed(fields)
        plan.write(plan.lasting, fields, values, {})
        return fields

    def forward(
        self, plan: Plan, fields: Fields, state: FloatArray, action: FloatArray
    ) -> tuple[FloatArray, Pool]:
        """(B, R) accelerations, and the batch in which they were found."""
        count = len(state)
        pool = self.body.pools.of(plan.fields | frozenset(fields.own) - {FORCE})
        qpos, qvel = self.layout.full(state)
        b = pool.simulations
        acc = b.bind("qacc")
        pool.begin(qpos, qvel, np.full(count, self.body.own_step))
        pool.write(fields.own, count)
        b.bind("ctrl")[:count] = action
        if FORCE in fields:
            b.bind(FORCE)[:count] = fields[FORCE]
        if self.body.activations:
            self.body.activations.begin(pool, self.body.activations.held(action))
        for name in ("M", "ncon", "nl"):
            b.bind(name)
        with quiet():
            b.forward(np.arange(count))
        return np.array(acc[:count]), pool


def _gave_up(pool: Pool, count: int) -> BoolArray:
    """(B,) whether MuJoCo warned of numbers that are none."""
    mj = mujoco()
    which = [int(getattr(mj.mjtWarning, name)) for name in BAD]
    return np.asarray(pool.simulations.warning[:count][:, which, 1].any(axis=1))
