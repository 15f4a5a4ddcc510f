"""Log facts: what is peculiar to a log and no physics, found in the recording alone, whatever the simulator.

Missing rows and an uneven clock are counted, windows know of them. A channel's grid is noise of a known size. Samples
that repeat an old value or leap away and come back say nothing of the motion: no likelihood, no step and no rollout
rests on them; where a state is needed there it is read between its neighbours. Whether a topic is late is not told
here: from one recording a late channel cannot be told from a late sensor, which is an effect of the catalogue
(`sensor_delay`); nor are clocks that drift apart, which an importer has put on one clock already.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from gpsim.channels import BoolArray, Channel, FloatArray, wrap_angle
from gpsim.diagnosis.data import held_with, outliers, quantum, repeats, whole_packets
from gpsim.diagnosis.report import LogFact
from gpsim.diagnosis.settings import LogFactSettings
from gpsim.diagnosis.setup.readings import hiding
from gpsim.recordings import Episode, Recording, gaps, pieces, steps_to_next

CLOCK_JITTER = 0.01  # of the clock's step, by which steps must scatter to be uneven

QUANTISED = 1.0 / np.sqrt(12.0)  # standard deviation of what rounding to a grid of 1 leaves over


@dataclass(frozen=True)
class LogLook:
    """What a log is like.

    facts: in the order of the channels, those of the whole log last; left_out: of each episode (K + 1, S) the samples
    on which nothing may rest; quantised: channel -> its grid's step, in its unit.
    """

    facts: tuple[LogFact, ...]
    left_out: tuple[BoolArray, ...]
    quantised: dict[str, float]


@dataclass(frozen=True)
class _Stretch:
    """Samples without a gap between them: `first` of an episode (its number) on; states with angles running on."""

    episode: int
    first: int
    t: FloatArray
    states: FloatArray
    actions: FloatArray

    @property
    def rows(self) -> slice:
        """Where in its episode."""
        return slice(self.first, self.first + len(self.t))


def flagged(recording: Recording, settings: LogFactSettings | None = None) -> list[BoolArray]:
    """(K + 1, S) of every episode: the samples that repeat or leap; by the default settings where none are given."""
    return list(look_at(recording, settings or LogFactSettings()).left_out)


def look_at(recording: Recording, settings: LogFactSettings) -> LogLook:
    """Everything that is peculiar to a recording, channel by channel."""
    stretches = list(_stretches(recording))
    grids = [_grid(stretches, i) for i in range(len(recording.state))]
    stale, wild = _samples(recording, stretches, grids, settings)
    facts: list[LogFact] = []
    for i, channel in enumerate(recording.state):
        repeated, leaps = (sum(int(f[:, i].sum()) for f in flags) for flags in (stale, wild))
        facts += [LogFact("repeated", channel.name, repeated)] if repeated else []
        facts += [LogFact("outliers", channel.name, leaps)] if leaps else []
        facts += [LogFact("quantised", channel.name, value=grids[i], unit=channel.unit)] if grids[i] else []
    left_out = [np.zeros(e.states.shape, dtype=np.bool_) for e in recording.episodes]
    for s, old, out in zip(stretches, stale, wild, strict=True):
        left_out[s.episode][s.rows] = old | out
    quantised = {name: step for name, step in zip(recording.state.names, grids, strict=True) if step}
    return LogLook((*facts, *_of_the_clock(recording)), tuple(left_out), quantised)


def _samples(
    recording: Recording,
    stretches: Sequence[_Stretch],
    grids: Sequence[float | None],
    settings: LogFactSettings,
) -> tuple[list[BoolArray], list[BoolArray]]:
    """(K, S) of each stretch, which samples are stale, and which are outliers."""
    stale, wild = ([np.zeros(s.states.shape, dtype=np.bool_) for s in stretches] for _ in range(2))
    actions = [s.actions for s in stretches]
    for i, channel in enumerate(recording.state):
        series, step = [s.states[:, i] for s in stretches], grids[i] or 0.0
        found = outliers(series, actions, step, _angle(channel), settings)
        for s, y, flags, out, old in zip(stretches, series, found, wild, stale, strict=True):
            out[:, i], old[:, i] = flags, repeats(s.t, y, step, settings)
    hidden = hiding(recording)
    for s, old, out in zip(stretches, stale, wild, strict=True):
        together = old.any(axis=1) | whole_packets(s.t, s.states, settings)
        for i in range(len(grids)):
            old[:, i] |= held_with(together, s.states[:, i], grids[i] or 0.0)
        out &= ~old  # in a steady motion what stands still leaps away, too
        # What a sensor does at its range's end, or in its zone, is no packet's fault.
        old &= ~hidden[s.episode][s.rows]
        out &= ~hidden[s.episode][s.rows]
    return stale, wild


def mended(recording: Recording, left_out: tuple[BoolArray, ...]) -> Recording:
    """The recording whose left-out samples count for nothing and lie between their neighbours."""
    if not any(flags.any() for flags in left_out):
        return recording
    episodes = tuple(
        _mended(episode, flags, tuple(recording.state))
        for episode, flags in zip(recording.episodes, left_out, strict=True)
    )
    return replace(recording, episodes=episodes)


def _mended(episode: Episode, left_out: BoolArray, channels: tuple[Channel, ...]) -> Episode:
    states = np.array(episode.states)
    for i, channel in enumerate(channels):
        kept = ~left_out[:, i]
        if kept.all() or not kept.any():
            continue
        y = np.unwrap(states[kept, i]) if _angle(channel) else states[kept, i]
        between = np.interp(episode.t[~kept], episode.t[kept], y)
        states[~kept, i] = wrap_angle(between) if channel.wraps else between
    given = np.ones(left_out.shape) if episode.weights is None else episode.weights
    return replace(episode, states=states, weights=np.where(left_out, 0.0, given))


def _stretches(recording: Recording) -> Iterator[_Stretch]:
    for index, episode in enumerate(recording.episodes):
        ends = np.flatnonzero(gaps(episode.t, recording.dt)).tolist()
        for first, last in pieces(ends, len(episode)):
            states = np.array(episode.states[first : last + 1])
            for i, channel in enumerate(recording.state):
                if _angle(channel):
                    states[:, i] = np.unwrap(states[:, i])
            yield _Stretch(index, first, episode.t[first : last + 1], states, episode.actions[first:last])


def _grid(stretches: list[_Stretch], channel: int) -> float | None:
    return quantum([s.states[:, channel] for s in stretches], [s.actions for s in stretches])


def _angle(channel: Channel) -> bool:
    """Whether a channel may wrap, as windows take it."""
    return channel.wraps or channel.unit == "rad"


def _of_the_clock(recording: Recording) -> list[LogFact]:
    """Rows that are missing, and an uneven clock."""
    facts, dt = [], recording.dt
    lost, longest = 0, 0.0
    for e in recording.episodes:
        counts = steps_to_next(e.t, np.zeros(len(e.t), dtype=np.int64), dt) - 1
        lost += int(counts.sum())
        longest = max(longest, float(np.diff(e.t).max(initial=0.0)))
    if lost:
        facts.append(LogFact("missing", count=lost, value=longest, unit="s"))
    steps = np.concatenate([np.diff(e.t)[~gaps(e.t, dt)] for e in recording.episodes])
    scatter = float(steps.std()) if len(steps) else 0.0
    if scatter > CLOCK_JITTER * dt:
        facts.append(LogFact("jitter", value=scatter, unit="s"))
    return facts
