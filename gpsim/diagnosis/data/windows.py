"""Windows: a recording cut into short pieces that are simulated side by side."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, fields, replace
from functools import cached_property
from itertools import pairwise
from typing import Any

import numpy as np
from scipy.ndimage import binary_opening

from gpsim.channels import BoolArray, FloatArray, IntArray
from gpsim.diagnosis.settings import WindowSettings
from gpsim.effects import PRE_ROLL, even
from gpsim.recordings import Episode, Recording, evenly, gaps, pieces
from gpsim.residuals import first_held_out

AT_ONCE = 2000  # windows that are completed together, however long a recording is: memory, no answer
LEAST_PART_OF_A_WINDOW = 3  # a shorter piece than one in so many parts of a window is left out
FEWEST_TRANSITIONS_OF_A_WINDOW = 3
"""And one with fewer than these, unless windows are as short [transitions]."""

LEFT_OUT = 8  # samples in a row that count in no channel, from which on they are a gap
SOUND = 0.5  # weight of a sample that is little more than usual noise
SAME_STEP = 1e-6  # relative difference of two control steps that is the rounding of a file


@dataclass(frozen=True)
class Windows:
    """W windows of L transitions; shorter ones are padded and masked.

    measured: (W, L + 1, S); actions: (W, L, A); t: (W, L + 1) s; valid: (W, L + 1); episode: (W,) index.
    The last M transitions before each window: before_states (W, M, S), before_actions (W, M, A), before_t (W, M + 1);
    where the episode has none, nothing is commanded. What lies before a gap is read on an even clock that runs through
    the gap: what was commanded last is held in it. fresh: (W,) what was commanded before the window is not known: it
    begins its episode, or rows were `lost` (W,) before it (None: nowhere). weights: (W, L + 1, S) what each sample
    counts, 0 if nothing (a stale packet), None: all alike. source: (W,) from which of several recordings.
    """

    measured: FloatArray
    actions: FloatArray
    t: FloatArray
    valid: BoolArray
    before_states: FloatArray
    before_actions: FloatArray
    before_t: FloatArray
    episode: IntArray
    fresh: BoolArray
    lost: BoolArray | None = None
    weights: FloatArray | None = None
    source: IntArray | None = None

    def __len__(self) -> int:
        return len(self.episode)

    @property
    def length(self) -> int:
        """Transitions a window."""
        return int(self.actions.shape[1])

    @property
    def sources(self) -> IntArray:
        """(W,) from which of several recordings each is; all of the first where nobody says so."""
        return np.zeros(len(self), dtype=np.int64) if self.source is None else self.source

    @property
    def rested(self) -> BoolArray:
        """(W,) whether the window begins its episode, before which the system stood still."""
        return self.fresh if self.lost is None else self.fresh & ~self.lost

    @property
    def sound_ends(self) -> BoolArray:
        """(W,) whether the first and the last sample count in all channels: nothing is judged by others."""
        if self.weights is None:
            return np.ones(len(self), dtype=np.bool_)
        ends = self.weights[:, [0, -1]].min(axis=(1, 2))
        return np.asarray(ends > SOUND)

    @cached_property
    def even(self) -> bool:
        """Whether every step in the windows and before them is as long as the usual one."""
        steps = np.diff(np.concatenate([self.before_t, self.t[:, 1:]], axis=1), axis=1)
        return even(steps, np.median(steps, keepdims=True)) if steps.size else True

    @cached_property
    def own_clocks(self) -> bool:
        """Whether several episodes' clocks begin anew: their times do not say which came first."""
        every = [self.t[self.episode == e] for e in np.unique(self.episode)]
        ends = [(float(t.min()), float(t.max())) for t in every]
        return any(later[0] < earlier[1] for earlier, later in pairwise(ends))

    @cached_property
    def _shortest(self) -> FloatArray:
        """(K,) s, of 0, 1, 2 ... transitions in a row that end in a window or at its start the shortest.

        Those that begin with all that is known are left out: further back nobody can look.
        """
        clock, begin = np.concatenate([self.before_t, self.t[:, 1:]], axis=1), self.before_t.shape[1] - 1
        spans = []
        for back in range(clock.shape[1]):
            ends = clock[:, max(begin, back + 1) :]
            starts = clock[:, max(begin - back, 1) :][:, : ends.shape[1]]
            spans.append(float((ends - starts).min(initial=np.inf)))
        return np.array(spans)

    def samples_within(self, time: float) -> int:
        """How many transitions back everything lies that was so long [s] ago, from wherever that is furthest."""
        return min(int(np.searchsorted(self._shortest, time)), len(self._shortest) - 1)

    def remembering(self, samples: int) -> Windows:
        """The windows with so many transitions before them, or as many as there are."""
        first = max(self.before_actions.shape[1] - samples, 0)
        return replace(
            self,
            before_states=self.before_states[:, first:],
            before_actions=self.before_actions[:, first:],
            before_t=self.before_t[:, first:],
        )

    def take(self, rows: IntArray | BoolArray) -> Windows:
        """The windows at `rows`."""
        known = (f.name for f in fields(self) if getattr(self, f.name) is not None)
        return replace(self, **{name: getattr(self, name)[rows] for name in known})


