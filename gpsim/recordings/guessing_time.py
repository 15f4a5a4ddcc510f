"""How the tables of a log tell the time: by a column, by two, or by a fixed step."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from gpsim.channels import FloatArray
from gpsim.errors import UsageError
from gpsim.recordings.likeness import FACTORS, read_source, unit_of, words_of
from gpsim.recordings.raw import Topic
from gpsim.recordings.sources import Part

TIME = "t"
SECONDS = (("s", "ns"), ("sec", "nsec"), ("secs", "nsecs"), ("sec", "nanosec"), ("seconds", "nanoseconds"))
"""Columns that tell the time together."""
STEPS = frozenset({"ts", "dt", "sample_time", "sampling_time"})
"""What a column is called that holds the step alone, in its first row."""
WORDS = frozenset({"t", "time", "timestamp", "timestamps", "stamp", "clock"})
NOT = frozenset({"delta", "d", "latency", "delay", "diff"})
SHORT = {"milliseconds": "ms", "microseconds": "us", "nanoseconds": "ns"}
USUAL, GAP = 0.5, 2.5  # s that a gap has at the least, and in steps of the table


@dataclass
class Clock:
    """raw: of the mapping; taken: what was decided, as it is typed; unclear: columns to choose from.

    plain: told by a column in seconds that is called so.
    """

    raw: dict[str, Any] = field(default_factory=dict)
    used: set[tuple[str, str]] = field(default_factory=set)
    taken: tuple[str, str] | None = None
    unclear: list[str] = field(default_factory=list)
    remarks: list[str] = field(default_factory=list)
    missing: bool = False
    plain: bool = False


def clock_of(
    topics: Sequence[Topic],
    given: str | None,
    step: str | None,
    values: Callable[[str, str], FloatArray],
    beside: str = "",
) -> Clock:
    """Of tables; of a bag nothing, whose messages have stamps.

    given: `t=...`, step: `dt=...` as typed; beside: words of the columns of the state, which a clock may share.
    """
    tables = [topic for topic in topics if topic.type == "table"]
    if not tables:
        return Clock()
    first, fields = tables[0], _shared(tables)
    if given is not None:
        source = read_source(TIME, given, [*tables])
        return _column(source.field, source.scale, first, tables, values, typed=given)
    pair = next((p for p in SECONDS if set(p) <= set(fields)), None)
    if pair is not None:
        made = Clock(raw={"time": {"seconds": pair[0], "nanoseconds": pair[1]}})
        made.used = {(topic.name, name) for topic in tables for name in pair}
        made.remarks.append(f"time from {pair[0]} and {pair[1]}")
        return made
    named = [name for name in fields if WORDS & set(words_of(name)) and not NOT & set(words_of(name))]
    exact = [name for name in named if "_".join(words_of(name)) in WORDS]
    shared = [name for name in named if beside and words_of(name)[:-1] == words_of(beside)]
    chosen = shared or exact or named
    if step is not None and not exact:
        return _fixed(float(step), typed=step)
    if chosen:
        made = _column(chosen[0], None, first, tables, values)
        made.unclear = chosen if len(chosen) > 1 else made.unclear
        made.used |= {(topic.name, name) for topic in tables for name in chosen}
        return made
    told = next((name for name in fields if "_".join(words_of(name)) in STEPS), None)
    if told is not None:
        column = values(first.name, told)
        steps = np.unique(column[np.isfinite(column)])
        if len(steps) == 1 and steps[0] > 0:
            made = _fixed(float(steps[0]))
            made.used = {(topic.name, told) for topic in tables}
            made.remarks.append(f"{told} says a row every {steps[0]:g} s")
            return made
    return Clock(missing=True)


def _shared(tables: Sequence[Topic]) -> list[str]:
    """The columns that every table has, or those of the first."""
    every = [name for name in tables[0].fields if all(name in table.fields for table in tables)]
    return every or list(tables[0].fields)


def _fixed(step: float, typed: str | None = None) -> Clock:
    if not (np.isfinite(step) and step > 0):
        raise UsageError(f"dt={typed}: give the seconds between two rows, as dt=0.01")
    made = Clock(raw={"time": {"step": step}}, taken=("dt", f"{step:g}"))
    made.raw["gap_limit"] = max(USUAL, GAP * step)
    return made


def _column(
    name: str,
    scale: float | None,
    first: Topic,
    tables: Sequence[Topic],
    values: Callable[[str, str], FloatArray],
    typed: str | None = None,
) -> Clock:
    made = Clock(used={(topic.name, name) for topic in tables}, taken=(TIME, typed or name))
    holder = first if name in first.fields else next(topic for topic in tables if name in topic.fields)
    t = values(holder.name, name)
    t = t[np.isfinite(t)]
    steps = np.diff(t)
    step = float(np.median(steps[steps > 0])) if (steps > 0).any() else 0.0
    if scale is None:
        own = unit_of(name) or words_of(name)[-1]
        scale = FACTORS[own] if own in ("ms", "us", "ns") else 1.0
        sure, likely = dated(t) if len(t) else None, likely_unit(t, step)
        if scale == 1.0 and sure is not None:
            scale = UNITS[sure]
            made.remarks.append(f"{name} counts {sure}")
        elif scale == 1.0 and likely is not None:
            made.unclear = [name, f"{SHORT[likely]}*{name}"]
        if scale != 1.0:
            made.taken = (TIME, f"{scale:g}*{name}")
    made.plain = scale == 1.0 and typed is None and "_".join(words_of(name)) in WORDS
    made.raw["time"] = {"field": name} | ({"scale": scale} if scale != 1.0 else {})
    if GAP * step * scale > USUAL:
        made.raw["gap_limit"] = GAP * step * scale
    return made


UNITS = {"milliseconds": 1e-3, "microseconds": 1e-6, "nanoseconds": 1e-9}
_YEARS = (3e8, 1e10)  # s after 1970 in which clocks of today count: 1979 to 2286
_USUAL = 0.02  # s; a usual step of logs of what moves: a hundredth and a hundred times of it are usual, too


def dated(t: FloatArray) -> str | None:
    """The unit that times after 1970 tell by their size alone, if it is not seconds."""
    size = float(np.median(np.abs(t[np.isfinite(t)]))) if np.isfinite(t).any() else 0.0
    return next(
        (n for n, scale in UNITS.items() if size > _YEARS[1] and _YEARS[0] <= size * scale <= _YEARS[1]), None
    )


def likely_unit(t: FloatArray, step: float) -> str | None:
    """The unit that a time column (N,) with this usual step looks to be in; None where seconds are as likely.

    A date tells it; else a step that is 1 or more as seconds, and that of a log of something that moves in the unit.
    (A step of 20 may be 20 ms: the caller knows what speaks for it.)
    """
    if dated(t) is not None or step < 1.0:
        return dated(t)
    away = {name: abs(np.log10(step * scale / _USUAL)) for name, scale in UNITS.items()}
    nearest = min(away, key=lambda name: away[name])
    return nearest if away[nearest] <= 2.0 else None


def unit_hint(parts: Sequence[Part]) -> str:
    """What to write where no episode is left because the time column is in another unit; empty where it is not."""
    for part in parts:
        time = part.mapping.time
        if time is None or time.field is None or time.scale != 1.0:
            continue
        for track in part.tracks.values():
            step = float(np.median(np.diff(track.t))) if len(track.t) > 1 else 0.0
            unit = likely_unit(track.t + part.epoch, step)
            if unit is not None:
                return (
                    f"the time column '{time.field}' looks like {unit}: its usual step is {step:g}; write "
                    f"time: {{field: {time.field}, scale: {UNITS[unit]:.0e}}} in the mapping, or time.scale="
                    f"{UNITS[unit]:.0e} behind the command; if it is in seconds, raise gap_limit above {step:g}"
                )
    return ""
