"""One log to episodes: where all topics speak, on one grid, with every row accounted for."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from gpsim.channels import FloatArray, wrap_angle
from gpsim.errors import UsageError
from gpsim.recordings import clock, signals
from gpsim.recordings import episodes as where
from gpsim.recordings.episodes import Interval
from gpsim.recordings.mapping import ChannelSource, ImportMapping
from gpsim.recordings.recording import Episode
from gpsim.recordings.signals import MOST_SAMPLES
from gpsim.recordings.tracks import Bound, TopicCount, Track, at_times, samples


@dataclass(frozen=True)
class Assembled:
    """The episodes of one log (t on the log's own clock) and what became of every row."""

    episodes: tuple[Episode, ...]
    counts: tuple[TopicCount, ...]
    longest_hold: float


_Stage = tuple[str, list[Interval]]
"""What rows outside of the intervals are dropped for, and the intervals that are left."""


def assemble(source: str, tracks: Mapping[str, Track], mapping: Bound) -> Assembled:
    """Cut the log into episodes and put every channel on their grids; tracks: by their names, on one clock."""
    flag = None if mapping.flag is None else tracks[mapping.flag.track]
    state = {s.track: tracks[s.track] for s in mapping.measured}
    action = {s.track: tracks[s.track] for s in mapping.action}
    margin = _margin(state, mapping)
    stages = _stages(state, action, flag, mapping, margin)
    pieces = stages[-1][1]
    seconds = sum(b - a for a, b in pieces)
    if mapping.rate is not None and seconds * mapping.rate > MOST_SAMPLES:
        # Before anything is allocated: a rate that no computer could hold is a slip of the pen, or of the clock's unit.
        raise UsageError(
            f"{source}: rate {mapping.rate:g} Hz over {seconds:.6g} s makes over {MOST_SAMPLES:.0e} samples; lower "
            "the rate, or correct the unit of time (time.scale=1e-3 for milliseconds)"
        )
    reference = tracks[mapping.measured[0].track]
    built = [_episode(piece, reference, tracks, mapping, margin) for piece in pieces]
    episodes = tuple(episode for episode in built if episode is not None)
    kept = [(float(e.t[0]), float(e.t[-1])) for e in episodes]
    stages.append(("in a stretch that is too short, or after its last step", kept))
    every = {**action, **state} | ({flag.count.name: flag} if flag is not None else {})
    counts = tuple(_count(track, stages, held=name not in state) for name, track in every.items())
    longest = 0.0
    for track in action.values():
        for episode in episodes:
            new = track.t[(track.t > episode.t[0]) & (track.t < episode.t[-1])]
            longest = max(longest, float(np.diff(np.concatenate([episode.t[:1], new, episode.t[-1:]])).max()))
    return Assembled(episodes, counts, longest)


def _stages(
    state: Mapping[str, Track],
    action: Mapping[str, Track],
    flag: Track | None,
    mapping: ImportMapping,
    margin: float,
) -> list[_Stage]:
    """The rules one after the other, each on what the last one left."""
    end = min((float(track.t[-1]) for track in state.values() if len(track.t)), default=-np.inf)
    solid = [(-np.inf, np.inf)]
    for track in state.values():
        solid = where.common(solid, where.runs(track.t))
    for track in action.values():
        solid = where.common(solid, where.standing(track.t, end))
    stages = [("before the first or after the last of another topic", solid)]
    for track in state.values():
        solid = where.common(solid, where.runs(track.t, np.diff(track.t) > mapping.gap_limit * (1.0 + 1e-9)))
    stages.append((f"in a gap over {mapping.gap_limit:g} s", solid))
    if mapping.hold_limit is not None:
        for track in action.values():
            solid = where.common(solid, where.standing(track.t, end, mapping.hold_limit))
        stages.append((f"no command within {mapping.hold_limit:g} s", solid))
    rule = mapping.episodes
    if flag is not None:
        values = flag.fields[rule.field or ""]
        pieces, reason = where.runs(flag.t, np.diff(values) != 0), f"between values of {rule.field}"
        if rule.by == "flag":
            pieces, own = where.standing(flag.t, end, on=values == rule.equals), flag.count.topic
            topic = "" if own in {track.count.topic for track in state.values()} else f" of {own}"
            reason = f"{rule.field}{topic} is not {rule.equals:g}"
        solid = where.common(solid, pieces)
        stages.append((reason, solid))
    if rule.min_duration > 0:
        solid = [(a, b) for a, b in solid if b - a >= rule.min_duration]
        stages.append((f"in a piece shorter than {rule.min_duration:g} s", solid))
    if margin > 0:
        solid = [(a + margin, b - margin) for a, b in solid if b - a > 2.0 * margin]
        stages.append(("at an edge without a full smoothing window", solid))
    return stages


def _margin(state: Mapping[str, Track], mapping: ImportMapping) -> float:
    """Seconds at either end of a piece that smoothing and differentiation cannot serve."""
    needed = [0.0]
    made = {source.derivative_of for source in mapping.state}
    for source in mapping.measured:
        t = state[source.track].t
        interval = float(np.median(np.diff(t))) if len(t) > 1 else 0.0
        if source.name in made and mapping.velocities.edges == "trim":
            needed.append(interval * signals.reach(mapping.velocities, derivative=True))
        if source.name in mapping.smoothing.channels and mapping.smoothing.edges == "trim":
            needed.append(interval * signals.reach(mapping.smoothing, derivative=False))
    return max(needed)


def _episode(
    piece: Interval, reference: Track, tracks: Mapping[str, Track], mapping: ImportMapping, margin: float
) -> Episode | None:
    """Every channel on the piece's grid; None when fewer than two samples fit.

    The grid is the reference's own stamps, or even steps from its first stamp in the piece.
    """
    at = reference.t[where.inside(reference.t, [piece])]
    if mapping.rate is not None and len(at):
        steps = int(np.floor((piece[1] - at[0]) * mapping.rate + 1e-6))
        at = np.asarray(at[0] + np.arange(steps + 1) / mapping.rate, dtype=np.float64)
    if len(at) < 2:
        return None
    whole = (piece[0] - margin, piece[1] + margin)
    by_name = {source.name: source for source in mapping.state}
    origins = [source for source in mapping.measured if mapping.filters(source.name)]
    if any(where.inside(tracks[s.track].t, [whole]).sum() < 2 for s in origins):
        return None  # nothing to differentiate

    def filtered(source: ChannelSource, made: Callable[[FloatArray, float], FloatArray]) -> FloatArray:
        """Smooth (and differentiate) the piece at the source's own rate, then read it at the grid."""
        track = tracks[source.track]
        rows = np.flatnonzero(where.inside(track.t, [whole]))
        even = signals.even_grid(track.t[rows])
        on_even = np.interp(even, track.t[rows], samples(source, track, rows))
        return np.interp(at, even, made(on_even, float(even[1] - even[0])))

    columns, commands = [], []
    for source in mapping.state:
        if source.derivative_of is not None:
            origin = by_name[source.derivative_of]
            rate = filtered(origin, lambda v, step: signals.derivative(v, step, mapping.velocities))
            columns.append(source.sign * source.scale * rate + source.offset)
        elif source.name in mapping.smoothing.channels:
            smooth = filtered(source, lambda v, _: signals.smoothed(v, mapping.smoothing))
            columns.append(wrap_angle(smooth) if source.wraps else smooth)
        else:
            columns.append(at_times(source, tracks[source.track], at))
    for source in mapping.action:
        t, values = tracks[source.track].t, samples(source, tracks[source.track])
        mean = mapping.commands == "mean"
        commands.append(clock.held_mean(at, t, values) if mean else clock.held(at[:-1], t, values))
    actions = np.stack(commands, axis=1) if commands else np.zeros((len(at) - 1, 0))
    return Episode("", at, np.stack(columns, axis=1), actions)


def _count(track: Track, stages: Sequence[_Stage], *, held: bool) -> TopicCount:
    """Give every row that is out to the first rule that put it out."""
    inside = where.stands_inside if held else where.inside
    left = np.ones(len(track.t), dtype=np.bool_)
    dropped = dict(track.count.dropped)
    for reason, intervals in stages:
        now = left & inside(track.t, intervals)
        lost = int(left.sum() - now.sum())
        if lost:
            dropped[reason] = dropped.get(reason, 0) + lost
        left = now
    return replace(track.count, kept=int(left.sum()), dropped=dropped)
