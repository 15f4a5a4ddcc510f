"""Windows of a simulator that owns its integration: it is given whole stretches of commands and returns the states."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from gpsim.channels import FloatArray, IntArray
from gpsim.diagnosis.data import Windows
from gpsim.diagnosis.fitting.actuation import Drive, Setting
from gpsim.effects import Chain, ClosedStep, Values
from gpsim.simulators import Memory

Extra = Callable[[FloatArray, FloatArray, int], FloatArray]
"""State (B, S), recorded action (B, A) at the start of a window's transition k -> (B, R) rates added throughout it."""
FAR = 1e6  # what a diverging simulation is clipped to: far beyond any state, and its square is still a number
SEEN = 6  # moments of a transition, at the most, at which sensors that remember look: their curves are cubic


@dataclass(frozen=True)
class Pushes:
    """What is added to one of the `rates` in one transition of each row, `when` (B,); compiled code knows it.

    push: how much, throughout it. Rows of one window differ in nothing else.
    """

    when: IntArray
    rate: int
    rates: int
    push: float

    def __call__(self, state: FloatArray, action: FloatArray, k: int) -> FloatArray:
        """(B, R) in transition k."""
        added = np.zeros((len(state), self.rates))
        added[:, self.rate] = np.where(self.when == k, self.push, 0.0)
        return added


def tamed(state: FloatArray) -> FloatArray:
    """A state that may have diverged, within FAR. Nearly all are, and to see that is the cheap part."""
    if np.abs(state).max(initial=0.0) <= FAR:  # no, where one is not a number
        return state
    return np.clip(np.nan_to_num(state, nan=FAR), -FAR, FAR)


def looks_of(n: int) -> int:
    """Moments of a transition of n substeps at which sensors look: a divisor of n, n itself where that is few."""
    return n if n <= SEEN else max((m for m in range(2, SEEN + 1) if n % m == 0), default=n)


def roll(
    chain: Chain,
    windows: Windows,
    rows: IntArray,
    starts: FloatArray,
    values: Sequence[Values],
    setting: Setting,
    drive: Drive,
    extra: Extra | None,
) -> FloatArray:
    """(B, L + 1, S): what the sensors would say in the windows `rows`, from starts (B, S)."""
    system = chain.closed
    assert system is not None
    n, looks = setting.n, looks_of(setting.n) if chain.sensors.remember else 1
    if isinstance(extra, Pushes) and not (chain.sensors.remember or chain.actuation.looks):
        return _pushed(chain, windows, rows, starts, values, n, drive, extra)
    out = np.empty((len(rows), windows.length + 1, starts.shape[1]))
    clock = windows.t[rows]
    steps = np.diff(clock, axis=1) / n
    watching = chain.sensors.remember
    seen: Memory = {}
    every = n // looks
    if watching:
        history, past = _history(chain, windows, rows, starts, values, setting, drive)
        seen = chain.sensors.begin(history, values, every * steps[:, 0], past)
    out[:, 0] = chain.sensors.measure(starts, values, seen, every * steps[:, 0])
    whole = setting.even and extra is None and not chain.actuation.looks
    state = starts
    made = (
        _rolled(chain, system, state, values, drive, range(windows.length), n, steps[:, 0], clock[:, 0])
        if whole
        else None
    )
    for k in range(windows.length):
        step = steps[:, k]
        if made is None:
            added = extra(state, windows.actions[rows, k], k) if extra is not None else None
            path = _rolled(chain, system, state, values, drive, range(k, k + 1), n, step, clock[:, k], added)
        else:
            path = made[:, k * n : (k + 1) * n]
        for j in range(every - 1, n, every) if watching else ():
            chain.sensors.watch(path[:, j], values, seen, every * step)
        state = tamed(path[:, -1])
        out[:, k + 1] = chain.sensors.measure(state, values, seen, every * step)
    return out


