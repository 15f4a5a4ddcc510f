"""Logs and a mapping to a Recording and the report of how it came about, in numbers that add up."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from gpsim.errors import UsageError
from gpsim.recordings import guessing, signals, soundness
from gpsim.recordings.assembling import Assembled, assemble
from gpsim.recordings.episodes import hold_out
from gpsim.recordings.mapping import ChannelSource, ImportMapping, Smoothing
from gpsim.recordings.raw import NamedLog
from gpsim.recordings.recording import Episode, Recording
from gpsim.recordings.tracks import MISSING, Inspector, Part, TopicCount, read_parts
from gpsim.recordings.values import LARGEST


@dataclass(frozen=True)
class EpisodeCount:
    """One episode: name, the log it is from, start after `epoch` on that log's clock [s], duration [s]."""

    name: str
    source: str
    start: float
    duration: float
    transitions: int
    epoch: float = 0.0


@dataclass(frozen=True)
class ImportReport:
    """Everything an import decided. notes: sentences; warnings: sentences that ask for a second look."""

    topics: tuple[TopicCount, ...]
    episodes: tuple[EpisodeCount, ...]
    rate: str
    lags: tuple[signals.Lag, ...] = ()
    applied: Mapping[str, float] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
    warnings: tuple[str, ...] = ()

    def summed(self) -> tuple[TopicCount, ...]:
        """The topics with the logs added up."""
        groups: dict[tuple[str, str, str, str], list[TopicCount]] = {}
        sources = {count.source for count in self.topics}
        pairs = {(count.source, count.topic) for count in self.topics}
        alone = len(sources) == len(pairs) and len({count.topic for count in self.topics}) > 1
        for count in self.topics:  # tables are called as their files: add up what is alone in its log
            topic = f"the table of each of {len(sources)} logs" if alone else count.topic
            groups.setdefault((topic, count.part, count.type, count.clock), []).append(count)
        return tuple(_sum(topic, group) for (topic, *_), group in groups.items())

    def as_metadata(self) -> dict[str, Any]:
        """Plain numbers for recording.yaml."""
        return {
            "topics": {
                f"{c.name} ({c.clock})": {"read": c.read, "kept": c.kept}
                | ({"dropped": dict(c.dropped)} if c.dropped else {})
                | ({"noticed": dict(c.noticed)} if c.noticed else {})
                for c in self.summed()
            },
            "lags": {
                lag.command: {
                    "response": lag.response,
                    "lag_s": round(lag.lag, 4),
                    "correlation": round(lag.correlation, 3),
                }
                for lag in self.lags
                if lag.usable
            },
            "offsets_applied_s": {topic: round(value, 6) for topic, value in self.applied.items()},
        }


