"""What a log holds, and the mapping it suggests."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from gpsim.channels import FloatArray
from gpsim.errors import UsageError
from gpsim.recordings.guessing import TIME_COLUMNS, System, guess, likeliest, proposal
from gpsim.recordings.raw import NamedLog, RawLog, Series, Topic

MOST_COLUMNS = 40  # of a table that are shown with what they hold
READINGS = 64  # of a log, to find out which of its topics cannot be read
GAP = 5.0  # a step of this many usual steps is a gap


@dataclass(frozen=True)
class Statistics:
    """Of one topic's stamps. rate: 1 / median period [Hz], over increasing steps; start, end: [s].

    gaps: (start, length) [s] of steps longer than GAP periods, longest first; duplicates: steps of zero; backwards:
    steps below zero.
    """

    rate: float | None
    start: float | None
    end: float | None
    gaps: tuple[tuple[float, float], ...]
    duplicates: int
    backwards: int


@dataclass(frozen=True)
class Inspection:
    """The topics of a log, how they come, and a mapping as YAML; others: further logs in the same folder.

    faults: why a topic cannot be read, by its name; ready: mappings that come with gpsim and find all they want here;
    columns: of a table, what each is read as (empty where nothing) and its least and largest value; system: what the
    log looks like one of, empty where it looks like nothing known; open: whether the proposal leaves a question.
    """

    name: str
    topics: tuple[Topic, ...]
    paces: Mapping[str, Statistics]
    proposal: str
    others: int
    faults: Mapping[str, str] = field(default_factory=dict)
    ready: tuple[str, ...] = ()
    columns: Mapping[str, tuple[str, float, float]] = field(default_factory=dict)
    system: str = ""
    open: bool = True


def inspect_log(
    named: NamedLog, systems: Sequence[System], count: int = 1, ready: tuple[str, ...] = ()
) -> Inspection:
    """Read one field of every topic (of a table: what looks like its time), to see how the rows come.

    A topic that cannot be read has its reason listed, and the rest goes on. systems: what the log may be one of.
    """
    topics = tuple(named.log.topics())
    wanted = {
        topic.name: [next((name for name in TIME_COLUMNS if name in topic.fields), topic.fields[0])]
        for topic in topics
        if topic.fields and topic.count
    }
    series, found = _read(named.log, wanted, [READINGS])
    faults = {topic.name: topic.fault for topic in topics if topic.fault} | found
    paces: dict[str, Statistics] = {}
    for name, one in series.items():
        column = one.fields[wanted[name][0]]
        is_table = one.header is None and not np.isfinite(one.receive).any()
        if not is_table:
            paces[name] = statistics(one.receive if one.header is None else one.header)
        elif wanted[name][0] in TIME_COLUMNS:
            paces[name] = statistics(column)
    sound = tuple(topic for topic in topics if topic.name not in faults)

    def values(topic: str, field: str) -> FloatArray:
        """A column; NaN where it cannot be read, of which an import tells the place."""
        return _columns(named.log, topic, [field]).get(field, np.full(1, np.nan))

    best = likeliest([guess(sound, system, {}, values) for system in systems])
    text, roles = proposal(sound, best)
    columns: dict[str, tuple[str, float, float]] = {}
    if len(sound) == 1 and sound[0].type == "table":
        table = sound[0]
        read = _columns(named.log, table.name, table.fields[:MOST_COLUMNS])
        for name, column in read.items():
            held = column[np.isfinite(column)]
            ends = (float(held.min()), float(held.max())) if len(held) else (np.nan, np.nan)
            columns[name] = (roles.get(name, ""), *ends)
        clock = best.raw.get("time", {})
        if table.name not in paces and clock.get("field") in read:
            paces[table.name] = statistics(clock.get("scale", 1.0) * read[clock["field"]])
    known = not any(name in best.missing for name in best.system.state.names)
    system, is_open = best.system.name if known else "", "'?'" in text
    return Inspection(named.name, topics, paces, text, count - 1, faults, ready, columns, system, is_open)


def _columns(log: RawLog, topic: str, names: Sequence[str]) -> dict[str, FloatArray]:
    try:
        return dict(log.series({topic: names})[topic].fields)
    except UsageError:
        return {}


def _read(
    log: RawLog, wanted: Mapping[str, Sequence[str]], left: list[int]
) -> tuple[dict[str, Series], dict[str, str]]:
    """(what can be read, why the rest cannot): all at once, else half by half, down to the topic that is at fault.

    left: how many more readings of the file there may be; behind them, what is asked for together has one reason.
    """
    if not wanted:
        return {}, {}
    left[0] -= 1
    try:
        return dict(log.series(wanted)), {}
    except UsageError as error:
        names = list(wanted)
        if len(names) == 1 or left[0] <= 0:
            return {}, dict.fromkeys(names, str(error))
        halves = names[: len(names) // 2], names[len(names) // 2 :]
        (first, lost), (second, more) = (_read(log, {n: wanted[n] for n in half}, left) for half in halves)
        return first | second, lost | more


def statistics(times: FloatArray) -> Statistics:
    """Look at a topic's stamps (N,) s in file order."""
    known = times[np.isfinite(times)]
    steps = np.diff(known)
    forward = steps[steps > 0]
    period = float(np.median(forward)) if len(forward) else None
    gaps = np.flatnonzero(steps > GAP * (period or np.inf))
    return Statistics(
        rate=1.0 / period if period else None,
        start=float(known.min()) if len(known) else None,
        end=float(known.max()) if len(known) else None,
        gaps=tuple(sorted(((float(known[i]), float(steps[i])) for i in gaps), key=lambda gap: -gap[1])),
        duplicates=int((steps == 0).sum()),
        backwards=int((steps < 0).sum()),
    )
