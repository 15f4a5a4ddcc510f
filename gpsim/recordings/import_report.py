"""The import report: what was read, kept and dropped, and why, in numbers that add up."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from gpsim.recordings.assembling import Assembled, TopicCount
from gpsim.recordings.mapping import ChannelSource, ImportMapping, Smoothing
from gpsim.recordings.recording import Recording
from gpsim.recordings.signals import Lag
from gpsim.recordings.tracks import MISSING


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
    lags: tuple[Lag, ...] = ()
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
    middle = delays[len(delays) // 2] if delays else None
    return TopicCount(
        source=first.source if len(group) == 1 else f"{len(group)} logs",
        topic=topic,
        type=first.type,
        clock=first.clock,
        read=sum(c.read for c in group),
        kept=sum(c.kept for c in group),
        dropped=dict(sum((Counter(c.dropped) for c in group), Counter())),
        noticed=dict(sum((Counter(c.noticed) for c in group), Counter())),
        delay=middle,
        part=first.part,
    )


def rate_text(mapping: ImportMapping, dt: float) -> str:
    """The recording's pace in words."""
    if mapping.rate is None:
        return f"the state's own stamps, not interpolated; median step {1e3 * dt:.4g} ms"
    return f"{mapping.rate:g} Hz, interpolated"


def notes_of(mapping: ImportMapping, recording: Recording, built: Sequence[Assembled]) -> tuple[str, ...]:
    """How commands were held, velocities made, and what is held out."""
    notes = []
    if len(mapping.action):
        how = (
            "averaged over each step"
            if mapping.commands == "mean"
            else "held (zero order), the one standing at t_k"
        )
        longest = max(one.longest_hold for one in built)
        notes.append(
            f"commands: {how}; the longest time without a new one inside an episode is {longest:.3g} s"
        )
    made = [s.name for s in mapping.state if s.derivative_of is not None]
    if made:
        notes.append(f"velocities: {', '.join(made)} differentiated, {describe(mapping.velocities)}")
    if mapping.smoothing.channels:
        notes.append(f"smoothed: {', '.join(mapping.smoothing.channels)}, {describe(mapping.smoothing)}")
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


def describe(smoothing: Smoothing) -> str:
    """A smoothing choice in words."""
    edges = "edges trimmed" if smoothing.edges == "trim" else "edges by a one-sided fit"
    if smoothing.method == "gaussian":
        return f"Gaussian smoothing of sigma = {smoothing.sigma:g} samples of the source, {edges}"
    if smoothing.method == "savgol":
        return f"Savitzky-Golay, {smoothing.window} samples, order {smoothing.order}, {edges}"
    return f"no smoothing, {edges}"


def warnings_of(mapping: ImportMapping, recording: Recording, built: Sequence[Assembled]) -> tuple[str, ...]:
    """What asks for a second look."""
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
        f"{topic}: only {100.0 * kept / read:.0f} % of its rows lie in an episode"
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
        f"the two clocks move against each other: {topic} is received {1e3 * least:.4g} to {1e3 * most:.4g} ms after "
        f"its stamp (running median), a change of more than a step of {1e3 * step:.4g} ms; what is on receive time is "
        "off by as much; split the log where it changes, or use clock.stamps=receive"
        for topic, (least, most) in worst.items()
    ]


def origins(counts: Sequence[EpisodeCount]) -> dict[str, Any]:
    """Episode name -> the log it is from and where it starts there."""
    return {
        count.name: {"log": count.source, "epoch_s": count.epoch, "start_s": round(count.start, 9)}
        for count in counts
    }


def mapping_metadata(mapping: ImportMapping) -> dict[str, Any]:
    """The decisions of the mapping, for recording.yaml."""
    metadata: dict[str, Any] = {
        "state": {source.name: _origin(source) for source in mapping.state},
        "action": {source.name: _origin(source) for source in mapping.action},
        "rate": "source" if mapping.rate is None else mapping.rate,
        "gap_limit_s": mapping.gap_limit,
        "commands": mapping.commands,
    }
    if len(mapping.measured) < len(mapping.state):
        metadata["velocities"] = describe(mapping.velocities)
    if mapping.smoothing.channels:
        metadata["smoothing"] = f"{', '.join(mapping.smoothing.channels)}: {describe(mapping.smoothing)}"
    return metadata


def _origin(source: ChannelSource) -> dict[str, Any]:
    """What a recording keeps of a channel's origin."""
    raw: dict[str, Any] = {"topic": source.topic, "field": source.field, "quaternion": source.quaternion}
    raw["angle"] = source.angle if source.quaternion else None
    raw["derivative_of"] = source.derivative_of
    raw |= {"scale": source.sign * source.scale, "offset": source.offset}
    defaults = {"scale": 1.0, "offset": 0.0}
    return {key: value for key, value in raw.items() if value is not None and value != defaults.get(key)}
