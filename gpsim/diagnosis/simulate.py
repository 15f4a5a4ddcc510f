"""Simulating windows of a hypothesis: the one inner loop of the diagnosis."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from gpsim.channels import FloatArray, IntArray
from gpsim.diagnosis.windows import Windows
from gpsim.effects.chain import Chain
from gpsim.effects.effect import Values

Spread = Callable[[FloatArray, int], Sequence[Values]]
Drive = Callable[[int, int, FloatArray], FloatArray]
"""What reaches the simulator (B, A) at transition k, substep j, in state (B, S)."""
FAR = 1e6  # what a diverging simulation is clipped to


def simulate(
    chain: Chain, windows: Windows, starts: FloatArray, spread: Spread, thetas: FloatArray, substeps: int
) -> FloatArray:
    """(C, W, L + 1, S): what the sensors would say.

    starts: (C, W, S) true states at the windows' first samples; thetas: (C, P), spread over the windows as values of
    the terms by `spread(thetas, W)`; substeps: of each transition (1 where the scheme is the base simulator's).
    """
    copies, count = starts.shape[:2]
    n = 1 if chain.scheme != "fine" else substeps
    rows, values = np.tile(np.arange(count), copies), spread(thetas, count)
    with np.errstate(all="ignore"):
        if not chain.actuates:
            drive = _as_recorded(windows, rows)
        elif chain.open_loop:
            drive = _precomputed(chain, windows, spread, thetas, n)
        else:
            drive = _stepped(chain, windows, rows, values, n)
        out = _run(chain, windows, rows, starts.reshape(copies * count, -1), values, n, drive)
    return out.reshape(copies, count, windows.length + 1, -1)


def _as_recorded(windows: Windows, rows: IntArray) -> Drive:
    held = [windows.actions[rows, k] for k in range(windows.length)]
    return lambda k, j, state: held[k]


def _precomputed(chain: Chain, windows: Windows, spread: Spread, thetas: FloatArray, n: int) -> Drive:
    """All commands at once: they do not depend on the state, nor on parameters of other sites."""
    count = len(windows)
    single = [np.stack(list(v.values()), axis=1) for i, v in enumerate(spread(thetas, 1)) if chain.acts(i)]
    _, first, inverse = np.unique(np.hstack(single), axis=0, return_index=True, return_inverse=True)
    values = spread(thetas[first], count)
    rows = np.tile(np.arange(count), len(first))
    actions = np.concatenate([windows.before_actions, windows.actions], axis=1)
    begins = np.concatenate([windows.before_t[:, :-1], windows.t[:, :-1]], axis=1)
    steps = np.diff(np.concatenate([windows.before_t, windows.t[:, 1:]], axis=1), axis=1) / n
    t = (begins[:, :, None] + steps[:, :, None] * np.arange(n)).reshape(count, -1)
    memory = chain.rest(len(rows), float(np.median(steps)))
    step = np.repeat(steps, n, axis=1)
    states = windows.measured[rows, 0]
    acted = chain.commands(np.repeat(actions, n, axis=1)[rows], states, values, memory, step[rows], t[rows])
    before = n * windows.before_actions.shape[1]
    by_time = np.ascontiguousarray(acted[:, before:].transpose(1, 0, 2))
    which = (inverse.reshape(-1)[:, None] * count + np.arange(count)).ravel()
    return lambda k, j, state: by_time[n * k + j][which]


def _stepped(chain: Chain, windows: Windows, rows: IntArray, values: Sequence[Values], n: int) -> Drive:
    """Commands that depend on the state, one substep at a time; before the window, on the measured one."""
    before = np.diff(windows.before_t, axis=1)
    memory = chain.rest(len(rows), float(np.median(before)) / n)

    def drive(actions: FloatArray, state: FloatArray, step: FloatArray, t: FloatArray) -> FloatArray:
        return chain.commands(actions[:, None], state, values, memory, step[:, None], t[:, None])[:, 0]

    for k in range(before.shape[1] if memory else 0):
        step = before[rows, k] / n
        for j in range(n):
            t = windows.before_t[rows, k] + j * step
            drive(windows.before_actions[rows, k], windows.before_states[rows, k], step, t)

    def at(k: int, j: int, state: FloatArray) -> FloatArray:
        step = (windows.t[rows, k + 1] - windows.t[rows, k]) / n
        return drive(windows.actions[rows, k], state, step, windows.t[rows, k] + j * step)

    return at


def _run(
    chain: Chain,
    windows: Windows,
    rows: IntArray,
    starts: FloatArray,
    values: Sequence[Values],
    n: int,
    drive: Drive,
) -> FloatArray:
    out = np.empty((len(rows), windows.length + 1, starts.shape[1]))
    state, step = starts, (windows.t[rows, 1] - windows.t[rows, 0]) / n
    watching = chain.watches
    seen = {}
    if watching:
        slope = chain.slope(state, windows.before_actions[rows, -1], values, windows.t[rows, 0])
        seen = chain.watchers(state, slope, step)
    out[:, 0] = chain.measure(state, values, seen, step)
    for k in range(windows.length):
        t = windows.t[rows, k]
        step = (windows.t[rows, k + 1] - t) / n
        for j in range(n):
            state = chain.advance(state, drive(k, j, state), values, step, t + j * step)
            if watching:
                chain.watch(state, seen)
        state = np.clip(np.nan_to_num(state, nan=FAR), -FAR, FAR)
        out[:, k + 1] = chain.measure(state, values, seen, step)
    return out
