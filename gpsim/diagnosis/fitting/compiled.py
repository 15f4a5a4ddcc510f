"""Windows of a hypothesis simulated by compiled code, the same as `simulate` does by NumPy."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial

import numpy as np

from gpsim.channels import FloatArray, IntArray
from gpsim.diagnosis.data import Windows
from gpsim.diagnosis.fitting.actuation import Setting, Spread, commands, values_of
from gpsim.diagnosis.fitting.rollout import Pushes, tamed
from gpsim.effects import Chain, Values
from gpsim.kernels import Past, Program, Pushed, marched, read_late
from gpsim.simulators import Memory


def simulated(
    program: Program,
    chain: Chain,
    windows: Windows,
    starts: FloatArray,
    spread: Spread,
    thetas: FloatArray,
    setting: Setting,
    threads: int,
    bends: Memory,
    pushes: Pushes | None = None,
) -> FloatArray | None:
    """(C, W, L + 1, S): what the sensors would say, from starts (C, W, S); None where compiled code cannot.

    bends: of all rows, how far bristles are bent as their windows begin.
    """
    copies, count = starts.shape[:2]
    rows, values = np.tile(np.arange(count), copies), values_of(chain, windows, spread, thetas)
    with np.errstate(all="ignore"):
        known = commands(program, chain, windows, spread, thetas, setting, rows, threads)
        if known is None:
            return None
        past = _past(chain, windows, setting)
        begun, numbers = starts.reshape(copies * count, -1), program.values(values, len(rows))
        pushed = None if pushes is None else Pushed(pushes.when, pushes.rate, pushes.push)
        states, passed = marched(
            program, setting.n, begun, numbers, windows.t, rows, known, threads, past, pushed,
            program.bends(bends, len(rows)),
        )  # fmt: skip
        if chain.sensors:
            states = tamed(_read(chain, windows, rows, values, setting, states, passed, past))
    return states.reshape(copies, count, windows.length + 1, -1)


def _past(chain: Chain, windows: Windows, setting: Setting) -> Past | None:
    """How far back sensors look."""
    if not chain.sensors.remember:
        return None
    depth = min(setting.slots, setting.n * windows.before_actions.shape[1] + 1)
    earlier = np.empty((len(windows), 0)) if setting.even else windows.before_t
    return Past(depth, earlier, windows.rested.astype(np.int64))


def _read(
    chain: Chain,
    windows: Windows,
    rows: IntArray,
    values: Sequence[Values],
    setting: Setting,
    states: FloatArray,
    passed: FloatArray,
    past: Past | None,
) -> FloatArray:
    """(B, L + 1, S) what the sensors say of the states (B, L + 1, S), which change: first lags, then what is late."""
    steps = np.diff(windows.t, axis=1) / setting.n
    steps = np.concatenate([steps[:, :1], steps], axis=1)
    if past is not None:
        when = np.empty((len(windows), 0)) if setting.even else _when(windows, past.depth, setting.n)
        read = partial(read_late, passed, past, setting.n)
        for term, column in chain.sensors.lagging:
            read(column, values[term]["time_constant"], steps, when, rows, states, lags=True)
        for term, column in chain.sensors.late:
            read(column, values[term]["delay"], steps, when, rows, states)
    count, times, channels = states.shape
    others = {
        i: {name: np.repeat(value, times) for name, value in values[i].items()} for i in chain.sensors.rest
    }
    if not others:
        return states
    said = chain.sensors.rest_measure(states.reshape(-1, channels), others, steps[rows].ravel())
    return said.reshape(count, times, channels)


def _when(windows: Windows, depth: int, n: int) -> FloatArray:
    """(W, depth + L n) s, when the states were that sensors see, the first one at 0."""
    clock = np.concatenate([windows.before_t, windows.t[:, 1:]], axis=1)
    steps = np.repeat(np.diff(clock, axis=1) / n, n, axis=1)[:, -(depth - 1 + windows.length * n) :]
    return np.concatenate([np.zeros((len(clock), 1)), np.cumsum(steps, axis=1)], axis=1)
