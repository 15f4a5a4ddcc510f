"""Simulating windows of a hypothesis: the one inner loop of the diagnosis."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from gpsim.channels import Channels, FloatArray, IntArray, difference
from gpsim.diagnosis.effort import spend, spend_on_commands
from gpsim.diagnosis.windows import Windows
from gpsim.effects.chain import Chain
from gpsim.effects.effect import Values
from gpsim.effects.elapsed import even, last_at_most

Spread = Callable[[FloatArray, int], Sequence[Values]]
Drive = Callable[[int, int, FloatArray], FloatArray]
"""What reaches the simulator (B, A) at transition k, substep j, in state (B, S); called in the order of time.

Transitions before the window are -1, -2, ..., their commands are known whatever the state.
"""
Extra = Callable[[FloatArray, FloatArray], FloatArray]
"""State (B, S) and recorded action (B, A) at a transition's start -> (B, R) rates that are added throughout it."""
FAR = 1e6  # what a diverging simulation is clipped to
DENSER = 4  # times as many substeps as usual may an uneven clock have where a delay is simulated step by step


def simulate(
    chain: Chain,
    windows: Windows,
    starts: FloatArray,
    spread: Spread,
    thetas: FloatArray,
    n: int,
    extra: Extra | None = None,
) -> FloatArray:
    """(C, W, L + 1, S): what the sensors would say.

    starts: (C, W, S) true states at the windows' first samples; thetas: (C, P), spread over the windows as values of
    the terms by `spread(thetas, W)`; n: steps of each transition.
    """
    copies, count = starts.shape[:2]
    starts = _tamed(starts)  # a step may have sent one anywhere
    rows, values = np.tile(np.arange(count), copies), spread(thetas, count)
    spend(len(rows), windows.length * n, dry=chain.dry)
    with np.errstate(all="ignore"):
        drive = (
            _precomputed(chain, windows, spread, thetas, n) if chain.actuates else _as_recorded(windows, rows)
        )
        out = _run(chain, windows, rows, starts.reshape(copies * count, -1), values, n, drive, extra)
    return out.reshape(copies, count, windows.length + 1, -1)


def _as_recorded(windows: Windows, rows: IntArray) -> Drive:
    by_time = np.ascontiguousarray(windows.actions.transpose(1, 0, 2)[:, rows])

    def drive(k: int, j: int, state: FloatArray) -> FloatArray:
        return np.asarray(by_time[k] if k >= 0 else windows.before_actions[rows, k])

    return drive


def _precomputed(chain: Chain, windows: Windows, spread: Spread, thetas: FloatArray, n: int) -> Drive:
    """All commands at once: they do not depend on the simulated state, nor on parameters of other sites.

    Where they do depend on the state, those before the window are taken at the measured one, those in it step by step.
    """
    count = len(windows)
    single = [np.stack(list(v.values()), axis=1) for i, v in enumerate(spread(thetas, 1)) if chain.acts(i)]
    _, first, inverse = np.unique(np.hstack(single), axis=0, return_index=True, return_inverse=True)
    values = spread(thetas[first], count)
    rows = np.tile(np.arange(count), len(first))
    windows = _what_matters(chain, windows, values, spread(thetas, count), n)
    before = n * windows.before_actions.shape[1]
    end = before if chain.looks else None
    actions = np.concatenate([windows.before_actions, windows.actions], axis=1)
    begins = np.concatenate([windows.before_t[:, :-1], windows.t[:, :-1]], axis=1)
    steps = np.diff(np.concatenate([windows.before_t, windows.t[:, 1:]], axis=1), axis=1) / n
    t = (begins[:, :, None] + steps[:, :, None] * np.arange(n)).reshape(count, -1)[:, :end]
    spend_on_commands(len(rows), n * actions.shape[1], chain.actuators)
    usual = float(np.median(steps))
    memory = chain.rest(len(rows), usual / DENSER if chain.looks and not _even(windows) else usual)
    step = np.repeat(steps, n, axis=1)[:, :end]
    states = np.empty((count, step.shape[1] + 1, 0))  # nobody looks at them
    if chain.looks:
        states = _measured_between(windows, n, chain.simulator.state)[:, : step.shape[1] + 1]
    acted = chain.commands(
        np.repeat(actions, n, axis=1)[:, :end][rows], states[rows], values, memory, step[rows], t[rows]
    )
    by_time = np.ascontiguousarray(acted.transpose(1, 0, 2))
    which = (inverse.reshape(-1)[:, None] * count + np.arange(count)).ravel()
    if not chain.looks:
        return lambda k, j, state: by_time[before + n * k + j][which]
    held, every = {key: kept[which] for key, kept in memory.items()}, spread(thetas, count)
    row = np.tile(np.arange(count), len(thetas))

    def drive(k: int, j: int, state: FloatArray) -> FloatArray:
        if k < 0:
            return np.asarray(by_time[before + n * k + j][which])
        spend_on_commands(len(row), 1, chain.actuators)
        begin = windows.t[row, k]
        substep = (windows.t[row, k + 1] - begin) / n
        return chain.command(windows.actions[row, k], state, every, held, substep, begin + j * substep)

    return drive


