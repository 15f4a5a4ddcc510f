"""Predicted against observed while a policy drives: a sequential test that stops where the simulator no longer holds.

The test bets against the simulator (an e-detector: Shin, Ramdas and Rinaldo 2023). Every step has a score, the mean
squared error of the prediction in units of what was usual in a recording. While its mean, given all before, is at most
`usual`, each bet's capital 1 + bet (score / usual - 1) is worth no more than it cost; the bets that begin at any of
the first T steps together reach T / p with a probability of p at most (Doob's inequality). No distribution is assumed,
and no independence; that the mean is at most `usual` is, and the recording says what that is.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from gpsim.channels import BoolArray, Channels, FloatArray, difference
from gpsim.errors import UsageError
from gpsim.recordings import Episode, gaps, pieces
from gpsim.simulators import Memory, Plant, restart

BETS = (0.03, 0.1, 0.3, 0.9)
"""Small ones see small changes, large ones large changes at once; the capital is shared out evenly among them."""


@dataclass(frozen=True)
class MonitorSettings:
    """How sure a stop has to be, and what counts as usual.

    false_stops: probability of a stop within `minutes` of driving though nothing has changed; margin: times the mean
    score of the recording's worst `block` seconds; floor: an error of this share of a channel's usual change is none;
    cap: the most that a channel's squared error counts.
    """

    false_stops: float = 0.01
    minutes: float = 10.0
    margin: float = 1.5
    block: float = 1.0
    floor: float = 0.02
    cap: float = 50.0

    def __post_init__(self) -> None:
        if not 0.0 < self.false_stops < 1.0:
            raise ValueError(f"false_stops must be between 0 and 1, got {self.false_stops:g}")
        if min(self.minutes, self.margin, self.block, self.cap) <= 0.0 or self.floor < 0.0:
            raise ValueError("minutes, margin, block and cap must be positive, floor at least 0")

    def threshold(self, dt: float) -> float:
        """The capital at which it stops."""
        return self.minutes * 60.0 / dt / self.false_stops


@dataclass(frozen=True)
class Usual:
    """What a recording says of the predictions: a scale (S,) of the errors, and the highest mean of the score."""

    scale: FloatArray
    mean: float
    steps: int

    def score(self, error: FloatArray, cap: float) -> FloatArray:
        """(...): the score of errors (..., S)."""
        return np.asarray(np.minimum((error / self.scale) ** 2, cap).mean(axis=-1))


def usual_errors(
    plant: Plant,
    episodes: Sequence[Episode],
    channels: Channels,
    noise: FloatArray,
    settings: MonitorSettings,
    rng: np.random.Generator,
) -> Usual:
    """Calibrate on recorded episodes. channels: of the state; noise: (S,) of a measurement that the recording lacks.

    Raises UsageError where no two samples follow each other.
    """
    stretches = _stretches(episodes, plant.dt)
    errors = [_errors(plant, states, actions, channels, rng) for states, actions in stretches]
    changes = np.concatenate([difference(s[1:], s[:-1], channels) for s, _ in stretches])
    every = np.concatenate(errors)
    if not np.isfinite(every).all():
        raise UsageError("the simulator diverges on its own recording, so the usual error is unknown")
    scale = np.sqrt((every**2).mean(axis=0) + 2.0 * noise**2 + (settings.floor * changes.std(axis=0)) ** 2)
    known = Usual(np.maximum(scale, np.finfo(float).tiny), 1.0, len(every))
    block = max(1, round(settings.block / plant.dt))
    scores = [known.score(error, settings.cap) for error in errors]
    means = [score[i : i + block].mean() for score in scores for i in range(0, len(score) - block + 1, block)]
    # Where noise was added, its own mean of one a channel is not in the recording's scores.
    share = float((2.0 * noise**2 / known.scale**2).mean())
    worst = max(means, default=float(np.concatenate(scores).mean())) + share
    return Usual(known.scale, settings.margin * max(float(worst), 1.0), len(every))


def one_step_errors(
    plant: Plant, episodes: Sequence[Episode], channels: Channels, rng: np.random.Generator
) -> FloatArray:
    """(N, S): observed minus predicted of every step of recorded episodes; UsageError as in `usual_errors`."""
    found = [
        _errors(plant, states, actions, channels, rng) for states, actions in _stretches(episodes, plant.dt)
    ]
    return np.concatenate(found)


def _stretches(episodes: Sequence[Episode], dt: float) -> list[tuple[FloatArray, FloatArray]]:
    """States (K + 1, S) and actions (K, A) of the parts of episodes without a gap."""
    found = [
        (episode.states[low : high + 1], episode.actions[low:high])
        for episode in episodes
        for low, high in pieces(np.flatnonzero(gaps(episode.t, dt)).tolist(), len(episode))
        if high > low
    ]
    if not found:
        raise UsageError("the recording has no two consecutive samples, so the usual error is unknown")
    return found


def _errors(
    plant: Plant, states: FloatArray, actions: FloatArray, channels: Channels, rng: np.random.Generator
) -> FloatArray:
    """(K, S): observed minus predicted, step by step from what was observed; what the plant remembers goes on."""
    memory, out = plant.begin(1, rng), np.empty((len(actions), states.shape[1]))
    for k, action in enumerate(actions):
        predicted = _predicted(plant, states[k : k + 1], action[None], memory, rng)
        out[k] = difference(states[k + 1 : k + 2], predicted, channels)[0]
    return out


def _predicted(
    plant: Plant, measured: FloatArray, action: FloatArray, memory: Memory, rng: np.random.Generator
) -> FloatArray:
    with np.errstate(over="ignore", invalid="ignore"):
        return plant.measure(plant.step(measured, action, memory, rng), memory, rng)


class Monitor:
    """Watches a batch of drives, each by itself; asked once a control step with what was commanded and observed."""

    def __init__(
        self,
        plant: Plant,
        usual: Usual,
        settings: MonitorSettings,
        channels: Channels,
        rng: np.random.Generator,
    ) -> None:
        """plant: the simulator that predicts; channels: of the state, which of them wrap."""
        self.plant, self.usual, self.settings, self.channels = plant, usual, settings, channels
        self.threshold, self._rng = settings.threshold(plant.dt), rng

    def begin(self, measured: FloatArray) -> None:
        """Drives begin at measured states (B, S)."""
        self._at, self._memory = measured.copy(), self.plant.begin(len(measured), self._rng)
        self.capital = np.zeros((len(measured), len(BETS)))

    def rejoin(self, rows: BoolArray, measured: FloatArray) -> None:
        """New episodes of the masked drives begin at measured states; what was learnt of the drive so far stays."""
        self._at[rows] = measured
        restart(self._memory, rows, self.plant.begin(int(rows.sum()), self._rng))

    def observe(self, action: FloatArray, measured: FloatArray) -> BoolArray:
        """(B,): whether to stop, after commands (B, A) led to measured states (B, S)."""
        predicted = _predicted(self.plant, self._at, action, self._memory, self._rng)
        error = difference(measured, predicted, self.channels)
        score = self.usual.score(np.where(np.isfinite(error), error, np.inf), self.settings.cap)
        growth = 1.0 + np.asarray(BETS) * (score / self.usual.mean - 1.0)[:, None]
        self.capital = np.minimum(np.maximum(self.capital, 1.0) * growth, 1e300)
        self._at = measured.copy()
        return np.asarray(self.capital.mean(axis=1) >= self.threshold)
