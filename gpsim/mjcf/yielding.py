"""What yields at a model's joints and remembers how far: elastic drives, and friction with bristles.

MuJoCo says before each substep how joints accelerate without them, and the mass matrix what a force changes. The laws
are `gpsim.effects.elastic` and `gpsim.effects.bristles`: exact over a substep, however stiff.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from gpsim.channels import FloatArray
from gpsim.effects import BristleEffect, ElasticDrive, Values, bend_key, bent, mean_force, transmitted, turned
from gpsim.mjcf.batches import Pool
from gpsim.mjcf.looking import dense
from gpsim.mjcf.motors import given
from gpsim.mjcf.native import FORCE
from gpsim.mjcf.optional import quiet
from gpsim.mjcf.stepping import Moment, Plan
from gpsim.simulators import Memory


@dataclass(frozen=True)
class Pushed:
    """What yields before a substep: (B, nv, nv) the inverse mass matrix, and what was commanded of drives (B,)."""

    mobility: FloatArray
    commanded: Mapping[int, FloatArray]


@dataclass(frozen=True)
class Yielding:
    """The terms of a plan that yield. columns: of a coordinate its position, velocity and degree of freedom."""

    plan: Plan
    columns: Mapping[str, tuple[int, int, int]]

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
        self,
        pool: Pool,
        at: Moment,
        values: Sequence[Values],
        bends: Memory,
        known: Mapping[str, FloatArray],
    ) -> Pushed:
        """Put the mean of what reaches joints over the substep in the place of what motors give, and beside all else.

        known: the model's fields (B, ...) that stand meanwhile.
        """
        count, b = len(at.step), pool.simulations
        ctrl, force = b.bind("ctrl")[:count], b.bind(FORCE)[:count]
        commanded = self._commanded(at, known)
        for _, motor, _, _ in self._drives:
            ctrl[:, motor] = 0.0
        acc, inertia = b.bind("qacc"), b.bind("M")
        with quiet():
            b.forward(np.arange(count))
        own = np.array(acc[:count])
        mobility = np.asarray(np.linalg.inv(dense(self.plan.body.model, inertia[:count])), dtype=np.float64)
        for i, _, strength, on in self._drives:
            dof = self.columns[on][2]
            reacts = strength * mobility[:, dof, dof]
            gets = strength * transmitted(
                bends[bend_key(i)], commanded[i], own[:, dof], reacts, at.step, values[i]
            )
            force[:, dof] += gets
            own += mobility[:, :, dof] * gets[:, None]
        for i, on in self._bristles:
            _, velocity, dof = self.columns[on]
            speed, reacts = at.state[:, velocity], mobility[:, dof, dof]
            gets = mean_force(bends[bend_key(i)], speed, own[:, dof], reacts, at.step, values[i])
            force[:, dof] += gets
            own += mobility[:, :, dof] * gets[:, None]
        return Pushed(mobility, commanded)

    def move_on(
        self, pushed: Pushed, at: Moment, after: FloatArray, values: Sequence[Values], bends: Memory
    ) -> None:
        """Twist drives and bend bristles on to the state (B, S) after the substep."""
        for i, _, strength, on in self._drives:
            _, velocity, dof = self.columns[on]
            moved, reacts = (after - at.state)[:, velocity] / at.step, strength * pushed.mobility[:, dof, dof]
            bends[bend_key(i)][:] = turned(
                bends[bend_key(i)], pushed.commanded[i], moved, reacts, at.step, values[i]
            )
        for i, on in self._bristles:
            speed = 0.5 * (at.state + after)[:, self.columns[on][1]]
            bends[bend_key(i)][:], _ = bent(bends[bend_key(i)], speed * at.step, speed, values[i])

    def _commanded(self, at: Moment, known: Mapping[str, FloatArray]) -> dict[int, FloatArray]:
        """(B,) of each drive what its motor turns with, within its range, in units of the command."""
        model, found = self.plan.body.model, {}
        for i, motor, strength, on in self._drives:
            where, speed = (at.state[:, column] for column in self.columns[on][:2])
            found[i] = given(model, (motor,), at.command, where, speed, known) / strength
        return found
