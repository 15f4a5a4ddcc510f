"""Simulating windows of a hypothesis, by compiled code or the same by NumPy: the one inner loop of the diagnosis.

How far bristles are bent and elastic drives twisted as windows begin follows from what was before. Bristles go with
the positions that were read. A twist swings by itself and may hardly fade, so what it was long ago matters. It is what
fits the speeds that were read best: they are linear in it, like the twist as the window begins.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from functools import partial

import numpy as np

from gpsim.channels import FloatArray, IntArray
from gpsim.diagnosis.data import Windows
from gpsim.diagnosis.fitting.batch import FAR, Batch, Drive, Spread, batch_of, commands, drive_of, values_of
from gpsim.diagnosis.run import Run
from gpsim.effects import Chain, Values, bend_key, bent, twisted
from gpsim.kernels import Past, Program, can_compile, marched, program_of, read_late
from gpsim.simulators import Memory

BACK = 60  # transitions that are looked at: what was before is forgotten, or the body stood still
RIDGE = 1e-9  # of the squares of what a twist does to speeds: one that has faded cannot be told, and does not matter


def strains(
    chain: Chain, windows: Windows, rows: IntArray, starts: FloatArray, values: Sequence[Values]
) -> Memory:
    """Of rows (B,) of windows that start at (B, S), by term; where nothing had moved nothing is bent or twisted."""
    led = {} if chain.closed is None else chain.closed.rest(len(rows))
    if led:
        rested = windows.rested[rows][:, None]
        led = {k: np.where(rested, led[k], v) for k, v in _led(chain, windows, rows, values).items()}
    if not chain.yields:
        return led
    windows = windows.remembering(BACK)
    out = _bends(chain, windows, rows, starts, values) if chain.bristles else {}
    out |= _twists(chain, windows, rows, values) if chain.elastic else {}
    for strain in out.values():
        strain[windows.rested[rows]] = 0.0
    return out | led


def _led(chain: Chain, windows: Windows, rows: IntArray, values: Sequence[Values]) -> Memory:
    """What the simulator's own actuators remember, of commands as they arrived."""
    assert chain.closed is not None
    clock, before = windows.before_t[rows], windows.before_states[rows]
    steps = np.maximum(np.diff(clock, axis=1), 1e-9)
    actions = _acted(chain, windows.before_actions[rows], steps, clock[:, :-1], values)
    first = before[:, 0] if windows.first is None else windows.first[rows]
    none = np.zeros((len(rows), actions.shape[2]))
    commanded = none if windows.commanded is None else windows.commanded[rows]
    return chain.closed.led(first, before, actions, steps, commanded)


def _bends(
    chain: Chain, windows: Windows, rows: IntArray, starts: FloatArray, values: Sequence[Values]
) -> Memory:
    """(B,) by term. What is between two samples is taken for even motion; the last one is the start."""
    out: Memory = {}
    time = np.maximum(np.diff(windows.before_t, axis=1), 1e-9)[rows]
    for index, coordinate in chain.bristles:
        column = chain.simulator.state.index(chain.simulator.coordinates[coordinate].name)
        read = windows.before_states[rows, :, column]
        way, bend = np.diff(np.column_stack([read, starts[:, column]]), axis=1), np.zeros(len(rows))
        for k in range(way.shape[1]):
            bend, _ = bent(bend, way[:, k], way[:, k] / time[:, k], values[index])
        out[bend_key(index)] = bend
    return out


