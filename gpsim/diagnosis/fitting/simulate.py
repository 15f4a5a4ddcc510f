"""Simulating windows of a hypothesis: the one inner loop of the diagnosis."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from gpsim.channels import FloatArray, IntArray
from gpsim.diagnosis.data import Windows
from gpsim.diagnosis.fitting.actuation import Drive, Setting, Spread, as_recorded, precomputed, values_of
from gpsim.diagnosis.fitting.bent import bends_of
from gpsim.diagnosis.fitting.compiled import simulated
from gpsim.diagnosis.fitting.rollout import FAR, Extra, Pushes, roll, tamed
from gpsim.diagnosis.fitting.twisted import twists_of
from gpsim.diagnosis.run import Run
from gpsim.effects import Chain, Values
from gpsim.kernels import can_compile, program_of
from gpsim.simulators import Memory

UNEVEN_FINER = 4.0
"""Times as many substeps as usual that an uneven clock may have where a delay is simulated."""


def simulate(
    run: Run,
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
    if not len(windows):
        return np.empty((len(thetas), 0, windows.length + 1, starts.shape[2]))
    starts = tamed(starts)  # a step may have sent one anywhere
    bends = _bends(chain, windows, starts, spread, thetas)
    setting, windows = _set(chain, windows, spread, thetas, n)
    known = extra is None or isinstance(extra, Pushes)
    program = program_of(chain) if known and run.settings.windows.compiled and can_compile() else None
    if program is not None:
        pushes = extra if isinstance(extra, Pushes) else None
        said = simulated(program, chain, windows, starts, spread, thetas, setting, run.threads, bends, pushes)
        if said is not None:
            return said
    return _simulated(chain, windows, starts, spread, thetas, setting, extra, bends)


def _simulated(
    chain: Chain,
    windows: Windows,
    starts: FloatArray,
    spread: Spread,
    thetas: FloatArray,
    setting: Setting,
    extra: Extra | None = None,
    bends: Memory | None = None,
) -> FloatArray:
    copies, count = starts.shape[:2]
    rows, values = np.tile(np.arange(count), copies), values_of(chain, windows, spread, thetas)
    with np.errstate(all="ignore"):
        drive = (
            precomputed(chain, windows, spread, thetas, setting)
            if chain.actuation
            else as_recorded(windows, rows)
        )
        begun = starts.reshape(copies * count, -1)
        if chain.closed is not None:
            out = roll(chain, windows, rows, begun, values, setting, drive, extra)
        else:
            out = _run(chain, windows, rows, begun, values, setting, drive, extra, bends or {})
    return out.reshape(copies, count, windows.length + 1, -1)


def _bends(chain: Chain, windows: Windows, starts: FloatArray, spread: Spread, thetas: FloatArray) -> Memory:
    """How far bristles are bent and elastic drives twisted as the windows begin, of all copies."""
    if not chain.yields:
        return {}
    copies, count = starts.shape[:2]
    rows, values = np.tile(np.arange(count), copies), values_of(chain, windows, spread, thetas)
    with np.errstate(all="ignore"):
        bends = bends_of(chain, windows, rows, starts.reshape(copies * count, -1), values)
        return bends | twists_of(chain, windows, rows, values)


def _set(
    chain: Chain, windows: Windows, spread: Spread, thetas: FloatArray, n: int
) -> tuple[Setting, Windows]:
    """The setting, and the windows with as much of what was commanded before them as matters."""
    first, which = np.zeros(1, dtype=np.int64), np.zeros(len(thetas), dtype=np.int64)
    if not (chain.actuation or chain.sensors.remember):
        return Setting(n, windows.even, 0.0, 0, first, which), windows.remembering(0)
    values, even = values_of(chain, windows, spread, thetas), windows.even
    slots = _slots(chain, windows, values, n) if chain.sensors.remember else 0
    windows = _what_matters(chain, windows, values, slots / n)
    if chain.actuation:  # parameters of other sites do not change what becomes of a command
        single = [
            np.stack(list(v.values()), axis=1)
            for i, v in enumerate(spread(thetas, 1))
            if chain.actuation.acts(i)
        ]
        if len(thetas) > 1:
            _, first, which = np.unique(np.hstack(single), axis=0, return_index=True, return_inverse=True)
    steps = np.diff(np.concatenate([windows.before_t, windows.t[:, 1:]], axis=1), axis=1) / n
    leaps = (
        even and chain.actuation.leaps and not chain.sensors.remember
    )  # sensors look at the substeps before a window
    usual = float(np.median(steps))
    shortest = usual / UNEVEN_FINER
    return Setting(n, even, usual, slots, first, which.reshape(-1), shortest, leaps), windows


def _what_matters(chain: Chain, windows: Windows, values: Sequence[Values], sensors: float) -> Windows:
    """The windows with as much of what was commanded before them as actuators and `sensors` [samples] remember."""
    shortest = float(np.diff(windows.before_t, axis=1).min(initial=np.inf))
    commands = chain.actuation.remembers(values) / max(shortest, 1e-12)
    if not np.isfinite(commands):
        return windows
    return windows.remembering(int(np.ceil(min(commands + sensors, FAR))) + 2)


def _run(
    chain: Chain,
    windows: Windows,
    rows: IntArray,
    starts: FloatArray,
    values: Sequence[Values],
    setting: Setting,
    drive: Drive,
    extra: Extra | None,
    bends: Memory,
) -> FloatArray:
    n = setting.n
    out = np.empty((len(rows), windows.length + 1, starts.shape[1]))
    clock = np.ascontiguousarray(windows.t.T[:, rows])
    state, step = starts, (clock[1] - clock[0]) / n
    watching = chain.sensors.remember
    seen = {}
    if watching:
        history, steps = _history(chain, windows, rows, starts, values, setting, drive, bends)
        seen = chain.sensors.begin(history, values, step, steps)
    out[:, 0] = chain.sensors.measure(state, values, seen, step)
    for k in range(windows.length):
        t = clock[k]
        step = (clock[k + 1] - t) / n
        added = extra(state, windows.actions[rows, k], k) if extra is not None else None
        for j in range(n):
            state = chain.advance(state, drive(k, j, state), values, step, t + j * step, added, bends)
            if watching:
                chain.sensors.watch(state, values, seen, step)
        state = tamed(state)
        out[:, k + 1] = chain.sensors.measure(state, values, seen, step)
    return tamed(out) if watching else out  # a late sensor sees states of before they were tamed


def _history(
    chain: Chain,
    windows: Windows,
    rows: IntArray,
    starts: FloatArray,
    values: Sequence[Values],
    setting: Setting,
    drive: Drive,
    bends: Memory,
) -> tuple[FloatArray, FloatArray | None]:
    """(B, K, S): the states before the windows, integrated backwards; an episode stood still before it began.

    And how long after the one before each of them is, (B, K) s, where the clock is uneven.
    """
    n, regular = setting.n, setting.even
    own = (windows.t[rows, 1] - windows.t[rows, 0]) / n
    lengths = np.diff(windows.before_t, axis=1) / n
    still, state = windows.rested[rows, None], starts
    past, steps = [starts], []
    for back in range(1, min(setting.slots, n * windows.before_actions.shape[1] + 1)):
        k, j = divmod(-back, n)
        step, end = own, windows.t[rows, 0] - (back - 1) * own
        if not regular:
            step = lengths[rows, k]
            end = windows.before_t[rows, k] - (n - 1 - j) * step
        state = chain.advance(state, drive(k, j, state), values, -step, end, None, bends)
        state = np.where(still, starts, tamed(state))
        past.append(state)
        steps.append(step)
    return np.stack(past[::-1], axis=1), None if regular else np.stack([*steps, own][::-1], axis=1)


def _slots(chain: Chain, windows: Windows, values: Sequence[Values], n: int) -> int:
    """How many substeps back the sensors look, on an uneven clock from wherever that is furthest."""
    if windows.even:
        return chain.sensors.reach(values, (windows.t[:, 1] - windows.t[:, 0]) / n)
    return n * windows.samples_within(chain.sensors.looks_back(values)) + 3
