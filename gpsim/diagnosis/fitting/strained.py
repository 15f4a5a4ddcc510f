"""How far bristles are bent and elastic drives twisted as windows begin: what was before tells it.

Bristles go with the positions that were read. A twist swings by itself and may hardly fade, so what it was long ago
matters. It is what fits the speeds that were read best: they are linear in it, like the twist as the window begins.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from gpsim.channels import FloatArray, IntArray
from gpsim.diagnosis.data import Windows
from gpsim.effects import Chain, Values, bend_key, bent, twisted
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
