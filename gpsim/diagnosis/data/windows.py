"""Windows: a recording cut into short pieces that are simulated side by side."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, fields, replace
from functools import cached_property
from itertools import pairwise

import numpy as np
from scipy.ndimage import binary_opening

from gpsim.channels import BoolArray, FloatArray, IntArray
from gpsim.diagnosis.settings import WindowSettings
from gpsim.effects import PRE_ROLL, even
from gpsim.recordings import Episode, Recording, evenly, gaps, pieces
from gpsim.residuals import first_held_out
from gpsim.simulators import Simulator

AT_ONCE = 2000  # windows that are completed together, however long a recording is: memory, no answer
LEAST_PART_OF_A_WINDOW = 3  # a shorter piece than one in so many parts of a window is left out
FEWEST_TRANSITIONS_OF_A_WINDOW = 3
"""And one with fewer than these, unless windows are as short [transitions]."""

LEFT_OUT = 8  # samples in a row that count in no channel, from which on they are a gap
SOUND = 0.5  # weight of a sample that is little more than usual noise
SAME_STEP = 1e-6  # relative difference of two control steps that is the rounding of a file
CLOCK = 6  # decimals of a second, rounding: equal numbers of even steps are the same age


@dataclass(frozen=True)
class Windows:
    """W windows of L transitions; shorter ones are padded and masked.

    measured: (W, L + 1, S); actions: (W, L, A); t: (W, L + 1) s; valid: (W, L + 1); episode: (W,) index.
    The last M transitions before each window: before_states (W, M, S), before_actions (W, M, A), before_t (W, M + 1);
    where the episode has none, nothing is commanded. What lies before a gap is read on an even clock that runs through
    the gap: what was commanded last is held in it. fresh: (W,) what was commanded before the window is not known: it
    begins its episode, or rows were `lost` (W,) before it (None: nowhere). weights: (W, L + 1, S) what each sample
    counts, 0 if nothing (a stale packet), None: all alike. source: (W,) from which of several recordings.
    first: (W, S) with what its episode begins; commanded: (W, A) what was commanded there before all that, times how
    long [s].
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
    first: FloatArray | None = None
    commanded: FloatArray | None = None

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
        left_out = self.before_actions[:, :first] * np.diff(self.before_t[:, : first + 1])[:, :, None]
        return replace(
            self,
            commanded=None if self.commanded is None else self.commanded + left_out.sum(axis=1),
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
    """All of `cut`'s windows of the usual length, some after the others to spare memory."""
    places = _places(recording, settings.length)
    for first in range(0, len(places), AT_ONCE):
        yield _cut_at(recording, places[first : first + AT_ONCE], settings.length)


def _places(recording: Recording, length: int) -> list[tuple[int, int, int]]:
    """Episode, first and last sample of every window."""
    least = min(length, shortest(length))
    return [
        (index, low, min(low + length, last))
        for index, first, last in stretches(recording)
        for low in range(first, last - least + 1, length + 1)
    ]


def _cut_at(recording: Recording, places: Sequence[tuple[int, int, int]], length: int) -> Windows:
    """The windows of `length` transitions at these (episode, first, last sample)."""
    index, low, high = np.array(places, dtype=np.int64).reshape(-1, 3).T
    episodes = [recording.episodes[i] for i in index]
    usual = {i: _usual_step(recording.episodes[i], recording.dt) for i in np.unique(index)}
    steps = np.array([usual[i] for i in index])
    wanted = low[:, None] + np.arange(length + 1)
    rows, valid = np.minimum(wanted, high[:, None]), wanted <= high[:, None]
    known = [_before(e, first, recording.dt, h) for e, first, h in zip(episodes, low, steps, strict=True)]
    lost = np.array(
        [
            k > 0 and bool(gaps(e.t[k - 1 : k + 1], recording.dt)[0])
            for e, k in zip(episodes, low, strict=True)
        ],
        dtype=np.bool_,
    )
    s, a = len(recording.state), len(recording.action)
    measured = _together([e.states[k] for e, k in zip(episodes, rows, strict=True)], length + 1, s)
    before_states = _together([states for states, _, _ in known], PRE_ROLL, s)
    acted = np.minimum(rows[:, :-1], high[:, None] - 1)
    weights = None
    if any(e.weights is not None for e in recording.episodes):
        given = [np.ones(e.states.shape) if e.weights is None else e.weights for e in recording.episodes]
        weights = _together([given[i][k] for i, k in zip(index, rows, strict=True)], length + 1, s)
        weights[~valid] = 1.0
    t = _together([e.t[k] for e, k in zip(episodes, rows, strict=True)], length + 1)
    _unwrap(recording, before_states, measured)
    return Windows(
        measured,
        _together([e.actions[k] for e, k in zip(episodes, acted, strict=True)], length, a),
        t + steps[:, None] * (wanted - rows),
        valid,
        before_states,
        _together([actions for _, actions, _ in known], PRE_ROLL, a),
        _together([t for _, _, t in known], PRE_ROLL + 1),
        index,
        (low == 0) | lost,
        lost,
        weights,
        np.array([e.source for e in episodes], dtype=np.int64),
        _together([e.states[0] for e in episodes], s),
        _together([_sum(e, max(0, k - PRE_ROLL)) for e, k in zip(episodes, low, strict=True)], a),
    )


def _sum(episode: Episode, end: int) -> FloatArray:
    """(A,) what was commanded before a sample, times how long."""
    return np.asarray(np.diff(episode.t[: end + 1]) @ episode.actions[:end])


def _together(parts: Sequence[FloatArray], *shape: int) -> FloatArray:
    """(W, ...) arrays of one shape, also where there are none."""
    return np.array(parts, dtype=np.float64).reshape(len(parts), *shape)


def at(recording: Recording, places: Sequence[tuple[int, int]], length: int) -> Windows:
    """Windows of `length` transitions from these (episode, sample) on; none may cross a gap or the end."""
    return _cut_at(recording, [(index, first, first + length) for index, first in places], length)


def stretches(recording: Recording) -> list[tuple[int, int, int]]:
    """(episode, first, last sample) of every stretch without a gap, all of it to learn from or all of it held out."""
    found = []
    for index, (episode, held) in enumerate(zip(recording.episodes, first_held_out(recording), strict=True)):
        ends = gaps(episode.t, recording.dt) | _unknown(episode)
        if 0 < held <= len(ends):
            ends[held - 1] = True
        parts = pieces(np.flatnonzero(ends).tolist(), len(episode))
        found += [(index, first, last) for first, last in parts if last > first]
    return found


def held_out_mask(recording: Recording, windows: Windows) -> BoolArray:
    """(W,) which windows are kept for judging."""
    begins = [
        e.t[k] if k < len(e.t) else np.inf
        for e, k in zip(recording.episodes, first_held_out(recording), strict=True)
    ]
    return np.asarray(windows.t[:, 0] >= np.array(begins)[windows.episode], dtype=np.bool_)


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
    early = episode.t[back] - step * np.arange(missing, 0, -1)
    # What is in force halfway through a step.
    row = np.searchsorted(episode.t[:back], early + step / 2, side="right")[:, None] - 1
    states = np.where(row >= 0, episode.states[row[:, 0]], episode.states[0])
    actions = np.where(row >= 0, episode.actions[np.maximum(row[:, 0], 0)], 0.0)
    return (
        np.concatenate([states, episode.states[back:low]]),
        np.concatenate([actions, episode.actions[back:low]]),
        np.concatenate([early, episode.t[back : low + 1]]),
    )


def _unwrap(recording: Recording, before: FloatArray, measured: FloatArray) -> None:
    """Let angles run on, in place, as the simulated ones do; a window's first sample stays as it was recorded."""
    for i, channel in enumerate(recording.state):
        if channel.wraps or channel.unit == "rad":
            angle = np.unwrap(np.concatenate([before[..., i], measured[..., i]], axis=1), axis=1)
            angle += measured[:, :1, i] - angle[:, [PRE_ROLL]]
            before[..., i], measured[..., i] = angle[:, :PRE_ROLL], angle[:, PRE_ROLL:]


def since_reversal(windows: Windows, simulator: Simulator) -> dict[str, FloatArray]:
    """Of every action and every coordinate's velocity: (W,) s since it turned round, at the windows' starts.

    What sticks or has play acts there. A command turns where it falls after it has risen, a velocity where it changes
    its sign. As far back as windows remember: it turned no later where they know of no reversal.
    """
    t = np.concatenate([windows.before_t[:, :-1], windows.t[:, :1]], axis=1)
    commands = np.concatenate([windows.before_actions, windows.actions[:, :1]], axis=1)
    states = np.concatenate([windows.before_states, windows.measured[:, :1]], axis=1)
    found = {
        name: _since(np.diff(commands[..., i], axis=1, prepend=commands[:, :1, i]), t)
        for i, name in enumerate(simulator.action.names)
    }
    velocities = [c.velocity for c in simulator.coordinates]
    return found | {name: _since(states[..., simulator.state.index(name)], t) for name in velocities}


def _since(course: FloatArray, t: FloatArray) -> FloatArray:
    """(W,) s since the sign of a course (W, K) last changed; where it is 0 the sign stays what it was."""
    signs = np.sign(course)
    last = np.maximum.accumulate(np.where(signs != 0, np.arange(signs.shape[1]), 0), axis=1)
    held = np.take_along_axis(signs, last, axis=1)
    turned = held[:, 1:] * held[:, :-1] < 0
    latest = turned.shape[1] - np.argmax(turned[:, ::-1], axis=1)
    at = np.where(turned.any(axis=1), latest, 0)
    return np.round(t[:, -1] - np.take_along_axis(t, at[:, None], axis=1)[:, 0], CLOCK)
