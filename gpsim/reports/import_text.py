"""How a log was understood, for a person: what was taken for what, or the one line that asks what is not told."""

from __future__ import annotations

import shlex
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from io import StringIO
from pathlib import PurePath

from rich.console import Console, Group, RenderableType
from rich.table import Table
from rich.text import Text

from gpsim.recordings import Guess, ImportReport, Inspection, Statistics, Topic, TopicCount, listed
from gpsim.reports.sheets import literal
from gpsim.simulators import SIMULATORS

OPEN = "COLUMN"  # what stands in a proposed command where only a person knows
OF_THE_LOG = ("t", "dt", "files")  # what is said of a log whatever it is compared with
OWN = ("FILE.py:ClassName", "your own")
MOST = 12  # candidates that a line lists
LISTED = 40  # episodes listed one by one; longer recordings are summed up
MOST_FIELDS = 16  # of a topic that are listed
DULL = ("covariance", "stamp.", "data_offset")  # fields that nobody maps


def told(found: Guess, path: str, own: Mapping[str, tuple[float, str]]) -> list[str]:
    """What was taken for what, in which units, and one on parameters that nobody gave (`own`: value and unit)."""
    path, units = PurePath(shlex.split(path)[0]).name, _units(found)
    taken = " ".join(shlex.quote(f"{n}={source}") for n, source in found.taken.items())
    said = [f"read as {found.system.name}: {taken}"]
    read_in = ", ".join(f"{n} {units[n]}" for n in found.taken if n in units)
    said += [f"units: {read_in}; to change a channel, add it as {_example(found)}"] if read_in else []
    lines = [f"{path}: {line}" for line in (*said, *found.remarks, *_switched(found))]
    if own:
        values = ", ".join(f"{name} {value:g} {unit}".rstrip() for name, (value, unit) in own.items())
        first = next(iter(own))
        lines.append(f"{found.system.name} as it comes: {values}; yours: parameters.{first}=VALUE")
    return lines


def _switched(found: Guess) -> list[str]:
    """How the log is cut by what may say when the motors were on, unless it is."""
    if found.switch is None:
        return []
    source, words = found.switch
    return [f"{source} may show when the motors were on; if so, add {words}"]


def _units(found: Guess) -> dict[str, str]:
    return {**found.system.state.units, **found.system.action.units}


def _example(found: Guess) -> str:
    rad = [n for n, unit in found.system.state.units.items() if unit == "rad" and n in found.taken]
    if rad:
        return shlex.quote(f"{rad[0]}=deg*{found.taken[rad[0]].rpartition('*')[2]}")
    name = next(
        (n for n in (*found.system.action.names, *found.system.state.names) if n in found.taken), None
    )
    name = name or next(iter(found.missing), "x")
    return shlex.quote(f"{name}=0.5*{found.taken.get(name, OPEN).rpartition('*')[2]}")


@dataclass(frozen=True)
class Asking:
    """What was typed. command: before the log; path: of the log, as a shell takes it; words, tail: behind it.

    named: whether the user said which simulator.
    """

    command: str
    path: str
    words: Sequence[str] = ()
    tail: str = ""
    named: bool = False


def asked(typed: Asking, found: Guess, columns: Sequence[str], ready: Sequence[str]) -> tuple[str, list[str]]:
    """One line, and above it a table of what only a person can tell, with the commands that would do.

    columns: of the log, and its topics; ready: mappings that come with gpsim and fit.
    """
    unknown = not typed.named and any(name in found.missing for name in found.system.state.names)
    name = PurePath(shlex.split(typed.path)[0]).name
    looks = "" if typed.named or unknown else f" that looks like {found.system.name}"
    line = f"{name}: a raw log{looks}; assign the columns or edit a mapping, by one of the commands shown"
    others = ", ".join(n for n in SIMULATORS if n != found.system.name)
    if unknown:
        made = [SIMULATORS[name]() for name in SIMULATORS]
        each = [(s.name, ", ".join([*s.state.names, *s.action.names])) for s in made]
        table = [f"columns: {listed(columns)}", *_aligned([("NAME", "its channels"), *each, OWN])]
    else:
        table = _aligned([("channel", "unit", "from"), *_questions(found)])
        table.append(f"a factor may stand before a source: {_example(found)}")
        table += [] if typed.named else [f"other simulators: {others}, {': '.join(reversed(OWN))}"]
        table += _switched(found)
    table += [f"for the public data set {one}: use --mapping {one}" for one in ready[:1]]
    table.append(f"assign the columns: {_proposed(typed, found, unknown)}")
    table.append(f"or edit a mapping: gpsim import --inspect {typed.path} --write-mapping mapping.yaml")
    return line, table


