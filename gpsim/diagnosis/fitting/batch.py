"""Windows that are simulated together, and what reaches the simulator in them: what actuators make of commands."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from gpsim.channels import Channels, FloatArray, IntArray, difference
from gpsim.diagnosis.data import Windows
from gpsim.effects import IN_EPISODE, Chain, Values, own_values
from gpsim.kernels import Commands, Program, actuators_of, at_rest, travelled
from gpsim.simulators import Memory

Spread = Callable[[FloatArray, int], Sequence[Values]]
"""Thetas (C, P), repeated so many times each -> one mapping a term of values."""
Drive = Callable[[int, int, FloatArray], FloatArray]
"""What reaches the simulator (B, A) at transition k, substep j, in state (B, S); called in the order of time.

Transitions before the window are -1, -2, ..., their commands are known whatever the state.
"""
FAR = 1e6  # what a diverging simulation is clipped to: far beyond any state, and its square is still a number
SEEN = (
    6  # moments of a transition, at the most, at which sensors look at a simulator that owns its integration
)
UNEVEN_FINER = 4.0
"""Times as many substeps as usual that an uneven clock may have where a delay is simulated."""


@dataclass(frozen=True)
class Batch:
    """Every window for each of C copies of a chain's values; row c W + w is window w of copy c.

    windows: with as much before them as matters; values: (C W,) each, of every term; n: substeps of a transition; even:
    whether all clocks are; moments: of a transition at which sensors that remember look; slots: how many of these
    back they look; first: copies with commands of their own; which: (C,) the place in `first` of each copy's commands.
    """

    chain: Chain
    windows: Windows
    values: list[Values]
    n: int
    even: bool
    moments: int
    slots: int
    first: IntArray
    which: IntArray

    @cached_property
    def rows(self) -> IntArray:
        """(C W,) the window of each row."""
        return np.tile(np.arange(len(self.windows)), len(self.which))

    @property
    def commanded(self) -> IntArray:
        """(C W,) which of the commands, of all windows of the copies with some of their own, are a row's."""
        count = len(self.windows)
        return np.asarray((self.which[:, None] * count + np.arange(count)).ravel())

    @property
    def commanding(self) -> list[Values]:
        """The values in all windows of the copies with commands of their own."""
        count = len(self.windows)
        rows = (self.first[:, None] * count + np.arange(count)).ravel()
        return [{name: value[rows] for name, value in values.items()} for values in self.values]

    @cached_property
    def usual(self) -> float:
        """A substep [s]."""
        return float(np.median(np.diff(self.clock, axis=1) / self.n))

    @property
    def clock(self) -> FloatArray:
        """(W, M + L + 1) s, before the windows and in them."""
        return np.concatenate([self.windows.before_t, self.windows.t[:, 1:]], axis=1)

    @property
    def given(self) -> FloatArray:
        """(W, M + L, A) what was commanded before the windows and in them."""
        return np.concatenate([self.windows.before_actions, self.windows.actions], axis=1)

    @property
    def zero_order_hold_exact(self) -> bool:
        """Whether whole control steps lead up to the windows: no sensor looks at the substeps before them."""
        return self.even and self.chain.actuation.zero_order_hold_exact and not self.chain.sensors.remember