def _pushed(
    chain: Chain,
    windows: Windows,
    rows: IntArray,
    starts: FloatArray,
    values: Sequence[Values],
    n: int,
    drive: Drive,
    pushes: Pushes,
) -> FloatArray:
    """`roll`, where a row is what the last pushed one of its window is until it is pushed itself."""
    system = chain.closed
    assert system is not None
    out, state = np.empty((len(rows), windows.length + 1, starts.shape[1])), np.array(starts)
    clock = windows.t[rows]
    steps = np.diff(clock, axis=1) / n
    last = np.zeros(len(windows), dtype=np.int64)
    latest = np.argsort(pushes.when, kind="stable")
    last[rows[latest]] = latest  # of several the last is written last
    like = last[rows]
    out[:, 0] = chain.sensors.measure(starts, values, {}, n * steps[:, 0])
    for k in range(windows.length):
        moves = (pushes.when <= k) | (like == np.arange(len(rows)))
        (going,) = np.nonzero(moves)
        own = [{name: value[going] for name, value in v.items()} for v in values]
        added = pushes(state, windows.actions[rows, k], k)[going]

        def commanded(k: int, j: int, _: FloatArray, going: IntArray = going) -> FloatArray:
            return drive(k, j, state)[going]

        stretch, step, t = range(k, k + 1), steps[going, k], clock[going, k]
        path = _rolled(chain, system, state[going], own, commanded, stretch, n, step, t, added)
        state[going] = tamed(path[:, -1])
        state[~moves] = state[like[~moves]]
        out[:, k + 1] = chain.sensors.measure(state, values, {}, n * steps[:, k])
    return out


def _rolled(
    chain: Chain,
    system: ClosedStep,
    state: FloatArray,
    values: Sequence[Values],
    drive: Drive,
    transitions: range,
    n: int,
    step: FloatArray,
    t: FloatArray,
    added: FloatArray | None = None,
) -> FloatArray:
    """(B, K n, S): the states after every substep of some transitions; what looks at states is asked in turn."""
    if not chain.actuation.looks:
        commands = np.stack([drive(k, j, state) for k in transitions for j in range(n)], axis=1)
        return tamed(chain.rolled(system, state, commands, values, step, t, added))
    path = []
    for k in transitions:
        for j in range(n):
            command = drive(k, j, state)[:, None]
            state = tamed(chain.rolled(system, state, command, values, step, t + j * step, added)[:, 0])
            path.append(state)
    return np.stack(path, axis=1)


def _history(
    chain: Chain,
    windows: Windows,
    rows: IntArray,
    starts: FloatArray,
    values: Sequence[Values],
    setting: Setting,
    drive: Drive,
) -> tuple[FloatArray, FloatArray | None]:
    """(B, K, S): the states before the windows when sensors look; an episode stood still before it began.

    And how long after the one before each of them is, (B, K) s, where the clock is uneven.
    """
    n, looks, system = setting.n, looks_of(setting.n), chain.closed
    assert system is not None
    every = n // looks
    own = every * (windows.t[rows, 1] - windows.t[rows, 0]) / n
    lengths = every * np.diff(windows.before_t, axis=1) / n
    still, state = windows.rested[rows, None], starts
    past, steps = [starts], []
    most = min(-(-setting.slots // every) + 2, looks * windows.before_actions.shape[1] + 1)
    for back in range(1, most):
        k, j = divmod(-back, looks)
        step, end = own, windows.t[rows, 0] - (back - 1) * own
        if not setting.even:
            step = lengths[rows, k]
            end = windows.before_t[rows, k] - (looks - 1 - j) * step
        command = np.mean([drive(k, j * every + i, state) for i in range(every)], axis=0)
        state = chain.rolled(system, state, command[:, None], values, -step, end)[:, 0]
        state = np.where(still, starts, tamed(state))
        past.append(state)
        steps.append(step)
    return np.stack(past[::-1], axis=1), None if setting.even else np.stack([*steps, own][::-1], axis=1)
