"""Outliers: a sample, or a few in a row, that leaps away from the others and comes back: a swapped marker.

What moves does not leap away and return within a few samples, but for a command that does the same just before. A
step that stays (an impact, friction that stops a body) is no outlier, nor are leaps as everywhere else in the channel.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.ndimage import median_filter

from gpsim.channels import BoolArray, FloatArray, wrap_angle
from gpsim.diagnosis.settings import LogFactSettings


def outliers(
    series: Sequence[FloatArray],
    actions: Sequence[FloatArray],
    quantum: float,
    angle: bool,
    settings: LogFactSettings,
) -> list[BoolArray]:
    """(K,) of each stretch without gaps, which samples are outliers.

    series: of each stretch (K,), angles running on; actions: (K - 1, A) of each; quantum: the channel's grid, 0 without
    one; angle: the channel is one, of which only the turn's remainder counts.
    """
    every_step = [np.diff(y) for y in series]
    leaps = [_leaps(steps, angle, settings) for steps in every_step]
    changes = [np.abs(np.diff(a, axis=0, prepend=a[:1])) for a in actions]
    flags = [np.zeros(len(y), dtype=np.bool_) for y in series]
    every = np.abs(np.concatenate(leaps)) if leaps else np.zeros(0)
    if not len(every):
        return flags
    ordinary = float(np.quantile(every, settings.ordinary_share))
    for length in range(1, settings.longest_outlier + 1):
        spikes = [_spikes(u, length, angle, settings) for u in leaps]
        together = np.concatenate(spikes)
        if not len(together):
            continue
        usual = max(float(np.quantile(together, settings.common_share)), ordinary)
        least = max(settings.stands_out * usual, settings.outlier_quanta * quantum)
        causes = _caused(changes, length, settings)
        for steps, sizes, caused, flag in zip(every_step, spikes, causes, flags, strict=True):
            for i in np.flatnonzero(sizes > least):
                if caused[i] or flag[i] or flag[i + 1 + length]:  # those beside it are outliers themselves
                    continue
                if _stands_out(steps, int(i), length, angle, settings):
                    flag[i + 1 : i + 1 + length] = True
    return flags


def _leaps(steps: FloatArray, angle: bool, settings: LogFactSettings) -> FloatArray:
    """(K - 1,) steps from sample to sample beyond those of the steady motion around."""
    if not len(steps):
        return steps
    usual = median_filter(steps, size=2 * settings.around + 1, mode="nearest")
    return _turned(steps - usual, angle)


def _spikes(u: FloatArray, length: int, angle: bool, settings: LogFactSettings) -> FloatArray:
    """(K - 1 - length,) how far each run of so many samples leaps away and comes back, 0 where it does not."""
    count = len(u) - length
    if count <= 0:
        return np.zeros(0)
    away, back = u[:count], u[length:]
    total = np.concatenate([[0.0], np.cumsum(u)])
    returns = total[length + 1 :] - total[:count]
    returns = np.abs(_turned(returns, angle))
    size = np.minimum(np.abs(away), np.abs(back))
    spike = returns <= settings.comes_back * size
    for inside in range(1, length):  # it stays away all the time
        still = total[inside + 1 : inside + 1 + count] - total[:count]
        still = np.abs(_turned(still, angle))
        spike &= still > settings.stays_away * size
    return np.asarray(np.where(spike, size, 0.0))


def _stands_out(steps: FloatArray, i: int, length: int, angle: bool, settings: LogFactSettings) -> bool:
    """Whether both leaps of a run, steps i and i + length, are far larger than most steps around it.

    All of them beyond the steady motion there: where that changes, steps differ from it.
    """
    reach = settings.around
    others = np.concatenate([steps[max(i - reach, 0) : i], steps[i + length + 1 : i + length + 1 + reach]])
    if len(others) < reach:
        return False
    usual = np.median(others)
    leaps, others = np.abs(_turned(np.stack([steps[i], steps[i + length]]) - usual, angle)), others - usual
    return bool(leaps.min() > settings.stands_out * np.quantile(np.abs(others), settings.usual_share))


def _turned(values: FloatArray, angle: bool) -> FloatArray:
    """Of an angle what is left of whole turns."""
    return wrap_angle(values) if angle else values


def _caused(changes: Sequence[FloatArray], length: int, settings: LogFactSettings) -> list[BoolArray]:
    """(K - 1,) of each stretch, at which steps a run of so many samples may be a command's doing.

    One leapt and leapt again as long after, within an actuator's delay before. Where commands do so all the time that
    says nothing, and what they do is no rare thing.

    changes: (K - 1, A) by how much each command differs from the one before.
    """
    together = np.concatenate(list(changes))
    most = together.max(axis=0, initial=0.0)
    caused = []
    for change in changes:
        large = change >= settings.commanded_share * np.where(most > 0, most, np.inf)
        pairs = np.zeros(len(change), dtype=np.bool_)
        if len(change) <= length:
            caused.append(pairs)
            continue
        pairs[:-length] = (large[:-length] & large[length:]).any(axis=1)
        since = np.convolve(pairs, np.ones(settings.reacts_within + 1), mode="full")[: len(pairs)]
        caused.append(since > 0)
    usual = float(np.concatenate(caused).mean()) if len(together) else 0.0
    return caused if usual <= settings.commanded_often else [np.zeros_like(c) for c in caused]
