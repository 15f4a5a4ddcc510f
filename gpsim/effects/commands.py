"""A command on its way to the simulator: one actuator's effects after another, over a grid of substeps."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from gpsim.channels import Channels, FloatArray
from gpsim.effects.effect import ActuatorEffect, Values
from gpsim.effects.term import Gate
from gpsim.simulators import Memory

Stage = tuple[Gate, ActuatorEffect, Values, Memory]
"""Where and when it acts, the law, its values (B,) each, and its memory."""


@dataclass(frozen=True)
class Grid:
    """K substeps of a batch: recorded actions (B, K, A), states (B, K, S) at both ends, begin and length (B, K) s.

    looking_ahead: gates ask for shares of a substep; else for the moment at which it begins.
    """

    actions: FloatArray
    begin: FloatArray
    end: FloatArray
    t: FloatArray
    step: FloatArray
    channels: Channels
    looking_ahead: bool

    def share(self, gate: Gate, values: Values) -> FloatArray:
        """(B, K) how much of each substep a gate is open."""
        if self.looking_ahead:
            return gate.share((self.begin, self.end), self.actions, self.t, self.step, self.channels, values)
        moment = np.zeros_like(self.step)
        return gate.share((self.begin, self.begin), self.actions, self.t, moment, self.channels, values)

    def split(self, shares: FloatArray, gated: bool) -> Grid:
        """The grid with every substep cut into P pieces of these shares (B, K, P) of it.

        gated: gates will look at it; actions and states are left out else.
        """
        lengths = self.step[:, :, None] * shares
        begins = self.t[:, :, None] + np.cumsum(lengths, axis=2) - lengths
        t, step = (a.reshape(len(a), -1) for a in (begins, lengths))
        if not gated:
            return replace(self, t=t, step=step)
        count = shares.shape[2]
        actions, begin, end = (np.repeat(a, count, axis=1) for a in (self.actions, self.begin, self.end))
        return replace(self, actions=actions, begin=begin, end=end, t=t, step=step)


def on_its_way(way: Sequence[Stage], column: int, grid: Grid) -> FloatArray:
    """(B, K) what one action's commands have become at the simulator, means over the substeps; memories move on."""
    u, whole, pieces = grid.actions[:, :, column], grid, 1
    for place, (gate, effect, given, memory) in enumerate(way):
        values = {name: value[:, None] for name, value in given.items()}
        share = grid.share(gate, values) if gate else None
        several = (
            effect.pieces(u, values, memory, grid.step, grid.t)
            if place < len(way) - 1 and pieces == 1
            else None
        )
        if several is None:
            acted = effect.actuate(u, values, memory, grid.step, grid.t)
        else:
            commands, shares = several
            pieces, grid = shares.shape[2], grid.split(shares, any(later for later, *_ in way[place + 1 :]))
            acted, u = commands.reshape(len(u), -1), np.repeat(u, pieces, axis=1)
            share = None if share is None else np.repeat(share, pieces, axis=1)
        u = acted if share is None else blended(share, acted, u)
    if pieces == 1:
        return u
    area = (u * grid.step).reshape(*whole.step.shape, pieces).sum(axis=2)
    return np.asarray(area / whole.step)


def blended(share: FloatArray, acted: FloatArray, untouched: FloatArray) -> FloatArray:
    """What an effect makes of a quantity during its share of a substep, with what it was for the rest."""
    return np.asarray(np.where(share == 1.0, acted, share * acted + (1.0 - share) * untouched))