def _aligned(rows: Sequence[Sequence[str]]) -> list[str]:
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    return ["  ".join(f"{c:<{w}}" for c, w in zip(cells, widths, strict=True)).rstrip() for cells in rows]


def _proposed(typed: Asking, found: Guess, unknown: bool) -> str:
    kept = [word for word in typed.words if word.partition("=")[0] not in found.taken]
    taken = {n: source for n, source in found.taken.items() if n != source or n in found.unclear}
    if unknown:
        taken = {n: source for n, source in taken.items() if n in OF_THE_LOG}
    parts = [typed.command, typed.path, "--simulator", "NAME" if unknown else shlex.quote(found.system.name)]
    parts += [shlex.quote(word) for word in (*kept, *(f"{n}={source}" for n, source in taken.items()))]
    parts += [f"CHANNEL={OPEN} ..."] if unknown else [f"{n}={OPEN}" for n in found.missing]
    return " ".join([*parts, *([typed.tail] if typed.tail else [])])


def _questions(found: Guess) -> Iterator[tuple[str, str, str]]:
    """A row a channel: its unit, and what it is read from, or what it might be."""
    units, actions = {"t": "s", "dt": "s", **_units(found)}, found.system.action.names
    for name in dict.fromkeys([*found.taken, *found.missing, *found.unclear]):
        source, others = found.taken.get(name, ""), found.missing.get(name, found.unclear.get(name, []))
        more = f" and {len(others) - MOST} more" if len(others) > MOST else ""
        among = f"{listed([other for other in others if other != source][:MOST])}{more}"
        if name in found.missing:
            source = f"? one of {among}" if among else "? no column is like it"
            source += "; none if there was no command" if name in actions else ""
        elif name in found.unclear:
            source += f", or {among}?" if among else " by its name alone?"
        yield name, units.get(name, ""), source


def render(report: ImportReport) -> RenderableType:
    """The report for a terminal."""
    lines = [f"rate: {report.rate}", *_lag_lines(report), *report.notes]
    return Group(
        *(_topic_table(report.summed()), Text(""), _episode_table(report), Text("")),
        *map(literal, lines),
        *(literal(f"warning: {line}", style="yellow") for line in report.warnings),
    )


def as_text(report: ImportReport) -> str:
    """The same report as plain text."""
    file = StringIO()
    Console(file=file, width=110, color_system=None, force_terminal=False).print(render(report))
    return "\n".join(line.rstrip() for line in file.getvalue().splitlines()) + "\n"


def _table(
    title: str | Text, words: Sequence[str], numbers: Sequence[str], last: str = "", no_wrap: bool = False
) -> Table:
    """An empty table: columns of words, then of numbers, then of remarks."""
    table = Table(title=title, title_justify="left", box=None, pad_edge=False)
    for name in words:
        table.add_column(name, overflow="fold")
    for name in numbers:
        table.add_column(name, justify="right", no_wrap=no_wrap)
    if last:
        table.add_column(last, overflow="fold")
    return table


def _topic_table(counts: Sequence[TopicCount]) -> Table:
    heads = ("topic", "clock"), ("read", "kept", "dropped"), "why dropped; remarks"
    table = _table("read = kept + dropped", *heads)
    for count in counts:
        why = [f"{number} {reason}" for reason, number in count.dropped.items()]
        odd = [f"({number} {kind})" for kind, number in count.noticed.items()]
        if count.delay is not None:
            middle, low, high = (1e3 * value for value in count.delay)
            odd.append(f"(received {middle:.1f} ms after its stamp, 5-95 %: {low:.1f} to {high:.1f})")
        numbers = (count.read, count.kept, sum(count.dropped.values()))
        remarks = ", ".join(why) + (" " if why and odd else "") + " ".join(odd)
        table.add_row(literal(count.name), literal(count.clock), *map(str, numbers), literal(remarks))
    return table