def batch_of(
    chain: Chain, windows: Windows, values: list[Values], spread: Spread, thetas: FloatArray, n: int
) -> Batch:
    """The windows for copies with thetas (C, P), in n substeps a transition."""
    acting, remember, even = bool(chain.actuation), chain.sensors.remember, windows.even
    moments, slots = n, 0
    if remember and even:
        slots = chain.sensors.reach(values, (windows.t[:, 1] - windows.t[:, 0]) / n)
    elif remember:  # from wherever that is furthest
        slots = n * windows.samples_within(chain.sensors.looks_back(values)) + 3
    if acting or remember:
        shortest = float(np.diff(windows.before_t, axis=1).min(initial=np.inf))
        back = chain.actuation.remembers(values) / max(shortest, 1e-12) + slots / n
        if np.isfinite(back):
            windows = windows.remembering(int(np.ceil(min(back, FAR))) + 2)
    else:
        windows = windows.remembering(0)
    if remember and chain.closed is not None:  # their curves are cubic: a few moments will do
        moments = n if n <= SEEN else max((m for m in range(2, SEEN + 1) if n % m == 0), default=n)
        slots = -(-slots // (n // moments)) + 2
    first, which = np.zeros(1, dtype=np.int64), np.zeros(len(thetas), dtype=np.int64)
    if acting and len(thetas) > 1:  # parameters of other sites do not change what becomes of a command
        each = [list(v.values()) for i, v in enumerate(spread(thetas, 1)) if chain.actuation.acts(i)]
        columns = np.stack([value for own in each for value in own], axis=1)
        _, first, which = np.unique(columns, axis=0, return_index=True, return_inverse=True)
    return Batch(chain, windows, values, n, even, moments, slots, first, which.reshape(-1))


def values_of(chain: Chain, windows: Windows, spread: Spread, thetas: FloatArray) -> list[Values]:
    """Of every term, the values of all windows of all copies; where a gate asks for it, their episodes, too.

    A window has the values that are its recording's own, where there are such.
    """
    values = list(spread(thetas, len(windows)))
    for i, term in enumerate(chain.terms):
        if term.owners:
            of = None if windows.source is None else np.tile(windows.source, len(thetas))
            values[i] = own_values(values[i], of)
        if term.gate.since_episode is not None:
            values[i] = {**values[i], IN_EPISODE: np.tile(windows.episode, len(thetas)).astype(np.float64)}
    return values


def drive_of(batch: Batch) -> Drive:
    """All commands at once: they do not depend on the simulated state, nor on parameters of other sites.

    Where they do depend on the state, those before the window are taken at the measured one, those in it step by step.
    """
    chain, windows, rows, n = batch.chain, batch.windows, batch.rows, batch.n
    if not chain.actuation:
        recorded = np.ascontiguousarray(windows.actions.transpose(1, 0, 2)[:, rows])
        return lambda k, j, state: recorded[k] if k >= 0 else windows.before_actions[rows, k]
    acted, memory, before = _acted(batch)
    by_time, which = np.ascontiguousarray(acted.transpose(1, 0, 2)), batch.commanded
    held = {key: kept[which] for key, kept in memory.items()}

    def drive(k: int, j: int, state: FloatArray) -> FloatArray:
        if k < 0 or not chain.actuation.looks:
            return np.asarray(by_time[before + n * k + j][which])
        begin = windows.t[rows, k]
        step = (windows.t[rows, k + 1] - begin) / n
        return chain.command(windows.actions[rows, k], state, batch.values, held, step, begin + j * step)

    return drive


def commands(batch: Batch, program: Program, threads: int) -> Commands | None:
    """The same for compiled code; None where it cannot do what actuators do to commands that depend on the state."""
    chain, windows, n = batch.chain, batch.windows, batch.n
    before = windows.before_actions.shape[1]
    if not chain.actuation:
        return Commands(batch.given, batch.rows, before, finely=False)
    looks, which = chain.actuation.looks, batch.commanded
    step = n * batch.usual if batch.zero_order_hold_exact else batch.usual
    resting = None if looks else at_rest(program, chain, step, even=batch.even)
    if resting is None:
        acted, memory, known = _acted(batch)
        if not looks:
            return Commands(acted, which, known, finely=True)
        at = actuators_of(program, memory, len(acted), even=batch.even)
        if at is None:
            return None
        return Commands(acted, which, known, finely=True, given=windows.actions, at=at)
    own = np.tile(np.arange(len(windows)), len(batch.first))
    values = program.values(batch.commanding, len(own))
    if batch.zero_order_hold_exact:
        led = windows.before_t, windows.before_actions
        acted = travelled(program, n, values, windows.t, own, windows.actions, resting, threads, led)
        return Commands(acted, which, 0, finely=True)
    acted = travelled(program, n, values, batch.clock, own, batch.given, resting, threads)
    return Commands(acted, which, n * before, finely=True)


def _acted(batch: Batch) -> tuple[FloatArray, Memory, int]:
    """(U, K, A) what reaches the simulator at every substep, memory after them, how many lie before the windows.

    Of the windows, too, unless what becomes of commands depends on the state.
    """
    chain, windows, n, looks = batch.chain, batch.windows, batch.n, batch.chain.actuation.looks
    rows, values = np.tile(np.arange(len(windows)), len(batch.first)), batch.commanding
    clock, actions, before = batch.clock, batch.given, n * windows.before_actions.shape[1]
    if batch.zero_order_hold_exact:
        memory = _led_up_to(batch, rows, values)
        clock, actions, before = windows.t, windows.actions, 0
    else:
        finer = UNEVEN_FINER if looks and not batch.even else 1.0
        memory = chain.actuation.rest(len(rows), batch.usual / finer)
    end = before if looks else None
    if end == 0:
        return np.empty((len(rows), 0, windows.actions.shape[2])), memory, 0
    steps = np.diff(clock, axis=1) / n
    t = (clock[:, :-1, None] + steps[:, :, None] * np.arange(n)).reshape(len(windows), -1)[:, :end]
    step = np.repeat(steps, n, axis=1)[:, :end]
    states = np.empty((len(windows), step.shape[1] + 1, 0))  # nobody looks at them
    if looks:
        states = _measured_between(windows, n, chain.simulator.state)[:, : step.shape[1] + 1]
    given = np.repeat(actions, n, axis=1)[:, :end]
    return chain.commands(given[rows], states[rows], values, memory, step[rows], t[rows]), memory, before


def _led_up_to(batch: Batch, rows: IntArray, values: Sequence[Values]) -> Memory:
    """The actuators' memory at the windows' beginning, from whole control steps."""
    chain, n = batch.chain, batch.n
    actions, t = batch.windows.before_actions[rows], batch.windows.before_t[rows]
    memory = chain.actuation.rest(len(rows), batch.usual * n)
    states = np.empty((*t.shape, 0))  # nobody looks at them
    chain.commands(actions, states, values, memory, np.diff(t, axis=1), t[:, :-1])
    return chain.actuation.finer(memory, n)


def _measured_between(windows: Windows, n: int, channels: Channels) -> FloatArray:
    """(W, K + 1, S) the measured states at all substeps, before and in the window: where gates of actuators look."""
    states = np.concatenate([windows.before_states, windows.measured], axis=1)
    share = np.arange(n)[:, None] / n
    between = states[:, :-1, None] + share * difference(states[:, 1:], states[:, :-1], channels)[:, :, None]
    flat = between.reshape(len(states), -1, states.shape[2])
    return np.concatenate([flat, states[:, -1:]], axis=1)