def cut(
    recording: Recording, settings: WindowSettings, length: int | None = None, most: int | None = None
) -> Windows:
    """Non-overlapping windows that share no sample; pieces of much less than a window are left out.

    None holds both samples to learn from and held-out ones. length: transitions of a window, the usual one without it;
    most: evenly spread ones are taken where there are more.
    """
    length = length or settings.length
    places = _places(recording, length)
    if most is not None:
        places = [places[i] for i in evenly(len(places), most)]
    return _cut_at(recording, places, length)


def cut_in_parts(recording: Recording, settings: WindowSettings) -> Iterator[Windows]:
    """All of `cut`'s windows of the usual length, no more than `at_once` in memory."""
    places, size = _places(recording, settings.length), AT_ONCE
    for first in range(0, len(places), size):
        yield _cut_at(recording, places[first : first + size], settings.length)


def _places(recording: Recording, length: int) -> list[tuple[int, int, int]]:
    """Episode, first and last sample of every window."""
    return [
        (index, low, high)
        for index, first, last in stretches(recording)
        for low, high in _slices(first, last, length, shortest(length))
    ]


def _cut_at(recording: Recording, places: Sequence[tuple[int, int, int]], length: int) -> Windows:
    steps = _usual_steps(recording, [index for index, _, _ in places])
    weighed = any(e.weights is not None for e in recording.episodes)  # then all windows have weights
    parts = [
        _window(recording, index, steps[index], low, high, length, weighed) for index, low, high in places
    ]
    return _stacked(parts) if parts else _none(recording, length)


def at(recording: Recording, places: Sequence[tuple[int, int]], length: int) -> Windows:
    """Windows of `length` transitions from these (episode, sample) on; none may cross a gap or the end."""
    return _cut_at(recording, [(index, first, first + length) for index, first in places], length)


def _stacked(parts: Sequence[tuple[Any, ...]]) -> Windows:
    columns = ([part[i] for part in parts] for i in range(len(fields(Windows))))
    return Windows(*(None if column[0] is None else np.stack(column) for column in columns))  # type: ignore[arg-type]


def stretches(recording: Recording) -> list[tuple[int, int, int]]:
    """(episode, first, last sample) of every stretch without a gap, all of it to learn from or all of it held out."""
    return [
        (index, int(first), int(last))
        for index, (episode, held) in enumerate(
            zip(recording.episodes, first_held_out(recording), strict=True)
        )
        for first, last in _pieces(episode, recording.dt, int(held))
    ]


def held_out_mask(recording: Recording, windows: Windows) -> BoolArray:
    """(W,) which windows are kept for judging."""
    begins = [
        e.t[k] if k < len(e.t) else np.inf
        for e, k in zip(recording.episodes, first_held_out(recording), strict=True)
    ]
    return np.asarray(windows.t[:, 0] >= np.array(begins)[windows.episode], dtype=np.bool_)


def _pieces(episode: Episode, dt: float, held: int) -> list[tuple[int, int]]:
    """First and last sample of every stretch without a gap; sample `held` begins one."""
    breaks = set(np.flatnonzero(gaps(episode.t, dt) | _unknown(episode)).tolist())
    ends = sorted((breaks | {held - 1}) & set(range(len(episode.t) - 1)))
    return [(first, last) for first, last in pieces(ends, len(episode.t) - 1) if last > first]


def _unknown(episode: Episode) -> BoolArray:
    """(K,) transitions in a stretch in which no sample counts in any channel: so much was left out, not repeated."""
    if episode.weights is None:
        return np.zeros(len(episode.t) - 1, dtype=np.bool_)
    nothing = (episode.weights <= 0.0).all(axis=1)
    long = binary_opening(nothing, np.ones(LEFT_OUT))
    return np.asarray(long[:-1] | long[1:])


