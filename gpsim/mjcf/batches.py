"""Batches of simulations of one model, kept for the next call: making one costs more than a short rollout."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from gpsim.channels import FloatArray
from gpsim.mjcf.optional import batch, mujoco

SIZE = 256
"""Simulations a batch: more do not fit a processor's cache, and are run one part after another."""
KEPT = 12

DERIVED = ("body_mass", "body_inertia", "body_ipos", "body_iquat", "dof_armature", "tendon_armature")
"""Fields after whose change MuJoCo derives constants anew."""


@dataclass
class Pool:
    """Simulations of one model with some of its fields their own.

    fresh: (N,) a state row at rest, nothing remembered. was: what each own field is in the model.
    """

    simulations: Any
    fresh: FloatArray
    own: dict[str, FloatArray]
    was: dict[str, FloatArray]
    derives: bool

    def begin(self, qpos: FloatArray, qvel: FloatArray, timestep: FloatArray) -> None:
        """Set the first simulations to these states (B, nq), (B, nv): no time, no warm start, no input of before."""
        count, b = len(qpos), self.simulations
        b.state[:count] = self.fresh
        b.bind("qpos")[:count] = qpos
        b.bind("qvel")[:count] = qvel
        self.own["opt.timestep"][:count] = timestep.reshape(self.own["opt.timestep"][:count].shape)
        b.warning[:count] = 0

    def write(self, fields: Mapping[str, FloatArray], count: int) -> None:
        """Fields (B, ...) of the first simulations; those of its own that are not named are the model's."""
        for name, values in self.own.items():
            if name != "opt.timestep":
                values[:count] = fields[name] if name in fields else self.was[name]
        if self.derives:
            self.simulations.set_const(np.arange(count))

    def write_some(self, fields: Mapping[str, FloatArray], count: int) -> None:
        """Some of the fields (B, ...) of the first simulations anew; constants follow where a value is another."""
        moved = np.zeros(count, dtype=np.bool_)
        for name, values in fields.items():
            if name in DERIVED:
                moved |= (self.own[name][:count] != values).reshape(count, -1).any(axis=1)
            self.own[name][:count] = values
        if moved.any():
            self.simulations.set_const(np.flatnonzero(moved))


@dataclass
class Pools:
    """The batches of one model in this process, by which fields are their own."""

    model: Any
    _kept: dict[tuple[str, ...], Pool] = field(default_factory=dict)

    def of(self, fields: frozenset[str]) -> Pool:
        """The batch whose simulations have these fields of their own (and their time step)."""
        key = tuple(sorted(fields | {"opt.timestep"}))
        pool = self._kept.pop(key, None)
        self._kept[key] = pool = pool or self._made(key)  # the newest last
        while len(self._kept) > KEPT:
            del self._kept[next(iter(self._kept))]
        return pool

    def _made(self, fields: tuple[str, ...]) -> Pool:
        mj, model, kind = mujoco(), self.model, mujoco().mjtState.mjSTATE_INTEGRATION
        simulations, data = batch().Batch(model, SIZE, nthread=1), mj.MjData(model)
        own = {name: simulations.expand(name) for name in fields}
        was = {name: np.array(values[0]) for name, values in own.items()}
        mj.mj_resetData(model, data)
        fresh = np.empty(mj.mj_stateSize(model, kind))
        mj.mj_getState(model, data, fresh, kind)
        return Pool(simulations, fresh, own, was, any(name in DERIVED for name in fields))


def parts(count: int) -> Iterator[slice]:
    """Slices of a batch of so many rows, each no more than a pool holds."""
    for first in range(0, count, SIZE):
        yield slice(first, min(first + SIZE, count))