def _sum(topic: str, group: Sequence[TopicCount]) -> TopicCount:
    first = group[0]
    delays = [count.delay for count in group if count.delay is not None]
    return replace(
        first,
        source=first.source if len(group) == 1 else f"{len(group)} logs",
        topic=topic,
        read=sum(c.read for c in group),
        kept=sum(c.kept for c in group),
        dropped=dict(sum((Counter(c.dropped) for c in group), Counter())),
        noticed=dict(sum((Counter(c.noticed) for c in group), Counter())),
        delay=delays[len(delays) // 2] if delays else None,
        drift=None,
    )


def import_logs(
    logs: Sequence[NamedLog], mapping: ImportMapping, inspect: Inspector
) -> tuple[Recording, ImportReport]:
    """Read every log, make episodes of it, and put them into one recording.

    Raises UsageError (what, where, remedy) when a topic or field is missing, damage is found that `inspect`
    refuses, or no episode is left.
    """
    parts = [part for log in logs for part in read_parts(log, mapping, inspect)]
    _check_clock(mapping, parts)
    shifts: dict[str, float] = {}
    if isinstance(mapping.clock.apply_offset, float):
        shifts = {
            topic: mapping.clock.apply_offset for part in parts for topic in _command_topics(part.mapping)
        }
    built, found = _assemble_all(parts, shifts)
    if mapping.clock.apply_offset is True:
        shifts = _estimates(found, parts)
        built, _ = _assemble_all(parts, shifts)
    episodes, counts, session = _numbered(parts, built, mapping)
    if not episodes:
        reasons: Counter[str] = Counter()
        for count in (count for one in built for count in one.counts):
            reasons.update({f"{count.name}: {reason}": number for reason, number in count.dropped.items()})
        worst = "; ".join(f"{number} rows of {reason}" for reason, number in reasons.most_common(3))
        hint = _unit_hint(parts) or "see gpsim import --inspect, gap_limit and episodes"
        raise UsageError(f"no episode is left ({worst or 'the topics are empty'}); {hint}")
    _check_values(mapping, episodes)
    recording = _recording(mapping, episodes, session)
    rate = f"the state's own stamps, not interpolated; median step {1e3 * recording.dt:.4g} ms"
    if mapping.rate is not None:
        rate = f"{mapping.rate:g} Hz, interpolated"
    # What salvage could not read of the files themselves.
    losses = [f"{log.name}: {n} x {reason}" for log in logs for reason, n in log.log.losses.items()]
    report = ImportReport(
        topics=tuple(count for one in built for count in one.counts),
        episodes=counts,
        rate=rate,
        lags=tuple(found),
        applied=shifts,
        notes=_notes(mapping, recording, built),
        warnings=(*losses, *soundness.unmarked_wraps(parts, built), *_warnings(mapping, recording, built)),
    )
    provenance = {
        "mapping": _mapping_metadata(mapping),
        "import": report.as_metadata(),
        "sources": {
            c.name: {"log": c.source, "epoch_s": c.epoch, "start_s": round(c.start, 9)} for c in counts
        },
    }
    return replace(recording, provenance=provenance), report


def _check_values(mapping: ImportMapping, episodes: Sequence[Episode]) -> None:
    """Scales and offsets act after the readers' checks of what was measured."""
    channels = (*mapping.state_channels, *mapping.action_channels)
    for episode in episodes:
        columns = (*episode.states.T, *episode.actions.T)
        for channel, column in zip(channels, columns, strict=True):
            if len(column) and not np.abs(column).max() <= LARGEST:
                raise UsageError(
                    f"channel {channel.name} reaches {column[np.abs(column).argmax()]:g} {channel.unit}, the limit is "
                    f"{LARGEST:g}; check its scale and offset in the mapping, and its values in the log"
                )


def _check_clock(mapping: ImportMapping, parts: Sequence[Part]) -> None:
    """Settings of the clock that would do nothing."""
    known = sorted({track.count.topic for part in parts for track in part.tracks.values()})
    for setting, topics in (("offsets", mapping.clock.offsets), ("topics", mapping.clock.topics)):
        for topic in topics:
            if topic not in known:
                raise UsageError(
                    f"clock.{setting}: no topic '{topic}' is read; there are: {', '.join(known)}"
                )
    if mapping.clock.apply_offset and not any(_command_topics(part.mapping) for part in parts):
        raise UsageError(
            "clock.apply_offset: commands and state share their rows and therefore their clock, so there is no offset"
        )


def _command_topics(mapping: ImportMapping) -> set[str]:
    state = {source.topic for source in mapping.state}
    return {
        source.topic for source in mapping.action if source.topic is not None and source.topic not in state
    }


def _assemble_all(
    parts: Sequence[Part], shifts: Mapping[str, float]
) -> tuple[list[Assembled], list[signals.Lag]]:
    built, pieces = [], list[signals.Piece]()
    for part in parts:
        tracks = {name: t.shifted(shifts.get(t.count.topic, 0.0)) for name, t in part.tracks.items()}
        built.append(assemble(part.name, tracks, part.mapping))
        pieces.append((tracks, part.mapping, [(float(e.t[0]), float(e.t[-1])) for e in built[-1].episodes]))
    return built, signals.estimates(pieces)


def _estimates(found: Sequence[signals.Lag], parts: Sequence[Part]) -> dict[str, float]:
    topics = _command_topics(parts[0].mapping) if parts else set()
    best: dict[str, float] = {}
    for lag in sorted(found, key=lambda lag: -abs(lag.correlation)):
        topic = next(s.topic for s in parts[0].mapping.action if s.name == lag.command)
        if topic in topics and lag.usable:
            best.setdefault(topic, lag.lag)
    if not best:
        raise UsageError(
            "clock.apply_offset=true: these data determine no lag of a command topic; give a number [s]"
        )
    return best


def _numbered(
    parts: Sequence[Part], built: Sequence[Assembled], mapping: ImportMapping
) -> tuple[tuple[Episode, ...], tuple[EpisodeCount, ...], bool]:
    """Number the episodes and set their clock: running on over one log, or from 0 in each."""
    kind = mapping.clock.kind
    session = kind == "session" or (kind == "auto" and len(parts) == 1)
    episodes: list[Episode] = []
    counts: list[EpisodeCount] = []
    zero: float | None = None
    for part, one in zip(parts, built, strict=True):
        for episode in one.episodes:
            name, start = str(len(episodes)), float(episode.t[0])
            zero = part.epoch + start if zero is None else zero
            t = episode.t - start + ((part.epoch + start - zero) if session else 0.0)
            if session and episodes and t[0] <= episodes[-1].t[-1]:
                raise UsageError(
                    f"clock.kind=session: {part.name} starts before the end of the preceding log"
                )
            episodes.append(Episode(name, t, episode.states, episode.actions))
            length = float(episode.t[-1] - episode.t[0])
            counts.append(EpisodeCount(name, part.name, start, length, len(episode), part.epoch))
    return tuple(episodes), tuple(counts), session


def _unit_hint(parts: Sequence[Part]) -> str:
    """What to write where no episode is left because the time column is in another unit; empty where it is not."""
    for part in parts:
        time = part.mapping.time
        if time is None or time.field is None or time.scale != 1.0:
            continue
        for track in part.tracks.values():
            step = float(np.median(np.diff(track.t))) if len(track.t) > 1 else 0.0
            unit = guessing.likely_unit(track.t + part.epoch, step)
            if unit is not None:
                scale = f"{guessing.UNITS[unit]:.0e}"
                return (
                    f"the time column '{time.field}' looks like {unit}: its usual step is {step:g}; add "
                    f"time.scale={scale}, or if it is in seconds, gap_limit above {step:g}"
                )
    return ""


def _recording(mapping: ImportMapping, episodes: tuple[Episode, ...], session: bool) -> Recording:
    steps = np.concatenate([np.diff(episode.t) for episode in episodes])
    velocities: Any = "differentiated" if len(mapping.measured) < len(mapping.state) else None
    if velocities is None and any(name.endswith("_dot") for name in mapping.state_channels.names):
        velocities = "measured"
    return Recording(
        system=mapping.system,
        model=mapping.model,
        state=mapping.state_channels,
        action=mapping.action_channels,
        episodes=episodes,
        dt=1.0 / mapping.rate if mapping.rate else float(np.round(np.median(steps), 9)),
        parameters=mapping.parameters,
        integrator=mapping.integrator,
        velocities=velocities,
        clock="session" if session else "episode",
        noise=mapping.noise,
        held_out=hold_out(episodes, mapping.held_out, session),
    )


def _notes(mapping: ImportMapping, recording: Recording, built: Sequence[Assembled]) -> tuple[str, ...]:
    notes = []
    if len(mapping.action):
        mean = mapping.commands == "mean"
        how = "averaged over each step" if mean else "held (zero order); the command in force at t_k"
        longest = max(one.longest_hold for one in built)
        inside = f"the longest gap inside an episode is {longest:.3g} s"
        notes.append(f"commands: {how}; {inside}")
    made = [s.name for s in mapping.state if s.derivative_of is not None]
    if made:
        notes.append(f"velocities: {', '.join(made)} differentiated, {_describe(mapping.velocities)}")
    if mapping.smoothing.channels:
        notes.append(f"smoothed: {', '.join(mapping.smoothing.channels)}, {_describe(mapping.smoothing)}")
    held = recording.held_out
    if held is None:
        notes.append("held out: nothing")
    elif held.episodes_from is not None:
        notes.append(f"held out: episodes from {held.episodes_from} on")
    elif held.share is not None:
        notes.append(f"held out: the last {100 * held.share:g} %")
    else:
        notes.append(f"held out: time from {held.time_from:g} s on")
    return tuple(notes)


def _describe(smoothing: Smoothing) -> str:
    edges = "edges trimmed" if smoothing.edges == "trim" else "edges by a one-sided fit"
    if smoothing.method == "gaussian":
        return f"Gaussian smoothing of sigma = {smoothing.sigma:g} samples of the source, {edges}"
    if smoothing.method == "savgol":
        return f"Savitzky-Golay, {smoothing.window} samples, order {smoothing.order}, {edges}"
    return f"no smoothing, {edges}"


def _warnings(mapping: ImportMapping, recording: Recording, built: Sequence[Assembled]) -> tuple[str, ...]:
    found = []
    clocks = {(count.topic, count.clock) for one in built for count in one.counts}
    kinds = {
        "header" if name == "header" else "receive" for _, name in clocks if name[:6] in ("header", "receiv")
    }
    if len(kinds) > 1:
        on = ", ".join(sorted(topic for topic, name in clocks if name.startswith("receive")))
        found.append(
            f"header stamps and receive times are mixed ({on} on receive time): transport delay is an offset"
        )
        found += _drifting(built, recording.dt)
    steps = np.concatenate([np.diff(e.t) for e in recording.episodes])
    if mapping.rate is None and float(steps.max()) > 1.5 * recording.dt:
        found.append(
            f"steps are uneven, {1e3 * steps.min():.4g} to {1e3 * steps.max():.4g} ms; rate=HZ evens them"
        )
    lost: dict[str, list[int]] = {}
    for one in built:
        for count in one.counts:
            total = lost.setdefault(count.name, [0, 0])
            # Rows of a part without its channels are another part's.
            total[0] += count.read - (count.dropped.get(MISSING, 0) if count.part else 0)
            total[1] += count.kept
    found += [
        f"{topic}: only {100.0 * kept / read:.0f} % of its rows are in an episode"
        for topic, (read, kept) in lost.items()
        if read and kept < 0.5 * read
    ]
    return tuple(found)


def _drifting(built: Sequence[Assembled], step: float) -> list[str]:
    """Topics on header stamps whose clock moved against the receiver's by more than a step [s] within a log."""
    worst: dict[str, tuple[float, float]] = {}
    for one in built:
        for count in one.counts:
            if count.clock != "header" or count.drift is None or count.drift[1] - count.drift[0] <= step:
                continue
            known = worst.get(count.topic, (0.0, 0.0))
            worst[count.topic] = max(known, count.drift, key=lambda ends: ends[1] - ends[0])
    return [
        f"the two clocks drift apart: {topic} is received {1e3 * least:.4g} to {1e3 * most:.4g} ms after its stamp, "
        f"and a step is {1e3 * step:.4g} ms; split the log at the change, or add clock.stamps=receive"
        for topic, (least, most) in worst.items()
    ]


def _mapping_metadata(mapping: ImportMapping) -> dict[str, Any]:
    metadata: dict[str, Any] = {
        "state": {source.name: _origin(source) for source in mapping.state},
        "action": {source.name: _origin(source) for source in mapping.action},
        "rate": "source" if mapping.rate is None else mapping.rate,
        "gap_limit_s": mapping.gap_limit,
        "commands": mapping.commands,
    }
    if len(mapping.measured) < len(mapping.state):
        metadata["velocities"] = _describe(mapping.velocities)
    if mapping.smoothing.channels:
        metadata["smoothing"] = f"{', '.join(mapping.smoothing.channels)}: {_describe(mapping.smoothing)}"
    return metadata


def _origin(source: ChannelSource) -> dict[str, Any]:
    raw: dict[str, Any] = {"topic": source.topic, "field": source.field, "quaternion": source.quaternion}
    raw["angle"] = source.angle if source.quaternion else None
    raw["derivative_of"] = source.derivative_of
    raw |= {"scale": source.sign * source.scale, "offset": source.offset}
    defaults = {"scale": 1.0, "offset": 0.0}
    return {key: value for key, value in raw.items() if value is not None and value != defaults.get(key)}
