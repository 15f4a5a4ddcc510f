"""Repeats: samples at which a channel says once more what it said before, while what it measures moves on.

A stale packet gives itself away by what follows: the next new value lies where the motion has gone meanwhile, on the
line through its neighbours. A body that stands still, or a command that stops it, leaves no such leap.
"""

from __future__ import annotations

import numpy as np

from gpsim.channels import BoolArray, FloatArray, IntArray
from gpsim.diagnosis.settings import LogFactSettings

SAMPLES_AROUND = 10  # samples on either side, with which a sample is compared: what is usual there
STEADY_ON = 3  # values on either side of a repeated one that must move on steadily
STEADY = 0.4
"""By which slopes between values may differ from their median where motion is steady (a body that stood still for one
sample has half the slope)."""
PLAIN_MOTION = 6.0
"""Steps of its grid that a channel moves each sample, where a repeated value is no chance."""


def repeats(t: FloatArray, y: FloatArray, quantum: float, settings: LogFactSettings) -> BoolArray:
    """(K,) which samples of a stretch without gaps are stale: t (K,) s, y (K,) with angles that run on.

    quantum: the channel's grid, 0 where it has none: what moves less than a few steps of it a sample holds by itself.
    """
    flags = np.zeros(len(y), dtype=np.bool_)
    first = np.concatenate([[0], np.flatnonzero(np.diff(y)) + 1])  # where every new value appears
    if len(first) < 2:
        return flags
    slopes = np.diff(y[first]) / np.diff(t[first])  # slopes[j]: from value j to the next one
    held, beside = _held(first, settings), STEADY_ON
    held = held[(held >= beside) & (held < len(slopes) - beside)]
    around = slopes[held[:, None] + np.arange(-beside, beside + 1)]
    usual = np.median(around, axis=1)
    steady = (np.abs(around - usual[:, None]) <= STEADY * np.abs(usual)[:, None]).all(axis=1)
    plain = np.abs(usual) * np.median(np.diff(t)) > PLAIN_MOTION * quantum
    return _flagged(flags, first, held[steady & plain])


def whole_packets(t: FloatArray, states: FloatArray, settings: LogFactSettings) -> BoolArray:
    """(K,) at which samples of a stretch a whole packet is stale: states (K, S), angles running on.

    All channels hold at once, and the next new values of two of them, or more, lie roughly where their motion has gone.
    That needs less steady a motion than one channel alone: a body that stands still leaves no leap in any position.
    """
    flags = np.zeros(len(states), dtype=np.bool_)
    first = np.concatenate([[0], np.flatnonzero((np.diff(states, axis=0) != 0).any(axis=1)) + 1])
    if states.shape[1] < 2 or len(first) < 2:
        return flags
    slopes = np.diff(states[first], axis=0) / np.diff(t[first])[:, None]
    held = _held(first, settings)
    held = held[(held > 0) & (held < len(slopes) - 1)]
    before, own, after = slopes[held - 1], slopes[held], slopes[held + 1]
    usual = 0.5 * (before + after)
    on = (before * after > 0) & (np.abs(own - usual) <= STEADY * np.abs(usual))
    return _flagged(flags, first, held[on.sum(axis=1) >= 2])


def held_with(others: BoolArray, y: FloatArray, quantum: float) -> BoolArray:
    """(K,) which samples repeat together with those of other channels, `others` (K,): a packet holds several.

    y (K,): a channel that moves around them, too, but perhaps too unsteadily to tell by itself.
    """
    flags = np.zeros(len(y), dtype=np.bool_)
    steps = np.diff(y)
    for k in np.flatnonzero(others[1:] & (steps == 0)) + 1:
        near = np.abs(steps[max(k - 1 - SAMPLES_AROUND, 0) : k + SAMPLES_AROUND])
        if float(np.median(near)) > PLAIN_MOTION * quantum:
            flags[k] = True
    return flags


def _held(first: IntArray, settings: LogFactSettings) -> IntArray:
    """Which values stood for more than a sample, and no longer than a packet may be missing."""
    times = np.diff(first)
    return np.flatnonzero((times > 1) & (times <= settings.longest_repeat + 1))


def _flagged(flags: BoolArray, first: IntArray, held: IntArray) -> BoolArray:
    """The flags (K,) with all samples of the values `held` set but the first of each."""
    for j in held:
        flags[first[j] + 1 : first[j + 1]] = True
    return flags
