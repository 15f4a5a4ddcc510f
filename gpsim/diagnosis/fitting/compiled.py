"""Windows of a hypothesis simulated by compiled code, the same as `simulate` does by NumPy."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from gpsim.channels import FloatArray, IntArray
from gpsim.diagnosis.data import Windows
from gpsim.diagnosis.fitting.actuation import Setting, Spread, commands, values_of
from gpsim.effects import Chain, Values
from gpsim.kernels import Past, Program, marched


def simulated(
    program: Program,
    chain: Chain,
    windows: Windows,
    starts: FloatArray,
    spread: Spread,
    thetas: FloatArray,
    setting: Setting,
    threads: int,
) -> FloatArray:
    """(C, W, L + 1, S): what the sensors would say; starts: (C, W, S)."""
    copies, count = starts.shape[:2]
    rows, values = np.tile(np.arange(count), copies), values_of(chain, windows, spread, thetas)
    past = _past(chain, windows, setting)
    states, passed = marched(
        program,
        setting.n,
        starts.reshape(copies * count, -1),
        program.values(values, len(rows)),
        windows.t,
        rows,
        commands(chain, windows, spread, thetas, setting, rows),
        threads,
        past,
    )
    if chain.sensors:
        _measure(chain, windows, rows, values, setting, states, passed, past)
    return states.reshape(copies, count, windows.length + 1, -1)


def _past(chain: Chain, windows: Windows, setting: Setting) -> Past | None:
    """How far back sensors look."""
    if not chain.sensors.remember:
        return None
    depth = min(setting.slots, setting.n * windows.before_actions.shape[1] + 1)
    earlier = np.empty((len(windows), 0)) if setting.even else windows.before_t
    return Past(depth, earlier, windows.rested.astype(np.int64))


def _measure(
    chain: Chain,
    windows: Windows,
    rows: IntArray,
    values: Sequence[Values],
    setting: Setting,
    states: FloatArray,
    passed: FloatArray,
    past: Past | None,
) -> None:
    """Put what the sensors say in the place of the states (B, L + 1, S)."""
    n, steps = setting.n, np.diff(windows.t, axis=1) / setting.n
    when = None if past is None or setting.even else _when(windows, past.depth, n)
    for k in range(windows.length + 1):
        memory = {}
        if past is not None:
            seen = slice(k * n, k * n + past.depth)
            clock = None if when is None else when[:, seen][rows]
            memory = chain.sensors.having_seen(passed[:, seen], clock)
        step = steps[rows, max(k - 1, 0)]
        states[:, k] = chain.sensors.measure(states[:, k], values, memory, step)


def _when(windows: Windows, depth: int, n: int) -> FloatArray:
    """(W, depth + L n) s, when the states were that sensors see, the first one at 0."""
    clock = np.concatenate([windows.before_t, windows.t[:, 1:]], axis=1)
    steps = np.repeat(np.diff(clock, axis=1) / n, n, axis=1)[:, -(depth - 1 + windows.length * n) :]
    return np.concatenate([np.zeros((len(clock), 1)), np.cumsum(steps, axis=1)], axis=1)
