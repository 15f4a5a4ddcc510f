"""Quantisation: whether the values of a channel lie on a grid that is coarser than its noise."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from gpsim.channels import FloatArray
from gpsim.diagnosis.data.repeats import SAMPLES_AROUND

FEWEST_STEPS = 50  # changes of a channel by which its grid is known
FEWEST_SIZES = 3  # different changes, in steps of the grid, standstill among them
GRID_MULTIPLES = (1, 3, 10, 30)  # of the grid's step, by which it is known ever more exactly
GRID_TOLERANCE = 0.05  # of the grid's step: what is nearer to a multiple is one
ON_GRID = 0.98  # of a channel's changes that are multiples of its grid's step (outliers may be none)
QUIET_SHARE = 0.1  # of a recording, where a channel moves least: there its noise is seen beside its grid
FEW_LEVELS = 16  # levels of command, of which each may change a speed by always the same

ROUNDING = 1e-7  # of a channel's range: differences below are the rounding of a file
THIRD_DIFFERENCE = np.sqrt(20.0)  # standard deviation of white noise's third differences, in its own
NORMAL_MEDIAN = 0.6745  # median of a standard normal's absolute value


def quantum(series: Sequence[FloatArray], actions: Sequence[FloatArray]) -> float | None:
    """The grid's step, None where there is none, or a finer one than the noise.

    series: of each stretch (K,), angles running on; actions: (K - 1, A) of each. A grid that the commands make (a
    push that is always as strong changes a speed by always as much) is none of the sensor's.
    """
    together = np.concatenate([np.diff(y) for y in series])
    span = max((float(np.ptp(y)) for y in series), default=0.0)
    for steps in (together, np.concatenate([_between_held(y) for y in series])):
        found = _grid(np.abs(steps), span)
        if found is None:
            continue
        counts = np.rint(together / found)
        few = len(np.unique(counts)) < FEWEST_SIZES
        if few or not (counts == 0).any() or _noise(series) > found:
            return None
        return None if _commanded(series, actions, found) else found
    return None


def _between_held(y: FloatArray) -> FloatArray:
    """Steps between values that are held for a sample or more: those on a grid, whatever was interpolated between."""
    return np.diff(y[:-1][np.diff(y) == 0])


def _grid(sizes: FloatArray, span: float) -> float | None:
    """The step of which nearly all sizes of differences (N,) are multiples, None where there is none."""
    sizes = sizes[sizes > ROUNDING * span]
    if len(sizes) < FEWEST_STEPS:
        return None
    found = (_refined(sizes, guess) for guess in _guesses(sizes, span))
    return next((value for value in found if value is not None), None)


def _guesses(steps: FloatArray, span: float) -> list[float]:
    """Candidates for a grid's step, the coarsest first: sizes of small differences, and differences of these."""
    sizes = np.unique(steps)
    apart = np.diff(sizes)
    sizes = sizes[np.concatenate([[True], apart > ROUNDING * span])][:8]
    gaps = np.diff(sizes)
    return sorted({float(v) for v in (*sizes[:4], *gaps[:4])}, reverse=True)


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
        whole = third[: len(third) // size * size].reshape(-1, size)
        found.append(np.median(whole, axis=1))
    medians = np.concatenate(found)
    medians = medians[medians > 0]
    if not len(medians):
        return 0.0
    return float(np.quantile(medians, QUIET_SHARE) / NORMAL_MEDIAN / THIRD_DIFFERENCE)


def _commanded(series: Sequence[FloatArray], actions: Sequence[FloatArray], step: float) -> bool:
    """Whether a few levels of command decide by how much the channel changes, or by how much its change does.

    A command moves a speed by its first difference, and a position by its second one, at once or a sample later.
    """
    levels = np.unique(np.round(np.concatenate(list(actions)), 9), axis=0)
    if not levels.size or len(levels) > FEW_LEVELS:
        return False
    for order, late in ((1, 0), (2, 0), (2, 1)):
        changes = [np.rint(np.diff(y, n=order) / step) for y in series if len(y) > order]
        given = [
            a[order - 1 - late : len(a) - late]
            for y, a in zip(series, actions, strict=True)
            if len(y) > order
        ]
        if not changes:
            continue
        which = np.unique(np.round(np.concatenate(given), 9), axis=0, return_inverse=True)[1].ravel()
        together = np.concatenate(changes)
        usual = [np.unique(together[which == i], return_counts=True)[1].max() for i in np.unique(which)]
        if sum(map(int, usual)) >= ON_GRID * len(together):
            return True
    return False