def shortest(length: int) -> int:
    """Transitions of the shortest piece that is a window of such a length, padded."""
    return max(FEWEST_TRANSITIONS_OF_A_WINDOW, length // LEAST_PART_OF_A_WINDOW)


def _slices(first: int, last: int, length: int, least: int) -> list[tuple[int, int]]:
    out, low = [], first
    while last - low >= min(length, least):
        high = min(low + length, last)
        out.append((low, high))
        low = high + 1
    return out


def _window(
    recording: Recording,
    index: int,
    step: float,
    low: int,
    high: int,
    length: int,
    weighed: bool,
) -> tuple[Any, ...]:
    """step: the usual one of its episode [s]."""
    count, dt, episode = high - low, recording.dt, recording.episodes[index]
    pad = length - count
    measured = np.concatenate(
        [episode.states[low : high + 1], np.repeat(episode.states[high : high + 1], pad, axis=0)]
    )
    actions = np.concatenate(
        [episode.actions[low:high], np.repeat(episode.actions[high - 1 : high], pad, axis=0)]
    )
    t = np.concatenate([episode.t[low : high + 1], episode.t[high] + step * np.arange(1, pad + 1)])
    valid = np.arange(length + 1) <= count
    weights = np.ones(measured.shape) if weighed else None
    if weights is not None and episode.weights is not None:
        weights[: count + 1] = episode.weights[low : high + 1]
    before_states, before_actions, before_t = _before(episode, low, dt, step)
    _unwrap(recording, before_states, measured)
    lost = low > 0 and bool(gaps(episode.t[low - 1 : low + 1], dt)[0])
    return (
        measured,
        actions,
        t,
        valid,
        before_states,
        before_actions,
        before_t,
        np.int64(index),
        np.bool_(low == 0 or lost),
        np.bool_(lost),
        weights,
        np.int64(episode.source),
    )


def _usual_steps(recording: Recording, episodes: Sequence[int]) -> dict[int, float]:
    return {index: _usual_step(recording.episodes[index], recording.dt) for index in set(episodes)}


def _usual_step(episode: Episode, dt: float) -> float:
    """The step [s] of samples that were not recorded: one that is off would make an even clock uneven."""
    usual = float(np.median(np.diff(episode.t)))
    return usual if abs(usual - dt) > SAME_STEP * dt else dt


def _before(episode: Episode, low: int, dt: float, step: float) -> tuple[FloatArray, FloatArray, FloatArray]:
    """States (M, S), actions (M, A) and t (M + 1,) s of the last transitions before sample `low`."""
    back = max(0, low - PRE_ROLL)
    broken = np.flatnonzero(gaps(episode.t[back : low + 1], dt))
    if len(broken):  # the rows before it are of another time than their number says
        back += int(broken[-1]) + 1
    missing = PRE_ROLL - (low - back)
    if not missing:
        return np.array(episode.states[back:low]), episode.actions[back:low], episode.t[back : low + 1]
    early = episode.t[back] - step * np.arange(missing, 0, -1)
    row = (
        np.searchsorted(episode.t[:back], early + step / 2, side="right") - 1
    )  # in force halfway through a step
    states = np.where(row[:, None] >= 0, episode.states[row], episode.states[0])
    actions = np.where(row[:, None] >= 0, episode.actions[np.maximum(row, 0)], 0.0)
    return (
        np.concatenate([states, episode.states[back:low]]),
        np.concatenate([actions, episode.actions[back:low]]),
        np.concatenate([early, episode.t[back : low + 1]]),
    )


def _unwrap(recording: Recording, before: FloatArray, measured: FloatArray) -> None:
    """Let angles run on, in place, as the simulated ones do; the window's first sample stays as it was recorded."""
    for i, channel in enumerate(recording.state):
        if channel.wraps or channel.unit == "rad":
            angle = np.unwrap(np.concatenate([before[:, i], measured[:, i]]))
            angle += measured[0, i] - angle[len(before)]
            before[:, i], measured[:, i] = angle[: len(before)], angle[len(before) :]


def _none(recording: Recording, length: int) -> Windows:
    s, a = len(recording.state), len(recording.action)
    return Windows(
        np.empty((0, length + 1, s)),
        np.empty((0, length, a)),
        np.empty((0, length + 1)),
        np.empty((0, length + 1), dtype=np.bool_),
        np.empty((0, PRE_ROLL, s)),
        np.empty((0, PRE_ROLL, a)),
        np.empty((0, PRE_ROLL + 1)),
        np.empty(0, dtype=np.int64),
        np.empty(0, dtype=np.bool_),
        np.empty(0, dtype=np.bool_),
        source=np.empty(0, dtype=np.int64),
    )