def _twists(chain: Chain, windows: Windows, rows: IntArray, values: Sequence[Values]) -> Memory:
    """(B, 2) by term.

    What else accelerates a load is found at the states that were read; dry friction is taken for even over the stretch.
    """
    states = np.concatenate([windows.before_states, windows.measured[:, :1]], axis=1)[rows]
    clock = windows.before_t[rows]
    steps = np.maximum(np.diff(clock, axis=1), 1e-9)
    actions = _acted(chain, windows.before_actions[rows], steps, clock[:, :-1], values)
    out: Memory = {}
    for i, column, speed, rate in chain.elastic:
        own, reacts, given = _loose(chain, states, actions, steps, clock, values, (column, rate))
        (count, times), term = steps.shape, values[i]
        # What commands do to a drive that was not twisted, and what a twist and its rate do by themselves.
        paths = [np.tile(first, (count, 1)) for first in ([0.0, 0.0], [1.0, 0.0], [0.0, 1.0])]
        speeds = np.zeros((count, times + 1, 3))
        for k in range(times):
            push = given[:, k] / term["inertia"] - own[:, k]
            for j, path in enumerate(paths):
                driven = push if j == 0 else np.zeros_like(push)
                paths[j], mean = twisted(path, driven, reacts[:, k], steps[:, k], term)
                gains = reacts[:, k] * mean + (own[:, k] if j == 0 else 0.0)
                speeds[:, k + 1, j] = speeds[:, k, j] + steps[:, k] * gains
        since = (clock - clock[:, :1]) / np.maximum(clock[:, -1:] - clock[:, :1], 1e-9)
        causes = np.stack([np.ones_like(since), since, speeds[:, :, 1], speeds[:, :, 2]], axis=2)
        first = _fitted(causes, states[:, :, speed] - speeds[:, :, 0])
        twist = paths[0] + first[:, 2:3] * paths[1] + first[:, 3:4] * paths[2]
        out[bend_key(i)] = np.nan_to_num(twist, posinf=0.0, neginf=0.0)
    return out


