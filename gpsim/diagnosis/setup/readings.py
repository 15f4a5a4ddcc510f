"""What readings show by themselves: where they stand at an end, which small ones are missing, which channel trails."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from gpsim.channels import BoolArray, FloatArray
from gpsim.recordings import Recording

FEWEST = 10  # readings of one value: fewer are chance
AS_MANY = 5  # times as many as have the next value: at a turning point of a coarse signal they are 2.4 times as many
HOLLOW = 5  # times the usual step between small readings that the least of them is away from 0
SMALL = 20  # readings that tell this usual step
SURELY = 4.0  # standard errors that a channel must trail another by: all channels of a robot are asked
BRIEF = 0.02  # of the time between two readings: by less nobody trails
STRIDES = (1, 4, 16)  # samples apart are readings that are compared


def stands(readings: FloatArray) -> tuple[bool, bool]:
    """Whether many readings (N,) have the lowest, and the highest, value of all."""
    counts = np.unique(readings, return_counts=True)[1]
    if len(counts) < 3:
        return False, False
    many = counts[[0, -1]] >= np.maximum(FEWEST, AS_MANY * counts[[1, -2]])
    return bool(many[0]), bool(many[1])


def unread(readings: FloatArray) -> tuple[float, float] | tuple[()]:
    """The least size of readings (N,) that are not 0, and the mean distance of small ones; nothing where few are 0."""
    sizes = np.unique(np.abs(readings))
    if len(sizes) < 3 or sizes[0] > 0.0 or (readings == 0.0).sum() < FEWEST:
        return ()
    apart = np.diff(sizes[1 : SMALL + 2])
    return (float(sizes[1]), float(apart.mean())) if sizes[1] > HOLLOW * np.median(apart) else ()


def telling(recording: Recording) -> list[BoolArray]:
    """(K + 1,) of each episode, which samples tell where the state is: no reading at its range's end, or in its zone.

    A sensor that says 0 below some size, or no more than its range, hides where a rollout would begin.
    """
    return [np.asarray(~hidden.any(axis=1)) for hidden in hiding(recording)]


def hiding(recording: Recording) -> list[BoolArray]:
    """(K + 1, S) of each episode, which readings are those that a sensor gives for many true values."""
    whats = [_hides(column) for column in np.concatenate([e.states for e in recording.episodes]).T]
    return [
        np.stack([hides(y) for hides, y in zip(whats, e.states.T, strict=True)], axis=1)
        for e in recording.episodes
    ]


def _hides(readings: FloatArray) -> Callable[[FloatArray], BoolArray]:
    """Whether a reading is one of those that a sensor like this one gives for many true values."""
    lowest, highest = stands(readings)
    low = float(readings.min()) if lowest else -np.inf
    high = float(readings.max()) if highest else np.inf
    silent = bool(unread(readings))
    return lambda y: (y <= low) | (y >= high) | (silent & (y == 0.0))


def trails(pieces: Sequence[tuple[FloatArray, FloatArray, FloatArray]]) -> int:
    """Whether a coordinate's speed surely trails its position (1), or the position the speed (-1); else 0.

    pieces: (travelled (K,), speed (K,), t (K,) s) of each episode. A speed that is read T late, or filtered with a time
    constant T, is behind by T times the acceleration; one that is off or scaled is not. Noise of either channel favours
    no sign. It hides less of what happens over several samples.
    """
    for stride in STRIDES:
        rows = np.concatenate([_stretches(*piece, stride) for piece in pieces])
        rows = rows[rows[:, 3] > 0.0]
        which = _trails(*rows.T)
        if which:
            return which
    return 0


def _stretches(travelled: FloatArray, speed: FloatArray, t: FloatArray, stride: int) -> FloatArray:
    """(N, 4) of stretches of so many samples: way, way by the speed that was read, change of that, time [s]."""
    way = np.concatenate([[0.0], np.cumsum(np.diff(t) * (speed[:-1] + speed[1:]) / 2)])
    return np.stack([np.diff(x[::stride]) for x in (travelled, way, speed, t)], axis=1)


def _trails(way: FloatArray, told: FloatArray, change: FloatArray, lasting: FloatArray) -> int:
    causes = np.stack([change / lasting, told / lasting, np.ones_like(told)], axis=1)
    if len(way) < FEWEST or np.linalg.matrix_rank(causes) < causes.shape[1]:
        return 0
    behind, inverse = (way - told) / lasting, np.linalg.inv(causes.T @ causes)
    found = inverse @ causes.T @ behind
    error = np.sqrt(inverse[0, 0] * float(np.mean((behind - causes @ found) ** 2)))
    sure = abs(found[0]) > max(SURELY * error, BRIEF * float(np.median(lasting)))
    return int(np.sign(found[0])) if sure else 0
