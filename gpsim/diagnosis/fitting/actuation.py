"""What reaches the simulator in the windows of a hypothesis: recorded commands, or what actuators make of them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from gpsim.channels import Channels, FloatArray, IntArray, difference
from gpsim.diagnosis.data import Windows
from gpsim.effects import IN_EPISODE, Chain, Values, own_values
from gpsim.kernels import Commands, Program, actuators_of, at_rest, travelled
from gpsim.simulators import Memory

Spread = Callable[[FloatArray, int], Sequence[Values]]
Drive = Callable[[int, int, FloatArray], FloatArray]
"""What reaches the simulator (B, A) at transition k, substep j, in state (B, S); called in the order of time.

Transitions before the window are -1, -2, ..., their commands are known whatever the state.
"""


@dataclass(frozen=True)
class Setting:
    """What follows from all windows and thetas together, and must not depend on which of them are simulated here.

    even: whether all clocks are; usual: s, a substep; slots: how many substeps back the sensors look; first: copies
    with commands of their own; which: (C,) the place in `first` of each copy's commands; shortest: s, a substep where
    an uneven clock is densest; leaps: whether whole control steps lead up to the windows.
    """

    n: int
    even: bool
    usual: float
    slots: int
    first: IntArray
    which: IntArray
    shortest: float = 0.0
    leaps: bool = False


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


def as_recorded(windows: Windows, rows: IntArray) -> Drive:
    """The commands of the windows in these rows (B,), which nothing changes."""
    by_time = np.ascontiguousarray(windows.actions.transpose(1, 0, 2)[:, rows])

    def drive(k: int, j: int, state: FloatArray) -> FloatArray:
        return np.asarray(by_time[k] if k >= 0 else windows.before_actions[rows, k])

    return drive


def precomputed(
    chain: Chain, windows: Windows, spread: Spread, thetas: FloatArray, setting: Setting
) -> Drive:
    """All commands at once: they do not depend on the simulated state, nor on parameters of other sites.

    Where they do depend on the state, those before the window are taken at the measured one, those in it step by step.
    """
    n = setting.n
    acted, memory, before = _acted(chain, windows, spread, thetas, setting)
    by_time = np.ascontiguousarray(acted.transpose(1, 0, 2))
    which = _which(setting, len(windows))
    if not chain.actuation.looks:
        return lambda k, j, state: by_time[before + n * k + j][which]
    held = {key: kept[which] for key, kept in memory.items()}
    every = values_of(chain, windows, spread, thetas)
    row = np.tile(np.arange(len(windows)), len(thetas))

    @lru_cache(maxsize=1)  # it is asked for n times in a row
    def transition(k: int) -> tuple[FloatArray, FloatArray, FloatArray]:
        begin = windows.t[row, k]
        return windows.actions[row, k], begin, (windows.t[row, k + 1] - begin) / n

    def drive(k: int, j: int, state: FloatArray) -> FloatArray:
        if k < 0:
            return np.asarray(by_time[before + n * k + j][which])
        action, begin, substep = transition(k)
        return chain.command(action, state, every, held, substep, begin + j * substep)

    return drive


def commands(
    program: Program,
    chain: Chain,
    windows: Windows,
    spread: Spread,
    thetas: FloatArray,
    setting: Setting,
    rows: IntArray,
    threads: int,
) -> Commands | None:
    """The same for compiled code; None where it cannot do what actuators do to commands that depend on the state."""
    if not chain.actuation:
        every = np.concatenate([windows.before_actions, windows.actions], axis=1)
        return Commands(every, rows, windows.before_actions.shape[1], finely=False)
    n, which, looks = setting.n, _which(setting, len(windows)), chain.actuation.looks
    step = n * setting.usual if setting.leaps else setting.usual
    resting = None if looks else at_rest(program, chain, step, even=setting.even)
    if resting is None:
        acted, memory, before = _acted(chain, windows, spread, thetas, setting)
        if not looks:
            return Commands(acted, which, before, finely=True)
        at = actuators_of(program, memory, len(acted), even=setting.even)
        if at is None:
            return None
        return Commands(acted, which, before, finely=True, given=windows.actions, at=at)
    own = np.tile(np.arange(len(windows)), len(setting.first))
    values = program.values(values_of(chain, windows, spread, thetas[setting.first]), len(own))
    if setting.leaps:
        led = windows.before_t, windows.before_actions
        acted = travelled(program, n, values, windows.t, own, windows.actions, None, resting, threads, led)
        return Commands(acted, which, 0, finely=True)
    clock = np.concatenate([windows.before_t, windows.t[:, 1:]], axis=1)
    given = np.concatenate([windows.before_actions, windows.actions], axis=1)
    acted = travelled(program, n, values, clock, own, given, None, resting, threads)
    return Commands(acted, which, n * windows.before_actions.shape[1], finely=True)


def _which(setting: Setting, count: int) -> IntArray:
    """(C W,) which of the windows' commands, of all copies that have some of their own, are a row's."""
    return np.asarray((setting.which[:, None] * count + np.arange(count)).ravel())


def _acted(
    chain: Chain,
    windows: Windows,
    spread: Spread,
    thetas: FloatArray,
    setting: Setting,
) -> tuple[FloatArray, Memory, int]:
    """(B, K, A) what reaches the simulator at every substep, memory after them, how many lie before the windows.

    Of the windows, too, unless what becomes of commands depends on the state.
    """
    count, n, first = len(windows), setting.n, setting.first
    rows, values = np.tile(np.arange(count), len(first)), values_of(chain, windows, spread, thetas[first])
    coarser = chain.actuation.looks and not setting.even
    memory = chain.actuation.rest(len(rows), setting.shortest if coarser else setting.usual)
    if setting.leaps:
        memory = _led_up_to(chain, windows, rows, values, setting)
        windows = windows.remembering(0)
    before = n * windows.before_actions.shape[1]
    end = before if chain.actuation.looks else None
    if end == 0:
        return np.empty((len(rows), 0, windows.actions.shape[2])), memory, 0
    actions = np.concatenate([windows.before_actions, windows.actions], axis=1)
    begins = np.concatenate([windows.before_t[:, :-1], windows.t[:, :-1]], axis=1)
    steps = np.diff(np.concatenate([windows.before_t, windows.t[:, 1:]], axis=1), axis=1) / n
    t = (begins[:, :, None] + steps[:, :, None] * np.arange(n)).reshape(count, -1)[:, :end]
    step = np.repeat(steps, n, axis=1)[:, :end]
    states = np.empty((count, step.shape[1] + 1, 0))  # nobody looks at them
    if chain.actuation.looks:
        states = _measured_between(windows, n, chain.simulator.state)[:, : step.shape[1] + 1]
    given = np.repeat(actions, n, axis=1)[:, :end]
    acted = chain.commands(given[rows], states[rows], values, memory, step[rows], t[rows])
    return acted, memory, before


def _led_up_to(
    chain: Chain, windows: Windows, rows: IntArray, values: Sequence[Values], setting: Setting
) -> Memory:
    """The actuators' memory at the windows' beginning, from whole control steps."""
    actions, t = windows.before_actions[rows], windows.before_t[rows]
    memory = chain.actuation.rest(len(rows), setting.usual * setting.n)
    states = np.empty((*t.shape, 0))  # nobody looks at them
    chain.commands(actions, states, values, memory, np.diff(t, axis=1), t[:, :-1])
    return chain.actuation.finer(memory, setting.n)


def _measured_between(windows: Windows, n: int, channels: Channels) -> FloatArray:
    """(W, K + 1, S) the measured states at all substeps, before and in the window: where gates of actuators look."""
    states = np.concatenate([windows.before_states, windows.measured], axis=1)
    share = np.arange(n)[:, None] / n
    between = states[:, :-1, None] + share * difference(states[:, 1:], states[:, :-1], channels)[:, :, None]
    flat = between.reshape(len(states), -1, states.shape[2])
    return np.concatenate([flat, states[:, -1:]], axis=1)
