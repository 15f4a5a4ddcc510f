"""What a log holds, and the mapping it suggests."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import yaml

from gpsim.channels import Channels, FloatArray
from gpsim.errors import UsageError
from gpsim.recordings.files import alike
from gpsim.recordings.guessing_parts import COMMANDS, POSES, pose_of
from gpsim.recordings.likeness import Source
from gpsim.recordings.raw import NamedLog, RawLog, Series, Topic

READINGS = 64  # of a log, to find out which of its topics cannot be read
GAP = 5.0  # a step of this many usual steps is a gap
System = tuple[Channels, Channels]
"""The state and action channels of a simulator."""
_LOOSE = {f"std_msgs/msg/{kind}" for kind in ("Float32", "Float64", "Float32MultiArray")} | {
    "sensor_msgs/msg/Joy"
}
_TIMES = ("t", "time", "timestamp", "Time", "time [s]")


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

    faults: why a topic cannot be read, by its name; ready: mappings that come with gpsim and find all they want here.
    """

    name: str
    topics: tuple[Topic, ...]
    paces: Mapping[str, Statistics]
    proposal: str
    others: int
    faults: Mapping[str, str] = field(default_factory=dict)
    ready: tuple[str, ...] = ()


def inspect_log(named: NamedLog, count: int = 1, ready: tuple[str, ...] = ()) -> Inspection:
    """Read one field of every topic (of a table: what looks like its time), to see how the rows come.

    A topic that cannot be read has its reason listed, and the rest goes on.
    """
    topics = tuple(named.log.topics())
    wanted = {topic.name: [_telling(topic)] for topic in topics if topic.fields and topic.count}
    series, found = _read(named.log, wanted, [READINGS])
    faults = {topic.name: topic.fault for topic in topics if topic.fault} | found
    paces: dict[str, Statistics] = {}
    for name, one in series.items():
        column = one.fields[wanted[name][0]]
        is_table = one.header is None and not np.isfinite(one.receive).any()
        if not is_table:
            paces[name] = statistics(one.receive if one.header is None else one.header)
        elif wanted[name][0] in _TIMES:
            paces[name] = statistics(column)
    sound = tuple(topic for topic in topics if topic.name not in faults)
    text = proposal(sound, paces)
    return Inspection(named.name, topics, paces, text, count - 1, faults, ready)


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


def _telling(topic: Topic) -> str:
    return next((name for name in _TIMES if name in topic.fields), topic.fields[0])


def proposal(topics: tuple[Topic, ...], paces: Mapping[str, Statistics]) -> str:
    """A mapping to start from, as YAML; what could not be told is marked by a comment."""
    pose = _first(topics, POSES)
    command = _first(topics, COMMANDS)
    if pose is not None:
        raw, advice = _vehicle(pose, command), "check the system, the frames and the command's units"
    elif len(topics) == 1:
        raw = _table(topics[0])
        advice = "name the channels as the system does; actions are what was commanded"
    else:
        raw = {"system": "?", "rate": 50, "state": {}, "action": {}}
        advice = "no pose topic found; fill in state and action from the fields above"
    reference = paces.get(pose.name if pose else topics[0].name) if topics else None
    if pose is not None and reference is not None and reference.rate:
        raw["rate"] = min(50, max(1, round(reference.rate)))
    if pose is not None and not raw["action"]:
        loose = [(t.name, n) for t in topics if t.type in _LOOSE for n in t.fields if "data_offset" not in n]
        near = [f"{name} {field}" for name, field in sorted(loose, key=lambda pair: "." in pair[1])]
        advice += (
            f"\n# commands could be among: {', '.join(near[:10])}" if near else "; no command topic found"
        )
    text = yaml.safe_dump(raw, sort_keys=False, default_flow_style=None, width=110)
    return f"# proposed mapping: fill in every '?', {advice}\n{text}"


def _first(topics: tuple[Topic, ...], known: Mapping[str, Any]) -> Topic | None:
    found = [topic for topic in topics if topic.type in known and topic.count]
    return max(found, key=lambda topic: topic.count, default=None)


def _vehicle(pose: Topic, command: Topic | None) -> dict[str, Any]:
    prefix, ends = COMMANDS[command.type] if command is not None else ("", {})
    units = {"v_cmd": "m/s", "w_cmd": "rad/s", "steering": "rad"}
    action = {
        name: Source(command.name, f"{prefix}{end}").entry(units[name])
        for name, end in ends.items()
        if command is not None
    }
    system = "ackermann" if "steering" in ends else "unicycle"
    state = pose_of(pose, alone=False).entries()
    return {"system": system, "rate": 50, "gap_limit": 0.5, "state": state, "action": action}


def _table(topic: Topic) -> dict[str, Any]:
    columns = [name for name in topic.fields if name not in (*_TIMES, "episode")]
    raw: dict[str, Any] = {"system": "?", "rate": "source"}
    if "episode" in (*topic.fields, *topic.texts):
        raw["episodes"] = {"by": "column", "field": "episode"}
    time = next((name for name in _TIMES if name in topic.fields), None)
    if time is not None:
        raw["time"] = {"field": time}
    elif {"s", "ns"} <= set(columns):
        raw["time"] = {"seconds": "s", "nanoseconds": "ns"}
        columns = [name for name in columns if name not in ("s", "ns")]
    else:
        raw["time"] = {"field": "?"}
    raw["state"] = {name: {"field": name, "unit": "?"} for name in columns}
    return raw | {"action": {}}


def bare_mapping(named: NamedLog, system: str, systems: Mapping[str, System]) -> dict[str, Any]:
    """The mapping of a table whose columns are called as the channels of `system`.

    Raises UsageError naming the columns that lack, or asking for a mapping where the log is no table.
    """
    topics = named.log.topics()
    if len(topics) != 1:
        raise UsageError(
            f"{named.name}: {len(topics)} topics; say which is which channel with --mapping NAME_OR_FILE "
            "(gpsim import --inspect proposes one)"
        )
    if not system:
        raise UsageError(
            f"{named.name}: no --mapping; `gpsim import --inspect` shows what is inside and proposes one (its system "
            "may be one of your own, as my_system.py:ClassName); or say system=NAME where the columns are called as "
            f"the channels of {', '.join(systems)}"
        )
    if system not in systems:
        raise UsageError(f"{named.name}: no simulator '{system}'; there are: {', '.join(systems)}")
    (state, action), fields = systems[system], topics[0].fields
    time = next((name for name in _TIMES if name in fields), None)
    if not set(action.names) & set(fields) and not any(alike(name, fields) for name in action.names):
        action = Channels(())  # nobody commanded it
    lacking = [name for name in (*state.names, *action.names) if name not in fields]
    if time is None or lacking:
        what = ", ".join([*([] if time else ["t"]), *lacking])
        raise UsageError(
            f"{named.name}: column(s) {what} missing for {system}; there are: {', '.join(fields[:30])}"
        )
    raw: dict[str, Any] = {"system": system, "rate": "source", "time": {"field": time}}
    if "episode" in (*fields, *topics[0].texts):
        raw["episodes"] = {"by": "column", "field": "episode"}
    raw["state"] = {
        c.name: {"field": c.name, "unit": c.unit} | ({"wraps": True} if c.wraps else {}) for c in state
    }
    raw["action"] = {c.name: {"field": c.name, "unit": c.unit} for c in action}
    return raw
