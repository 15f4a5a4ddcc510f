"""Outliers: a sample, or a few in a row, that leaps away from the others and comes back: a swapped marker.

What moves does not leap away and return within a few samples, but for a command that does the same just before. A
step that stays (an impact, friction that stops a body) is no outlier, nor are leaps as everywhere else in the channel.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.ndimage import median_filter

from gpsim.channels import BoolArray, FloatArray, wrap_angle
from gpsim.diagnosis.data.repeats import SAMPLES_AROUND
from gpsim.diagnosis.settings import LogFactSettings

USUAL_SHARE = 0.8
"""Quantile of the leaps around an outlier with which it is compared (two more outliers nearby leave it alone)."""
COMMON_SHARE = 0.98
"""Quantile of a channel's spikes that are taken for common (what happens more often than twice in a hundred samples
is chatter, no accident)."""
ORDINARY_SHARE = 0.9
"""Quantile of a channel's leaps over the whole recording that are ordinary (a body that slips for a moment and is
held again moves as others do)."""
LONGEST_OUTLIER = 5  # samples of a run that leaps away and comes back, at most
COMES_BACK = 0.25  # of an outlier's leap, within which it returns
STAYS_AWAY = 0.5  # of an outlier's leap, that it stays away in between
OUTLIER_QUANTA = 5.0  # steps of a channel's grid that an outlier leaps at least
COMMANDED_SHARE = 0.5  # of the largest change of a command: two such changes, as far apart, are a cause
COMMANDED_OFTEN = 0.25
"""Of the samples that such a pair of changes precedes: where more are, it says nothing (what commands do that often
is common in the channel, too)."""
REACTS_WITHIN = 12
"""After a change of a command in which it acts [samples] (the longest delay that is looked for)."""


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
    leaps = [_leaps(steps, angle) for steps in every_step]
    changes = [np.abs(np.diff(a, axis=0, prepend=a[:1])) for a in actions]
    flags = [np.zeros(len(y), dtype=np.bool_) for y in series]
    every = np.abs(np.concatenate(leaps)) if leaps else np.zeros(0)
    if not len(every):
        return flags
    ordinary = float(np.quantile(every, ORDINARY_SHARE))
    for length in range(1, LONGEST_OUTLIER + 1):
        spikes = [_spikes(u, length, angle) for u in leaps]
        together = np.concatenate(spikes)
        if not len(together):
            continue
        usual = max(float(np.quantile(together, COMMON_SHARE)), ordinary)
        least = max(settings.stands_out * usual, OUTLIER_QUANTA * quantum)
        causes = _caused(changes, length)
        for steps, sizes, caused, flag in zip(every_step, spikes, causes, flags, strict=True):
            for i in np.flatnonzero(sizes > least):
                if caused[i] or flag[i] or flag[i + 1 + length]:  # those beside it are outliers themselves
                    continue
                if _stands_out(steps, int(i), length, angle, settings):
                    flag[i + 1 : i + 1 + length] = True
    return flags


def _leaps(steps: FloatArray, angle: bool) -> FloatArray:
    """(K - 1,) steps from sample to sample beyond those of the steady motion around."""
    if not len(steps):
        return steps
    usual = median_filter(steps, size=2 * SAMPLES_AROUND + 1, mode="nearest")
    return _turned(steps - usual, angle)


def _spikes(u: FloatArray, length: int, angle: bool) -> FloatArray:
    """(K - 1 - length,) how far each run of so many samples leaps away and comes back, 0 where it does not."""
    count = len(u) - length
    if count <= 0:
        return np.zeros(0)
    away, back = u[:count], u[length:]
    total = np.concatenate([[0.0], np.cumsum(u)])
    returns = total[length + 1 :] - total[:count]
    returns = np.abs(_turned(returns, angle))
    size = np.minimum(np.abs(away), np.abs(back))
    spike = returns <= COMES_BACK * size
    for inside in range(1, length):  # it stays away all the time
        still = total[inside + 1 : inside + 1 + count] - total[:count]
        still = np.abs(_turned(still, angle))
        spike &= still > STAYS_AWAY * size
    return np.asarray(np.where(spike, size, 0.0))


def _stands_out(steps: FloatArray, i: int, length: int, angle: bool, settings: LogFactSettings) -> bool:
    """Whether both leaps of a run, steps i and i + length, are far larger than most steps around it.

    All of them beyond the steady motion there: where that changes, steps differ from it.
    """
    reach = SAMPLES_AROUND
    others = np.concatenate([steps[max(i - reach, 0) : i], steps[i + length + 1 : i + length + 1 + reach]])
    if len(others) < reach:
        return False
    usual = np.median(others)
    leaps, others = np.abs(_turned(np.stack([steps[i], steps[i + length]]) - usual, angle)), others - usual
    return bool(leaps.min() > settings.stands_out * np.quantile(np.abs(others), USUAL_SHARE))


def _turned(values: FloatArray, angle: bool) -> FloatArray:
    """Of an angle what is left of whole turns."""
    return wrap_angle(values) if angle else values


def _caused(changes: Sequence[FloatArray], length: int) -> list[BoolArray]:
    """(K - 1,) of each stretch, at which steps a run of so many samples may be a command's doing.

    One leapt and leapt again as long after, within an actuator's delay before. Where commands do so all the time that
    says nothing, and what they do is no rare thing.

    changes: (K - 1, A) by how much each command differs from the one before.
    """
    together = np.concatenate(list(changes))
    most = together.max(axis=0, initial=0.0)
    caused = []
    for change in changes:
        large = change >= COMMANDED_SHARE * np.where(most > 0, most, np.inf)
        pairs = np.zeros(len(change), dtype=np.bool_)
        if len(change) <= length:
            caused.append(pairs)
            continue
        pairs[:-length] = (large[:-length] & large[length:]).any(axis=1)
        since = np.convolve(pairs, np.ones(REACTS_WITHIN + 1), mode="full")[: len(pairs)]
        caused.append(since > 0)
    usual = float(np.concatenate(caused).mean()) if len(together) else 0.0
    return caused if usual <= COMMANDED_OFTEN else [np.zeros_like(c) for c in caused]
