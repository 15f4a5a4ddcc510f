"""The import report: what was read, kept and dropped, and why, in numbers that add up."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from io import StringIO
from typing import Any

from rich.console import Console, Group, RenderableType
from rich.table import Table
from rich.text import Text

from gpsim.printable import literal
from gpsim.recordings.clock import Lag
from gpsim.recordings.mapping import track_name

LISTED = 40  # episodes listed one by one; longer recordings are summed up


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


def render(report: ImportReport) -> RenderableType:
    """The report for a terminal."""
    parts: list[RenderableType] = [_topic_table(report.summed()), Text(""), _episode_table(report)]
    lines = [f"rate: {report.rate}", *_lag_lines(report), *report.notes]
    parts += [Text(""), *(literal(line) for line in lines)]
    parts += [literal(f"warning: {line}", style="yellow") for line in report.warnings]
    return Group(*parts)


def as_text(report: ImportReport, width: int = 110) -> str:
    """The same report as plain text."""
    console = Console(file=StringIO(), width=width, color_system=None, force_terminal=False)
    console.print(render(report))
    lines = console.file.getvalue().splitlines()  # type: ignore[attr-defined]
    return "\n".join(line.rstrip() for line in lines) + "\n"


def _topic_table(counts: Sequence[TopicCount]) -> Table:
    table = Table(title="read = kept + dropped", title_justify="left", box=None, pad_edge=False)
    for name in ("topic", "clock"):
        table.add_column(name, overflow="fold")
    for name in ("read", "kept", "dropped"):
        table.add_column(name, justify="right")
    table.add_column("why dropped; what else was noticed", overflow="fold")
    for count in counts:
        why = [f"{number} {reason}" for reason, number in count.dropped.items()]
        odd = [f"({number} {kind})" for kind, number in count.noticed.items()]
        if count.delay is not None:
            middle, low, high = (1e3 * value for value in count.delay)
            odd.append(f"(received {middle:.1f} ms after its stamp, 5-95 %: {low:.1f} to {high:.1f})")
        table.add_row(
            literal(count.name), literal(count.clock),
            str(count.read), str(count.kept), str(sum(count.dropped.values())),
            literal(", ".join(why) + (" " if why and odd else "") + " ".join(odd)),
        )  # fmt: skip
    return table


def _episode_table(report: ImportReport) -> RenderableType:
    episodes = report.episodes
    seconds, steps = sum(e.duration for e in episodes), sum(e.transitions for e in episodes)
    title = f"{len(episodes)} episode(s), {seconds:.2f} s, {steps} transitions"
    if len(episodes) > LISTED:
        lengths = sorted(e.duration for e in episodes)
        return literal(f"{title}; {lengths[0]:.2f} s to {lengths[-1]:.2f} s long")
    table = Table(title=title, title_justify="left", box=None, pad_edge=False)
    table.add_column("episode")
    table.add_column("from", overflow="fold")
    for name in ("start [s]", "duration [s]", "transitions"):
        table.add_column(name, justify="right")
    for e in episodes:
        table.add_row(
            literal(e.name), literal(e.source), f"{e.start:.3f}", f"{e.duration:.3f}", str(e.transitions)
        )
    return table


def _lag_lines(report: ImportReport) -> list[str]:
    lines = []
    for lag in report.lags:
        if not lag.usable:
            lines.append(
                f"lag of {lag.command}: these data cannot tell it (best correlation {lag.correlation:.2f})"
            )
            continue
        when = (
            f"follows {1e3 * lag.lag:.0f} ms later" if lag.lag >= 0 else f"leads by {-1e3 * lag.lag:.0f} ms"
        )
        why = "clock offset and the system's own delay together"
        if lag.lag < 0:
            why = "the command follows the state (feedback), or its stamps are late"
        lines.append(
            f"lag of {lag.command}: {lag.response} {when} (correlation {lag.correlation:.2f}); {why}"
        )
    if report.applied:
        shifts = ", ".join(f"{topic} {1e3 * value:+.1f} ms" for topic, value in report.applied.items())
        lines.append(f"stamps shifted as asked: {shifts}")
    elif any(lag.usable for lag in report.lags):
        lines.append("not applied; clock.apply_offset=true would add the lag to the command stamps")
    return lines
