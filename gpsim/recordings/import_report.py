"""The import report: what was read, kept and dropped, and why, in numbers that add up."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from gpsim.recordings.clock import Lag
from gpsim.recordings.mapping import track_name


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
        dropped=_added(c.dropped for c in group),
        noticed=_added(c.noticed for c in group),
        delay=middle,
        part=first.part,
    )


def _added(tables: Iterable[Mapping[str, int]]) -> dict[str, int]:
    total: dict[str, int] = {}
    for table in tables:
        for reason, number in table.items():
            total[reason] = total.get(reason, 0) + number
    return total