def _episode_table(report: ImportReport) -> RenderableType:
    episodes = report.episodes
    seconds, steps = sum(e.duration for e in episodes), sum(e.transitions for e in episodes)
    title = f"{len(episodes)} episode(s), {seconds:.2f} s, {steps} transitions"
    if len(episodes) > LISTED:
        lengths = sorted(e.duration for e in episodes)
        return literal(f"{title}; {lengths[0]:.2f} s to {lengths[-1]:.2f} s long")
    table = _table(title, ("episode", "from"), ("start [s]", "duration [s]", "transitions"))
    table.columns[0].overflow = "ellipsis"
    for e in episodes:
        numbers = (f"{e.start:.3f}", f"{e.duration:.3f}", str(e.transitions))
        table.add_row(literal(e.name), literal(e.source), *numbers)
    return table


def _lag_lines(report: ImportReport) -> list[str]:
    lines = []
    for lag in report.lags:
        when, why = (
            f"follows {1e3 * lag.lag:.0f} ms later",
            "sum of clock offset and system delay",
        )
        if lag.lag < 0:
            when = f"leads by {-1e3 * lag.lag:.0f} ms"
            why = "the command follows the state (feedback), or its stamps are late"
        said = f"{lag.response} {when} (correlation {lag.correlation:.2f}); {why}"
        if not lag.usable:
            said = f"these data do not determine it (best correlation {lag.correlation:.2f})"
        lines.append(f"lag of {lag.command}: {said}")
    if report.applied:
        shifts = ", ".join(f"{topic} {1e3 * value:+.1f} ms" for topic, value in report.applied.items())
        lines.append(f"stamps shifted as asked: {shifts}")
    elif any(lag.usable for lag in report.lags):
        lines.append("not applied; clock.apply_offset=true would add the lag to the command stamps")
    return lines


def render_inspection(found: Inspection) -> RenderableType:
    """The inspection for a terminal: a table of the topics, their fields, and what cannot be read."""
    numbers = ("count", "Hz", "gaps", "from [s]", "to [s]")
    table = _table(literal(found.name), ("topic", "type"), numbers, "noticed", no_wrap=True)
    for topic in found.topics:
        cells = (topic.name, topic.type.split("/")[-1], str(topic.count), *_pace(found.paces.get(topic.name)))
        table.add_row(*map(literal, cells))
    faults: dict[str, list[str]] = {}  # one line a reason, with the topics that it keeps from being read
    for name, reason in found.faults.items():
        faults.setdefault(reason, []).append(name)
    unread = [f"cannot be read: {', '.join(names)} ({reason})" for reason, names in faults.items()]
    return Group(
        table,
        *([literal(f"and {found.others} more log(s) in this folder")] if found.others else []),
        *(literal(line, style="yellow") for line in ("", *unread)),
        *([literal("")] if faults else []),
        *([_column_table(found)] if found.columns else [literal("numeric fields")]),
        *(
            literal(f"  {topic.name}: {_fields(topic)}")
            for topic in found.topics
            if topic.fields and not found.columns
        ),
        literal(""),
        *([literal(f"looks like: {found.system}")] if found.system else []),
        *(literal(f"--mapping {name} is built in and fits this log") for name in found.ready),
    )


def _column_table(found: Inspection) -> Table:
    table = _table("numeric fields", ("column",), ("least", "largest"), "read as", no_wrap=True)
    for name, (role, *ends) in found.columns.items():
        table.add_row(literal(name), *(f"{end:.5g}" for end in ends), literal(role or "-"))
    return table


def _pace(pace: Statistics | None) -> list[str]:
    if pace is None:
        return ["-", "-", "-", "-", ""]
    noticed = [f"longest gap {pace.gaps[0][1]:.3g} s"] if pace.gaps else []
    noticed += [f"{pace.duplicates} duplicates"] if pace.duplicates else []
    noticed += [f"{pace.backwards} steps back"] if pace.backwards else []
    ends = ("-" if value is None else f"{value:.3f}" for value in (pace.start, pace.end))
    return [f"{pace.rate:.4g}" if pace.rate else "-", str(len(pace.gaps)), *ends, ", ".join(noticed)]


def _fields(topic: Topic) -> str:
    names = [n for n in topic.fields if not any(part in n for part in DULL)]
    rest = f" ... ({len(names) - MOST_FIELDS} more)" if len(names) > MOST_FIELDS else ""
    return ", ".join(names[:MOST_FIELDS]) + rest