def _loose(
    chain: Chain,
    states: FloatArray,
    actions: FloatArray,
    steps: FloatArray,
    clock: FloatArray,
    values: Sequence[Values],
    of: tuple[int, int],
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """(B, K) each: how a load is accelerated without its drive, what a unit of that adds, and what the drive is given.

    of: the columns of its command and its rate.
    """
    flat = [{name: np.repeat(v, steps.shape[1]) for name, v in own.items()} for own in values]
    every = (states[:, :-1], actions, steps[:, :, None], clock[:, :-1, None])
    state, action, step, t = (a.reshape(steps.size, -1) for a in every)
    at = chain.instant(state, action, flat, step[:, 0], t[:, 0])
    found = (*chain.loose(at, flat, *of), at.action[:, of[0]])
    own, reacts, given = (a.reshape(steps.shape) for a in found)
    return own, reacts, given


def _acted(
    chain: Chain, given: FloatArray, steps: FloatArray, t: FloatArray, values: Sequence[Values]
) -> FloatArray:
    """(B, K, A) what has become of commands by whole control steps; as given where that depends on the state."""
    if not chain.actuation or chain.actuation.looks:
        return given
    memory = chain.actuation.rest(len(given), float(np.median(steps)))
    nowhere = np.empty((len(given), given.shape[1] + 1, 0))  # nobody looks at states
    return chain.commands(given, nowhere, values, memory, steps, t)


def _fitted(causes: FloatArray, speeds: FloatArray) -> FloatArray:
    """(B, C) least squares of speeds (B, K) on causes (B, K, C), which differ in size."""
    size = np.maximum(np.sqrt(np.square(causes).sum(axis=1)), 1e-300)
    scaled = causes / size[:, None]
    square = scaled.transpose(0, 2, 1) @ scaled + RIDGE * np.eye(causes.shape[2])
    known = np.isfinite(square).all(axis=(1, 2)) & np.isfinite(speeds).all(axis=1)
    out = np.zeros((len(causes), causes.shape[2]))
    right = (scaled.transpose(0, 2, 1) @ speeds[:, :, None])[known]
    out[known] = np.linalg.solve(square[known], right)[:, :, 0] / size[known]
    return out


NEARLY_EVEN = (
    1.0  # transitions that a window's clock is off a line, up to which whole windows are simulated at once
)

Extra = Callable[[FloatArray, FloatArray, int], FloatArray]
"""State (B, S), recorded action (B, A) at the start of a window's transition k -> (B, R) rates added throughout it."""


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
    copies, count, channels = starts.shape
    if not count:
        return np.empty((copies, 0, windows.length + 1, channels))
    begun = clip_diverged(starts).reshape(copies * count, channels)  # a step may have sent one anywhere
    values, said = values_of(chain, windows, spread, thetas), None
    with np.errstate(all="ignore"):
        strained = strains(chain, windows, np.tile(np.arange(count), copies), begun, values)
        batch = batch_of(chain, windows, values, spread, thetas, n)
        if extra is None and run.settings.windows.compiled and can_compile():
            program = program_of(chain)
            if program is not None:
                said = by_compiled_code(program, batch, begun, strained, run.threads)
        if said is None:
            said = by_numpy(batch, begun, strained, extra)
    return said.reshape(copies, count, windows.length + 1, channels)


def clip_diverged(state: FloatArray) -> FloatArray:
    """A state that may have diverged, within FAR. Nearly all are, and to see that is the cheap part."""
    if np.abs(state).max(initial=0.0) <= FAR:  # no, where one is not a number
        return state
    return np.clip(np.nan_to_num(state, nan=FAR), -FAR, FAR)


def by_numpy(batch: Batch, starts: FloatArray, strained: Memory, extra: Extra | None) -> FloatArray:
    """(B, L + 1, S): what the sensors would say, from starts (B, S)."""
    sensors, windows, values = batch.chain.sensors, batch.windows, batch.values
    n, every = batch.n, batch.n // batch.moments
    drive, steps = drive_of(batch), every * (np.diff(windows.t[batch.rows], axis=1) / n)
    seen: Memory = {}
    if sensors.remember:
        history, past = _history(batch, starts, drive, strained)
        seen = sensors.begin(history, values, steps[:, 0], past)
    out = np.empty((len(starts), windows.length + 1, starts.shape[1]))
    out[:, 0] = sensors.measure(starts, values, seen, steps[:, 0])
    for at, state in enumerate(_passed(batch, starts, drive, strained, extra)):
        k, j = divmod(at, n)
        if sensors.remember and (j + 1) % every == 0:
            sensors.watch(state, values, seen, steps[:, k])
        if j == n - 1:
            out[:, k + 1] = sensors.measure(state, values, seen, steps[:, k])
    # A late sensor sees states between those that were clipped.
    return clip_diverged(out) if sensors.remember else out


def _passed(
    batch: Batch, starts: FloatArray, drive: Drive, strained: Memory, extra: Extra | None
) -> Iterator[FloatArray]:
    """The states (B, S) at the ends of all substeps, one after another.

    Who owns the integration is asked for a whole transition, or for all of a window, where commands are known before.
    """
    chain, windows, values, n = batch.chain, batch.windows, batch.values, batch.n
    clock, state = np.ascontiguousarray(windows.t.T[:, batch.rows]), starts
    owner = None if chain.actuation.looks else chain.closed
    straight, off = straightened(windows)
    at_once = (
        windows.length if owner is not None and extra is None and np.abs(off).max() <= NEARLY_EVEN else 1
    )
    for k in range(0, windows.length, at_once):
        t, step = clock[k], (clock[k + 1] - clock[k] if at_once == 1 else straight[batch.rows]) / n
        added = None if extra is None else extra(state, windows.actions[batch.rows, k], k)
        if owner is not None:
            acted = np.stack([drive(i, j, state) for i in range(k, k + at_once) for j in range(n)], axis=1)
            path = clip_diverged(chain.rolled(owner, state, acted, values, step, t, added, strained))
            if at_once > 1 and not batch.even:
                path = _moved(state, path, off[batch.rows, 1:], n)
            yield from path.transpose(1, 0, 2)
            state = path[:, -1]
            continue
        for j in range(n):
            state = chain.advance(state, drive(k, j, state), values, step, t + j * step, added, strained)
            state = clip_diverged(state) if j == n - 1 else state
            yield state


def straightened(windows: Windows) -> tuple[FloatArray, FloatArray]:
    """(W,) s, how long transitions of each window are in the mean; (W, L + 1) by how many of these its clock is off."""
    last = np.maximum(windows.valid.sum(axis=1) - 1, 1)
    rows = np.arange(len(windows))
    mean = (windows.t[rows, last] - windows.t[:, 0]) / last
    line = windows.t[:, :1] + mean[:, None] * np.arange(windows.length + 1)
    return mean, np.where(windows.valid, windows.t - line, 0.0) / mean[:, None]


def _moved(start: FloatArray, path: FloatArray, off: FloatArray, n: int) -> FloatArray:
    """States (B, L n, S) on even substeps, at the ends of transitions as they are so many transitions (B, L) later.

    By the parabola through the nearest state and its neighbours.
    """
    whole = np.concatenate([start[:, None], path], axis=1)
    place = n * (np.arange(1, off.shape[1] + 1) + off)
    nearest = np.clip(np.rint(place).astype(np.int64), 1, path.shape[1] - 1)
    far, rows = (place - nearest)[:, :, None], np.arange(len(path))[:, None]
    before, here, after = (whole[rows, nearest + k] for k in (-1, 0, 1))
    path[:, n - 1 :: n] = here + far * ((after - before) / 2.0 + far * (after - 2.0 * here + before) / 2.0)
    return path


def _history(
    batch: Batch, starts: FloatArray, drive: Drive, strained: Memory
) -> tuple[FloatArray, FloatArray | None]:
    """(B, K, S): the states before the windows, integrated backwards; an episode stood still before it began.

    And how long after the one before each of them is, (B, K) s, where the clock is uneven.
    """
    chain, windows, rows, n, moments = batch.chain, batch.windows, batch.rows, batch.n, batch.moments
    every, state = n // moments, starts
    own = every * (windows.t[rows, 1] - windows.t[rows, 0]) / n
    lengths = every * np.diff(windows.before_t, axis=1) / n
    still, past, steps = windows.rested[rows, None], [starts], []
    for back in range(1, min(batch.slots, moments * windows.before_actions.shape[1] + 1)):
        k, j = divmod(-back, moments)
        step, end = own, windows.t[rows, 0] - (back - 1) * own
        if not batch.even:
            step = lengths[rows, k]
            end = windows.before_t[rows, k] - (moments - 1 - j) * step
        command = np.mean([drive(k, j * every + i, state) for i in range(every)], axis=0)
        state = chain.advance(state, command, batch.values, -step, end, None, strained)
        state = np.where(still, starts, clip_diverged(state))
        past.append(state)
        steps.append(step)
    return np.stack(past[::-1], axis=1), None if batch.even else np.stack([*steps, own][::-1], axis=1)


def by_compiled_code(
    program: Program, batch: Batch, starts: FloatArray, strained: Memory, threads: int
) -> FloatArray | None:
    """The same; None where compiled code cannot."""
    chain, windows, n, count = batch.chain, batch.windows, batch.n, len(starts)
    known = commands(batch, program, threads)
    if known is None:
        return None
    past = None
    if chain.sensors.remember:
        depth = min(batch.slots, n * windows.before_actions.shape[1] + 1)
        earlier = np.empty((len(windows), 0)) if batch.even else windows.before_t
        past = Past(depth, earlier, windows.rested.astype(np.int64))
    states, passed = marched(
        program, n, starts, program.values(batch.values, count), windows.t, batch.rows, known, threads, past,
        program.bends(strained, count),
    )  # fmt: skip
    return clip_diverged(_read(batch, states, passed, past)) if chain.sensors else states


def _read(batch: Batch, states: FloatArray, passed: FloatArray, past: Past | None) -> FloatArray:
    """(B, L + 1, S) what the sensors say of the states (B, L + 1, S), which change: first lags, then what is late."""
    sensors, windows, values = batch.chain.sensors, batch.windows, batch.values
    steps = np.diff(windows.t, axis=1) / batch.n
    steps = np.concatenate([steps[:, :1], steps], axis=1)
    if past is not None:
        when = np.empty((len(windows), 0)) if batch.even else _when(batch, past.depth)
        read = partial(read_late, passed, past, batch.n)
        for term, column in sensors.lagging:
            read(column, values[term]["time_constant"], steps, when, batch.rows, states, lags=True)
        for term, column in sensors.late:
            read(column, values[term]["delay"], steps, when, batch.rows, states)
    count, times, channels = states.shape
    others = {i: {name: np.repeat(v, times) for name, v in values[i].items()} for i in sensors.rest}
    if not others:
        return states
    said = sensors.rest_measure(states.reshape(-1, channels), others, steps[batch.rows].ravel())
    return said.reshape(count, times, channels)


def _when(batch: Batch, depth: int) -> FloatArray:
    """(W, depth + L n) s, when the states were that sensors see, the first one at 0."""
    steps = np.repeat(np.diff(batch.clock, axis=1) / batch.n, batch.n, axis=1)
    steps = steps[:, -(depth - 1 + batch.windows.length * batch.n) :]
    return np.concatenate([np.zeros((len(steps), 1)), np.cumsum(steps, axis=1)], axis=1)
