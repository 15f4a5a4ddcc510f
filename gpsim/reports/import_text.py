"""An import and an inspection for a person: tables for the terminal, and the report's text beside the recording."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from io import StringIO

from rich.console import Console, Group, RenderableType
from rich.table import Table
from rich.text import Text

from gpsim.recordings import ImportReport, Inspection, Statistics, Topic, TopicCount
from gpsim.reports.printable import literal, printable

LISTED = 40  # episodes listed one by one; longer recordings are summed up
MOST_FIELDS = 16  # of a topic that are listed
_DULL = ("covariance", "stamp.", "data_offset")  # fields that nobody maps


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


def render_inspection(found: Inspection) -> RenderableType:
    """The inspection for a terminal: a table of the topics, their fields, and what cannot be read."""
    table = Table(title=literal(found.name), title_justify="left", box=None, pad_edge=False)
    for name in ("topic", "type"):
        table.add_column(name, overflow="fold")
    for name in ("count", "Hz", "gaps", "from [s]", "to [s]"):
        table.add_column(name, justify="right", no_wrap=True)
    table.add_column("noticed", overflow="fold")
    for topic in found.topics:
        cells = [literal(topic.name), literal(topic.type.split("/")[-1]), literal(str(topic.count))]
        table.add_row(*cells, *(literal(cell) for cell in _pace_cells(found.paces.get(topic.name))))
    fields = [literal(f"  {topic.name}: {_shown(topic)}") for topic in found.topics if topic.fields]
    more = [literal(f"and {found.others} more log(s) in this folder")] if found.others else []
    more += [Text(printable(line), style="yellow") for line in ("", *_fault_lines(found.faults))]
    more += [literal("")] if found.faults else []
    ready = [f"--mapping {name} comes with gpsim and finds all it wants here" for name in found.ready]
    return Group(
        table, *more, literal("numeric fields"), *fields, literal(""), *(literal(line) for line in ready)
    )


def _fault_lines(faults: Mapping[str, str]) -> list[str]:
    """One line a reason, with the topics that it keeps from being read."""
    topics: dict[str, list[str]] = {}
    for name, reason in faults.items():
        topics.setdefault(reason, []).append(name)
    return [f"cannot be read: {', '.join(names)} ({reason})" for reason, names in topics.items()]


def _pace_cells(pace: Statistics | None) -> list[str]:
    if pace is None:
        return ["-", "-", "-", "-", ""]
    noticed = [f"longest gap {pace.gaps[0][1]:.3g} s"] if pace.gaps else []
    noticed += [f"{pace.duplicates} duplicates"] if pace.duplicates else []
    noticed += [f"{pace.backwards} steps back"] if pace.backwards else []
    rate = f"{pace.rate:.4g}" if pace.rate else "-"
    return [rate, str(len(pace.gaps)), _seconds(pace.start), _seconds(pace.end), ", ".join(noticed)]


def _shown(topic: Topic) -> str:
    names = [n for n in topic.fields if not any(part in n for part in _DULL)]
    rest = f" ... ({len(names) - MOST_FIELDS} more)" if len(names) > MOST_FIELDS else ""
    return ", ".join(names[:MOST_FIELDS]) + rest


def _seconds(value: float | None) -> str:
    return "-" if value is None else f"{value:.3f}"
