"""One log to episodes: where all topics speak, on one grid, with every row accounted for."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from gpsim.channels import FloatArray, wrap_angle
from gpsim.errors import UsageError
from gpsim.recordings import clock, signals
from gpsim.recordings import episodes as where
from gpsim.recordings.episodes import Interval
from gpsim.recordings.mapping import ChannelSource, ImportMapping, Smoothing, track_name
from gpsim.recordings.recording import Episode
from gpsim.recordings.signals import MOST_SAMPLES
from gpsim.recordings.tracks import Track, at_times, samples


@dataclass(frozen=True)
class TopicCount:
    """One topic of one log. read = kept + sum(dropped); noticed: kept, but odd.

    kept: rows inside an episode (for commands: rows that stood at some moment of one). delay: median, 5 % and
    95 % of receive minus header [s], None without a header; drift: least and largest of its running median [s].
    part: the channels that are counted, where not all of the topic are found in the same rows.
    """

    source: str
    topic: str
    type: str
    clock: str
    read: int
    kept: int
    dropped: Mapping[str, int] = field(default_factory=dict)
    noticed: Mapping[str, int] = field(default_factory=dict)
    delay: tuple[float, float, float] | None = None
    drift: tuple[float, float] | None = None
    part: str = ""

    @property
    def name(self) -> str:
        """The topic, and which part of it."""
        return track_name(self.topic, self.part)

    def __post_init__(self) -> None:
        if self.read != self.kept + sum(self.dropped.values()):
            raise AssertionError(
                f"{self.source} {self.topic}: {self.read} rows read, but {self.kept} kept and {self.dropped}"
            )


@dataclass(frozen=True)
class Assembled:
    """The episodes of one log (t on the log's own clock) and what became of every row."""

    episodes: tuple[Episode, ...]
    counts: tuple[TopicCount, ...]
    longest_hold: float


@dataclass(frozen=True)
class _Stage:
    """Intervals that are left after one rule; `reason` is what rows outside are dropped for."""

    reason: str
    intervals: list[Interval]


def assemble(
    source: str, tracks: Mapping[str, Track], mapping: ImportMapping, flag: Track | None
) -> Assembled:
    """Cut the log into episodes and put every channel on their grids.

    tracks: by their names, already on one clock; flag: the track of `episodes.field`, if there is one.
    """
    state = {source_.track: tracks[source_.track] for source_ in mapping.measured}
    action = {source_.track: tracks[source_.track] for source_ in mapping.action}
    stages = _stages(state, action, flag, mapping)
    reference = tracks[mapping.measured[0].track]
    _refuse_too_many(source, stages[-1].intervals, mapping)
    built = [_episode(piece, reference, tracks, mapping) for piece in stages[-1].intervals]
    episodes = tuple(episode for episode in built if episode is not None)
    stages.append(
        _Stage(
            "in a piece too short or past its last step", [(float(e.t[0]), float(e.t[-1])) for e in episodes]
        )
    )
    every = {**action, **state} | ({flag.name: flag} if flag is not None else {})
    held = {name for name in every if name not in state}
    counts = tuple(_count(source, track, stages, name in held) for name, track in every.items())
    return Assembled(episodes, counts, _longest_hold(action, episodes))


def _refuse_too_many(source: str, pieces: Sequence[Interval], mapping: ImportMapping) -> None:
    """Before anything is allocated: a rate that no computer could hold is a slip of the pen, or of the clock's unit."""
    if mapping.rate is None:
        return
    seconds = sum(b - a for a, b in pieces)
    if seconds * mapping.rate > MOST_SAMPLES:
        raise UsageError(
            f"{source}: rate {mapping.rate:g} Hz over {seconds:.6g} s would make {seconds * mapping.rate:.3g} samples, "
            f"the limit is {MOST_SAMPLES:.0e}; choose a lower rate, or see whether the time column is in seconds "
            "(time.scale=1e-3 takes it as milliseconds)"
        )


def _stages(
    state: Mapping[str, Track], action: Mapping[str, Track], flag: Track | None, mapping: ImportMapping
) -> list[_Stage]:
    """The rules one after the other, each on what the last one left."""
    end = min((float(track.t[-1]) for track in state.values() if len(track.t)), default=-np.inf)
    hull = [(-np.inf, np.inf)]
    for track in state.values():
        hull = where.common(hull, where.covered(track.t, None))
    for track in action.values():
        hull = where.common(hull, where.standing(track.t, None, end))
    stages = [_Stage("before the first or after the last of another topic", hull)]

    solid = hull
    for track in state.values():
        solid = where.common(solid, where.covered(track.t, mapping.gap_limit))
    stages.append(_Stage(f"in a gap over {mapping.gap_limit:g} s", solid))
    if mapping.hold_limit is not None:
        for track in action.values():
            solid = where.common(solid, where.standing(track.t, mapping.hold_limit, end))
        stages.append(_Stage(f"no command within {mapping.hold_limit:g} s", solid))
    if flag is not None:
        values = flag.fields[mapping.episodes.field or ""]
        if mapping.episodes.by == "flag":
            pieces = where.flagged(flag.t, values == mapping.episodes.equals, end)
            topic = "" if flag.topic in {track.topic for track in state.values()} else f" of {flag.topic}"
            reason = f"{mapping.episodes.field}{topic} is not {mapping.episodes.equals:g}"
        else:
            pieces, reason = (
                where.constant_pieces(flag.t, values),
                f"between values of {mapping.episodes.field}",
            )
        solid = where.common(solid, pieces)
        stages.append(_Stage(reason, solid))
    if mapping.episodes.min_duration > 0:
        solid = [(a, b) for a, b in solid if b - a >= mapping.episodes.min_duration]
        stages.append(_Stage(f"in a piece shorter than {mapping.episodes.min_duration:g} s", solid))
    margin = _margin(state, mapping)
    if margin > 0:
        solid = [(a + margin, b - margin) for a, b in solid if b - a > 2.0 * margin]
        stages.append(_Stage("edge that the smoothing window cannot reach", solid))
    return stages


def _margin(state: Mapping[str, Track], mapping: ImportMapping) -> float:
    """Seconds at either end of a piece that smoothing and differentiation cannot serve."""
    needed = [0.0]
    for source in mapping.measured:
        interval = _interval(state[source.track])
        name = source.name
        if any(s.derivative_of == name for s in mapping.state) and mapping.velocities.edges == "trim":
            needed.append(interval * signals.reach(mapping.velocities, derivative=True))
        if name in mapping.smoothing.channels and mapping.smoothing.edges == "trim":
            needed.append(interval * signals.reach(mapping.smoothing, derivative=False))
    return max(needed)


def _interval(track: Track) -> float:
    return float(np.median(np.diff(track.t))) if len(track.t) > 1 else 0.0


def grid(piece: Interval, reference: Track, rate: float | None) -> FloatArray:
    """Times of an episode: the reference's own stamps, or even steps from its first stamp in the piece."""
    own = reference.t[where.inside(reference.t, [piece])]
    if rate is None or not len(own):
        return own
    steps = int(np.floor((piece[1] - own[0]) * rate + 1e-6))
    return np.asarray(own[0] + np.arange(steps + 1) / rate, dtype=np.float64)


def _episode(
    piece: Interval, reference: Track, tracks: Mapping[str, Track], mapping: ImportMapping
) -> Episode | None:
    """Every channel on the piece's grid; None when fewer than two samples fit."""
    at = grid(piece, reference, mapping.rate)
    if len(at) < 2:
        return None
    margin = _margin({s.track: tracks[s.track] for s in mapping.measured}, mapping)
    whole = (piece[0] - margin, piece[1] + margin)
    by_name = {source.name: source for source in mapping.state}
    origins = [source for source in mapping.measured if mapping.filters(source.name)]
    if any(where.inside(tracks[s.track].t, [whole]).sum() < 2 for s in origins):
        return None  # nothing to differentiate
    columns = []
    for source in mapping.state:
        if source.derivative_of is not None:
            origin = by_name[source.derivative_of]
            rate = _filtered(origin, tracks[origin.track], whole, at, mapping.velocities, derivative=True)
            columns.append(source.sign * source.scale * rate + source.offset)
        elif source.name in mapping.smoothing.channels:
            smooth = _filtered(source, tracks[source.track], whole, at, mapping.smoothing, derivative=False)
            columns.append(wrap_angle(smooth) if source.wraps else smooth)
        else:
            columns.append(at_times(source, tracks[source.track], at))
    commands = [_command(source, tracks[source.track], at, mapping) for source in mapping.action]
    actions = np.stack(commands, axis=1) if commands else np.zeros((len(at) - 1, 0))
    return Episode("", at, np.stack(columns, axis=1), actions)


def _filtered(
    source: ChannelSource,
    track: Track,
    piece: Interval,
    at: FloatArray,
    smoothing: Smoothing,
    derivative: bool,
) -> FloatArray:
    """Smooth (and differentiate) the piece at the source's own rate, then read it at the grid."""
    rows = np.flatnonzero(where.inside(track.t, [piece]))
    t, values = track.t[rows], samples(source, track, rows)
    even = signals.even_grid(t)
    on_even = np.interp(even, t, values)
    step = float(even[1] - even[0])
    made = (
        signals.derivative(on_even, step, smoothing) if derivative else signals.smoothed(on_even, smoothing)
    )
    return np.interp(at, even, made)


def _command(source: ChannelSource, track: Track, at: FloatArray, mapping: ImportMapping) -> FloatArray:
    values = samples(source, track)
    if mapping.commands == "mean":
        return clock.held_mean(at, track.t, values)
    return clock.held(at[:-1], track.t, values)


def _count(source: str, track: Track, stages: Sequence[_Stage], held: bool) -> TopicCount:
    """Give every row that is out to the first rule that put it out."""
    inside = where.stands_inside if held else where.inside
    left = np.ones(len(track.t), dtype=np.bool_)
    dropped = dict(track.dropped)
    for stage in stages:
        now = left & inside(track.t, stage.intervals)
        lost = int(left.sum() - now.sum())
        if lost:
            dropped[stage.reason] = dropped.get(stage.reason, 0) + lost
        left = now
    return TopicCount(
        source,
        track.topic,
        track.type,
        track.clock,
        track.read,
        int(left.sum()),
        dropped,
        track.noticed,
        track.delay,
        track.drift,
        track.part,
    )


def _longest_hold(action: Mapping[str, Track], episodes: Sequence[Episode]) -> float:
    """The longest time inside an episode during which no new command came [s]."""
    longest = 0.0
    for track in action.values():
        for episode in episodes:
            new = track.t[(track.t > episode.t[0]) & (track.t < episode.t[-1])]
            longest = max(longest, float(np.diff(np.concatenate([episode.t[:1], new, episode.t[-1:]])).max()))
    return longest
