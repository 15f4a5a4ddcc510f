"""Mappings as they are written: key=value words, and tables of data checked and built."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import fields
from typing import Annotated, Any

from gpsim.errors import UsageError
from gpsim.recordings import values
from gpsim.recordings.mapping import (
    ChannelSource,
    Checks,
    ClockChoice,
    EpisodeRule,
    HeldOutRule,
    ImportMapping,
    Smoothing,
    TimeColumns,
)
from gpsim.recordings.values import checked, one_line, within
from gpsim.recordings.yaml_data import YamlError, parse_yaml

_PART = re.compile(r"\.?([^.\[\]]+)|\[([^\[\]]+)\]")
_WRITTEN = ("[", "{", '"', "'")  # values that begin like this are meant as YAML


def changes_of_words(words: Sequence[str]) -> dict[str, Any]:
    """Nested changes from words as rate=50, state.x.field=a or checks.max_rate[a name]=3; later words win.

    Values are YAML (numbers, true, null, lists); what is none is taken as text, so that files=*.csv needs no quotes.
    """
    made: dict[str, Any] = {}
    for word in words:
        key, equals, value = word.partition("=")
        if not equals or not key:
            raise UsageError(
                f"'{one_line(word, 80)}' is neither a source nor a setting: write key=value, as rate=50"
            )
        change: Any = _value(value, word)
        for part in reversed(_parts(key, word)):
            change = {part: change}
        made = merged(made, change)
    return made


def _parts(key: str, word: str) -> list[str]:
    parts: list[str] = []
    position = 0
    while position < len(key):
        match = _PART.match(key, position)
        if match is None or (position == 0 and match[1] is None):
            raise UsageError(
                f"setting {one_line(word, 80)}: '{one_line(key, 60)}' is no key; write it as state.x.field"
            )
        parts.append(match[1] or match[2])
        position = match.end()
    return parts


def _value(text: str, word: str) -> Any:
    try:
        return parse_yaml(text)
    except YamlError as error:
        if text.startswith(_WRITTEN):
            raise UsageError(f"setting {one_line(word, 80)}: {error}") from error
        return text


def merged(raw: Mapping[str, Any], changes: Mapping[str, Any]) -> dict[str, Any]:
    """`raw` with `changes`: tables are merged key by key, everything else is replaced."""
    made = dict(raw)
    for key, value in changes.items():
        known = made.get(key)
        both = isinstance(known, Mapping) and isinstance(value, Mapping)
        made[key] = merged(known, value) if both else value  # type: ignore[arg-type]
    return made


OPEN = "?"  # what a proposal leaves for the person to fill in
TOP_KEYS = (*(f.name for f in fields(ImportMapping)), "dt")
_SECTIONS = {
    "time": TimeColumns, "clock": ClockChoice, "velocities": Smoothing, "smoothing": Smoothing,
    "episodes": EpisodeRule, "held_out": HeldOutRule, "checks": Checks,
}  # fmt: skip


def parse_mapping(raw: object, where: str = "mapping") -> ImportMapping:
    """Check a plain dictionary and build the mapping; every fault is one line with the alternatives."""
    given = {key: value for key, value in values.table(raw, where, TOP_KEYS).items() if value is not None}
    _refuse_open_questions(given, where)
    for key in ("system", "state"):
        if key not in given:
            raise UsageError(f"{where}: {key} missing; a mapping needs system, state, action and rate")
    if given.get("held_out") in (False, "none"):
        given["held_out"] = {"share": 0.0}
    for key, kind in _SECTIONS.items():
        if key in given:
            given[key] = checked(kind, given[key], f"{where}: {key}")
    for key in ("state", "action"):
        given[key] = _channels(given.get(key) or {}, f"{where}: {key}")
    step = given.pop("dt", None)
    if step is not None and "rate" in given:
        raise UsageError(f"{where}: give rate [Hz] or dt [s], not both")
    if step is not None:
        seconds = Annotated[float, within(1e-9, 1e6, "s", above=True)]
        given["rate"] = 1.0 / values.sound(seconds, step, f"{where}: dt")
    if "rate" not in given:
        raise UsageError(f"{where}: rate missing; a number [Hz], or 'source' to keep the state's own stamps")
    return checked(ImportMapping, given, where, top=True)


def _refuse_open_questions(given: Mapping[str, Any], where: str) -> None:
    """`gpsim import --inspect` proposes '?' where only a person can tell."""
    entries = {key: given[key] for key in ("time", "state", "action") if isinstance(given.get(key), Mapping)}
    found = ["system"] if given.get("system") == OPEN else []
    found += [f"time.{name}" for name, value in entries.pop("time", {}).items() if value == OPEN]
    for section, channels in entries.items():
        for name, entry in channels.items():
            held = entry.items() if isinstance(entry, Mapping) else ()
            found += [f"{section}.{name}.{key}" for key, value in held if value == OPEN]
    if found:
        more = f" and {len(found) - 8} more" if len(found) > 8 else ""
        raise UsageError(
            f"{where}: still '{OPEN}' at {', '.join(found[:8])}{more}; fill in what the log cannot tell "
            "(a system, units), and take away the channels that you do not need"
        )


def _channels(raw: object, where: str) -> tuple[ChannelSource, ...]:
    if not isinstance(raw, Mapping):
        raise UsageError(f"{where}: expected channel names, each with its field and unit")
    values.check_channels(raw, where)
    return tuple(_channel(str(name), entry, f"{where}.{name}") for name, entry in raw.items())


def _channel(name: str, raw: object, where: str) -> ChannelSource:
    known = [f.name for f in fields(ChannelSource) if f.name not in ("name", "part")]
    table = values.table(raw, where, known)
    origins = [key for key in ("field", "quaternion", "derivative_of") if table.get(key) is not None]
    if len(origins) != 1:
        got = " and ".join(origins) or "none"
        raise UsageError(f"{where}: needs exactly one of field, quaternion, derivative_of; got {got}")
    if table.get("unit") is None:
        raise UsageError(f"{where}: unit missing, as in {{field: pose.position.x, unit: m}}")
    return checked(ChannelSource, {"name": name, **table}, where)