def _what_matters(
    chain: Chain, windows: Windows, values: Sequence[Values], every: Sequence[Values], n: int
) -> Windows:
    """The windows with as much of what was commanded before them as actuators and sensors remember."""
    shortest = float(np.diff(windows.before_t, axis=1).min(initial=np.inf))
    commands = chain.remembers(values) / max(shortest, 1e-12)
    if not np.isfinite(commands):
        return windows
    sensors = _slots(chain, windows, every, n) / n
    return windows.remembering(int(np.ceil(min(commands + sensors, FAR))) + 2)


def _measured_between(windows: Windows, n: int, channels: Channels) -> FloatArray:
    """(W, K + 1, S) the measured states at all substeps, before and in the window: where gates of actuators look."""
    states = np.concatenate([windows.before_states, windows.measured], axis=1)
    share = np.arange(n)[:, None] / n
    between = states[:, :-1, None] + share * difference(states[:, 1:], states[:, :-1], channels)[:, :, None]
    flat = between.reshape(len(states), -1, states.shape[2])
    return np.concatenate([flat, states[:, -1:]], axis=1)


def _run(
    chain: Chain,
    windows: Windows,
    rows: IntArray,
    starts: FloatArray,
    values: Sequence[Values],
    n: int,
    drive: Drive,
    extra: Extra | None,
) -> FloatArray:
    out = np.empty((len(rows), windows.length + 1, starts.shape[1]))
    clock = np.ascontiguousarray(windows.t.T[:, rows])
    state, step = starts, (clock[1] - clock[0]) / n
    watching = chain.watches
    seen = {}
    if watching:
        seen = chain.watchers(*_history(chain, windows, rows, starts, values, n, drive))
    out[:, 0] = chain.measure(state, values, seen, step)
    for k in range(windows.length):
        t = clock[k]
        step = (clock[k + 1] - t) / n
        added = extra(state, windows.actions[rows, k]) if extra is not None else None
        for j in range(n):
            state = chain.advance(state, drive(k, j, state), values, step, t + j * step, added)
            if watching:
                chain.watch(state, seen, step)
        state = _tamed(state)
        out[:, k + 1] = chain.measure(state, values, seen, step)
    return out


def _history(
    chain: Chain,
    windows: Windows,
    rows: IntArray,
    starts: FloatArray,
    values: Sequence[Values],
    n: int,
    drive: Drive,
) -> tuple[FloatArray, FloatArray | None]:
    """(B, K, S): the states before the windows, integrated backwards; an episode stood still before it began.

    And how long after the one before each of them is, (B, K) s, where the clock is uneven.
    """
    own = (windows.t[rows, 1] - windows.t[rows, 0]) / n
    regular = _even(windows)
    lengths = np.diff(windows.before_t, axis=1) / n
    still, state = windows.rested[rows, None], starts
    past, steps = [starts], []
    for back in range(1, min(_slots(chain, windows, values, n), n * windows.before_actions.shape[1] + 1)):
        k, j = divmod(-back, n)
        step, end = own, windows.t[rows, 0] - (back - 1) * own
        if not regular:
            step = lengths[rows, k]
            end = windows.before_t[rows, k] - (n - 1 - j) * step
        state = chain.advance(state, drive(k, j, state), values, -step, end)
        state = np.where(still, starts, _tamed(state))
        past.append(state)
        steps.append(step)
    return np.stack(past[::-1], axis=1), None if regular else np.stack([*steps, own][::-1], axis=1)


def _slots(chain: Chain, windows: Windows, values: Sequence[Values], n: int) -> int:
    """How many substeps back the sensors look, on an uneven clock from wherever that is furthest."""
    if _even(windows):
        return chain.reach(values, (windows.t[:, 1] - windows.t[:, 0]) / n)
    clock = np.concatenate([windows.before_t, windows.t[:, 1:]], axis=1)
    rows, samples = np.arange(len(clock))[:, None], np.arange(clock.shape[1])
    first = last_at_most(lambda at: clock[rows, at], len(samples), clock - chain.looks_back(values))
    return n * int((samples - first)[:, windows.before_t.shape[1] - 1 :].max(initial=0)) + 3


def _even(windows: Windows) -> bool:
    """Whether every step in the windows and before them is as long as the others."""
    steps = np.diff(windows.t, axis=1)
    return even(steps, steps[:, 0]) and even(np.diff(windows.before_t, axis=1), steps[:, 0])


def _tamed(state: FloatArray) -> FloatArray:
    """A state that may have diverged, within FAR. Nearly all are, and to see that is the cheap part."""
    if np.abs(state).max(initial=0.0) <= FAR:  # no, where one is not a number
        return state
    return np.clip(np.nan_to_num(state, nan=FAR), -FAR, FAR)
