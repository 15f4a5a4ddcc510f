"""Simulating windows of a hypothesis: the one inner loop of the diagnosis."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from gpsim.channels import FloatArray, IntArray
from gpsim.diagnosis.windows import Windows
from gpsim.effects.chain import Chain
from gpsim.effects.effect import Values

Spread = Callable[[FloatArray, int], Sequence[Values]]
Extra = Callable[[FloatArray, FloatArray], FloatArray]
"""State (B, S) and action (B, A) at a transition's start -> (B, R) rates that are added throughout it."""
FAR = 1e6  # what a diverging simulation is clipped to


def simulate(
    chain: Chain,
    windows: Windows,
    starts: FloatArray,
    spread: Spread,
    thetas: FloatArray,
    substeps: int,
    extra: Extra | None = None,
) -> FloatArray:
    """(C, W, L + 1, S): what the sensors would say.

    starts: (C, W, S) true states at the windows' first samples; thetas: (C, P), spread over the windows as values of
    the terms by `spread(thetas, W)`; substeps: of each transition (1 where the scheme is the base simulator's).
    """
    copies, count = starts.shape[:2]
    n = 1 if chain.scheme != "fine" else substeps
    rows = np.tile(np.arange(count), copies)
    with np.errstate(all="ignore"):
        # What an actuator remembers does not depend on the start state: once for every distinct theta.
        distinct, inverse = np.unique(thetas, axis=0, return_inverse=True)
        every = np.tile(np.arange(count), len(distinct))
        memory = _pre_roll(chain, windows, every, spread(distinct, count), n)
        which = (inverse.reshape(-1)[:, None] * count + np.arange(count)).ravel()
        memory = {key: values[which] for key, values in memory.items()}
        out = _run(
            chain, windows, rows, starts.reshape(copies * count, -1), spread(thetas, count), n, memory, extra
        )
    return out.reshape(copies, count, windows.length + 1, -1)


def _pre_roll(
    chain: Chain, windows: Windows, rows: IntArray, values: Sequence[Values], n: int
) -> dict[str, FloatArray]:
    """The actuators' memory at the windows' starts, from the commands before them."""
    dt = np.diff(windows.before_t, axis=1)
    memory = chain.rest(len(rows), float(np.median(dt)) / n if dt.size else chain.dt / n)
    if not memory:
        return memory
    for k in range(windows.before_actions.shape[1]):
        action, state, step = windows.before_actions[rows, k], windows.before_states[rows, k], dt[rows, k] / n
        for j in range(n):
            chain.command(action, state, values, memory, step, windows.before_t[rows, k] + j * step)
    return memory


def _run(
    chain: Chain,
    windows: Windows,
    rows: IntArray,
    starts: FloatArray,
    values: Sequence[Values],
    n: int,
    memory: dict[str, FloatArray],
    extra: Extra | None,
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
        action, t = windows.actions[rows, k], windows.t[rows, k]
        step = (windows.t[rows, k + 1] - t) / n
        added = extra(state, action) if extra is not None else None
        for j in range(n):
            command = chain.command(action, state, values, memory, step, t + j * step)
            state = chain.advance(state, command, values, step, t + j * step, added)
            if watching:
                chain.watch(state, seen)
        state = np.clip(np.nan_to_num(state, nan=FAR), -FAR, FAR)
        out[:, k + 1] = chain.measure(state, values, seen, step)
    return out
