"""What single samples of a channel are: stale, wild, or on a grid; and how large errors are.

Repeats: a channel says once more what it said before, while what it measures moves on. A stale packet gives itself
away by what follows: the next new value lies where the motion has gone meanwhile, on the line through its neighbours. A
body that stands still, or a command that stops it, leaves no such leap.

Outliers: a sample, or a few in a row, leaps away from the others and comes back, as a swapped marker. What moves does
not, but for a command that does the same just before. A step that stays (an impact, friction that stops a body) is no
outlier, nor are leaps as everywhere else in the channel.

Quantisation: the values of a channel lie on a grid that is coarser than its noise.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.ndimage import median_filter

from gpsim.channels import BoolArray, FloatArray, IntArray, wrap_angle
from gpsim.diagnosis.settings import LogFactSettings

TYPICAL = 1.4826  # the median of |e| times this is the standard deviation of a normal error
SAMPLES_AROUND = 10  # samples on either side, with which a sample is compared: what is usual there

STEADY_ON = 3  # values on either side of a repeated one that must move on steadily
STEADY = 0.4
"""By which slopes between values may differ from their median where motion is steady (a body that stood still for one
sample has half the slope)."""
PLAIN_MOTION = 6.0  # steps of its grid that a channel moves each sample, where a repeated value is no chance

USUAL_SHARE = (
    0.8  # quantile of the leaps around an outlier with which it is compared (two more nearby leave it alone)
)
COMMON_SHARE = 0.98  # quantile of a channel's spikes that are common: what happens more often is no accident
ORDINARY_SHARE = (
    0.9  # quantile of a channel's leaps that are ordinary: bodies slip for a moment and are held again
)
LONGEST_OUTLIER = 5  # samples of a run that leaps away and comes back, at most
COMES_BACK = 0.25  # of an outlier's leap, within which it returns
STAYS_AWAY = 0.5  # of an outlier's leap, that it stays away in between
OUTLIER_QUANTA = 5.0  # steps of a channel's grid that an outlier leaps at least
COMMANDED_SHARE = 0.5  # of the largest change of a command: two such changes, as far apart, are a cause
COMMANDED_OFTEN = 0.25  # of the samples that such pairs of changes precede, from which on they say nothing
REACTS_WITHIN = (
    12  # samples after a change of a command in which it acts (the longest delay that is looked for)
)

FEWEST_STEPS = 50  # changes of a channel by which its grid is known
FEWEST_SIZES = 3  # different changes, in steps of the grid, standstill among them
GRID_SAMPLES = 100_000  # of a log, in whole stretches from its beginning, that tell a grid
GRID_MULTIPLES = (1, 3, 10, 30)  # of the grid's step, by which it is known ever more exactly
GRID_TOLERANCE = 0.05  # of the grid's step: what is nearer to a multiple is one
ON_GRID = 0.98  # of a channel's changes that are multiples of its grid's step (outliers may be none)
QUIET_SHARE = 0.1  # of a recording, where a channel moves least: there its noise is seen beside its grid
FEW_LEVELS = 16  # levels of command, of which each may change a speed by always the same
ROUNDING = 1e-7  # of a channel's range: differences below are the rounding of a file
THIRD_DIFFERENCE = np.sqrt(20.0)  # standard deviation of white noise's third differences, in its own


def integral(t: FloatArray, y: FloatArray) -> FloatArray:
    """(K,) of y (K,) over t (K,), 0 at first, by the trapezoidal rule."""
    return np.concatenate([[0.0], np.cumsum(np.diff(t) * (y[1:] + y[:-1]) / 2)])


def rms(errors: FloatArray) -> float:
    """Root mean square of errors (N,)."""
    return float(np.sqrt(np.mean(errors**2)))


def typical(errors: FloatArray) -> float:
    """The same of normal errors (N,), from the median, which rare wild ones do not move."""
    return float(TYPICAL * np.median(np.abs(errors)))


def repeats(t: FloatArray, y: FloatArray, quantum: float, settings: LogFactSettings) -> BoolArray:
    """(K,) which samples of a stretch without gaps are stale: t (K,) s, y (K,) with angles that run on.

    quantum: the channel's grid, 0 where it has none: what moves less than a few steps of it a sample holds by itself.
    """
    first, slopes, held = _held(t, y[:, None], settings)
    held = held[(held >= STEADY_ON) & (held < len(slopes) - STEADY_ON)]
    if not len(held):
        return np.zeros(len(y), dtype=np.bool_)
    around = slopes[held[:, None] + np.arange(-STEADY_ON, STEADY_ON + 1), 0]
    usual = np.median(around, axis=1)
    steady = (np.abs(around - usual[:, None]) <= STEADY * np.abs(usual)[:, None]).all(axis=1)
    plain = np.abs(usual) * np.median(np.diff(t)) > PLAIN_MOTION * quantum
    return _flagged(len(y), first, held[steady & plain])


def whole_packets(t: FloatArray, states: FloatArray, settings: LogFactSettings) -> BoolArray:
    """(K,) at which samples of a stretch a whole packet is stale: states (K, S), angles running on.

    All channels hold at once, and the next new values of two of them, or more, lie roughly where their motion has gone.
    That needs less steady a motion than one channel alone: a body that stands still leaves no leap in any position.
    """
    first, slopes, held = _held(t, states, settings)
    held = held[(held > 0) & (held < len(slopes) - 1)]
    before, own, after = slopes[held - 1], slopes[held], slopes[held + 1]
    usual = 0.5 * (before + after)
    on = (before * after > 0) & (np.abs(own - usual) <= STEADY * np.abs(usual))
    return _flagged(len(t), first, held[on.sum(axis=1) >= 2])


def held_with(others: BoolArray, y: FloatArray, quantum: float) -> BoolArray:
    """(K,) which samples repeat together with those of other channels, `others` (K,): a packet holds several.

    y (K,): a channel that moves around them, too, but perhaps too unsteadily to tell by itself.
    """
    flags = np.zeros(len(y), dtype=np.bool_)
    steps = np.diff(y)
    for k in np.flatnonzero(others[1:] & (steps == 0)) + 1:
        near = np.abs(steps[max(k - 1 - SAMPLES_AROUND, 0) : k + SAMPLES_AROUND])
        flags[k] = float(np.median(near)) > PLAIN_MOTION * quantum
    return flags


def _held(
    t: FloatArray, states: FloatArray, settings: LogFactSettings
) -> tuple[IntArray, FloatArray, IntArray]:
    """Where new values (K, S) appear, slopes from each to the next, and which stood longer than a sample.

    But no longer than a packet may be missing.
    """
    first = np.concatenate([[0], np.flatnonzero((np.diff(states, axis=0) != 0).any(axis=1)) + 1])
    times = np.diff(first)
    slopes = np.diff(states[first], axis=0) / np.diff(t[first])[:, None]
    return first, slopes, np.flatnonzero((times > 1) & (times <= settings.longest_repeat + 1))


def _flagged(count: int, first: IntArray, held: IntArray) -> BoolArray:
    """(K,) flags of all samples of the values `held` but the first of each."""
    flags = np.zeros(count, dtype=np.bool_)
    for j in held:
        flags[first[j] + 1 : first[j + 1]] = True
    return flags


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
        if not (together > least).any():
            continue
        causes = _caused(changes, length)
        for steps, sizes, caused, flag in zip(every_step, spikes, causes, flags, strict=True):
            for i in np.flatnonzero(sizes > least):
                beside = flag[i] or flag[i + 1 + length]  # is an outlier itself
                if not (caused[i] or beside) and _stands_out(steps, int(i), length, angle, settings):
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
    count = max(len(u) - length, 0)
    away, back = u[:count], u[length:]
    size = np.minimum(np.abs(away), np.abs(back[:count]))
    total = np.concatenate([[0.0], np.cumsum(u)])
    # How far from where it was each is after so many steps: it stays away all the time, and then it is back.
    gone = [np.abs(_turned(total[n : n + count] - total[:count], angle)) for n in range(2, length + 2)]
    spike = gone[-1] <= COMES_BACK * size
    for still in gone[:-1]:
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
    leaps = np.abs(_turned(steps[[i, i + length]] - usual, angle))
    return bool(leaps.min() > settings.stands_out * np.quantile(np.abs(others - usual), USUAL_SHARE))


def _turned(values: FloatArray, angle: bool) -> FloatArray:
    """Of an angle what is left of whole turns."""
    return wrap_angle(values) if angle else values


def _caused(changes: Sequence[FloatArray], length: int) -> list[BoolArray]:
    """(K - 1,) of each stretch, at which steps a run of so many samples may be a command's doing.

    One leapt and leapt again as long after, within an actuator's delay before. Where commands do so all the time that
    says nothing, and what they do is no rare thing.

    changes: (K - 1, A) by how much each command differs from the one before.
    """
    most = np.concatenate(list(changes)).max(axis=0, initial=0.0)
    caused = []
    for change in changes:
        large = change >= COMMANDED_SHARE * np.where(most > 0, most, np.inf)
        pairs = np.zeros(len(change), dtype=np.bool_)
        pairs[: max(len(change) - length, 0)] = (large[:-length] & large[length:]).any(axis=1)
        since = np.convolve(np.append(pairs, False), np.ones(REACTS_WITHIN + 1))[: len(change)]
        caused.append(since > 0)
    often = bool(np.concatenate(caused).mean() > COMMANDED_OFTEN)
    return [np.zeros_like(c) for c in caused] if often else caused


def quantum(series: Sequence[FloatArray], actions: Sequence[FloatArray]) -> float | None:
    """The grid's step, None where there is none, or a finer one than the noise.

    series: of each stretch (K,), angles running on; actions: (K - 1, A) of each. A grid that the commands make (a
    push that is always as strong changes a speed by always as much) is none of the sensor's.
    """
    some = int(np.searchsorted(np.cumsum([len(y) for y in series]), GRID_SAMPLES)) + 1
    series, actions = series[:some], actions[:some]
    steps = np.concatenate([np.diff(y) for y in series])
    # Steps between values that are held for a sample or more: those on a grid, whatever was interpolated between.
    held = np.concatenate([np.diff(y[:-1][np.diff(y) == 0]) for y in series])
    span = max((float(np.ptp(y)) for y in series), default=0.0)
    grids = (_grid(np.abs(sizes), span) for sizes in (steps, held))
    found = next((grid for grid in grids if grid is not None), None)
    if found is None:
        return None
    counts = np.rint(steps / found)
    few = len(np.unique(counts)) < FEWEST_SIZES or not (counts == 0).any()
    return None if few or _noise(series) > found or _commanded(series, actions, found) else found


def _grid(steps: FloatArray, span: float) -> float | None:
    """The step of which nearly all sizes of differences (N,) are multiples, None where there is none.

    Candidates are sizes of small differences, and differences of these, the coarsest first.
    """
    steps = steps[steps > ROUNDING * span]
    if len(steps) < FEWEST_STEPS:
        return None
    sizes = np.unique(steps)
    sizes = sizes[np.diff(sizes, prepend=-np.inf) > ROUNDING * span][:8]
    guesses = np.unique([*sizes[:4], *np.diff(sizes)[:4]])[::-1]
    found = (_refined(steps, float(guess)) for guess in guesses)
    return next((value for value in found if value is not None), None)


def _refined(steps: FloatArray, guess: float) -> float | None:
    """The step near a guess of which nearly all differences are multiples; None where they are not.

    Small multiples say first, roughly, what large ones then say exactly.
    """
    value = guess
    for most in GRID_MULTIPLES:
        counts = np.rint(steps / value)
        near = (counts > 0) & (counts <= most)
        if not near.any():
            return None
        value = float(steps[near] @ counts[near] / (counts[near] @ counts[near]))
    small = steps[np.rint(steps / value) <= GRID_MULTIPLES[-1]]
    if len(small) < 0.5 * len(steps):  # most steps are large: whatever the grid, it does not matter
        return None
    off = np.abs(small / value - np.rint(small / value))
    on = (off < GRID_TOLERANCE) & (small > 0.5 * value)
    return value if float(on.mean()) >= ON_GRID else None


def _noise(series: Sequence[FloatArray]) -> float:
    """The channel's noise by its third differences where these are least: motion that is smooth leaves little there."""
    size, found = 2 * SAMPLES_AROUND + 1, []
    for y in series:
        third = np.abs(np.diff(y, n=3))
        found.append(np.median(third[: len(third) // size * size].reshape(-1, size), axis=1))
    medians = np.concatenate(found)
    medians = medians[medians > 0]
    return float(TYPICAL * np.quantile(medians, QUIET_SHARE) / THIRD_DIFFERENCE) if len(medians) else 0.0


def _commanded(series: Sequence[FloatArray], actions: Sequence[FloatArray], step: float) -> bool:
    """Whether a few levels of command decide by how much the channel changes, or by how much its change does.

    A command moves a speed by its first difference, and a position by its second one, at once or a sample later.
    """
    levels = np.unique(np.round(np.concatenate(list(actions)), 9), axis=0)
    if not levels.size or len(levels) > FEW_LEVELS:
        return False
    for order, late in ((1, 0), (2, 0), (2, 1)):
        long = [(y, a) for y, a in zip(series, actions, strict=True) if len(y) > order]
        if not long:
            continue
        changes = np.concatenate([np.rint(np.diff(y, n=order) / step) for y, _ in long])
        given = np.concatenate([a[order - 1 - late : len(a) - late] for _, a in long])
        which = np.unique(np.round(given, 9), axis=0, return_inverse=True)[1].ravel()
        usual = [np.unique(changes[which == i], return_counts=True)[1].max() for i in np.unique(which)]
        if sum(map(int, usual)) >= ON_GRID * len(changes):
            return True
    return False
