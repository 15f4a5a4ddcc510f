"""key=value words: changes of a mapping as they are typed, and the mapping with them."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import fields
from typing import Any, get_args

from gpsim.channels import Channel
from gpsim.errors import UsageError
from gpsim.recordings import values
from gpsim.recordings.mapping import (
    AngleName,
    ChannelSource,
    Checks,
    ClockChoice,
    EpisodeRule,
    HeldOutRule,
    ImportMapping,
    Smoothing,
    StampChoice,
    TimeColumns,
)
from gpsim.recordings.values import LARGEST, check_channels, one_line
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
APART = 1e10  # s; the most that two clocks may differ by, some 300 years
WIDEST = 10_001  # samples of a smoothing window
_CHANNEL_KEYS = (
    "topic", "field", "quaternion", "angle", "derivative_of", "unit", "wraps", "scale", "sign", "offset",
)  # fmt: skip
TOP_KEYS = (*(f.name for f in fields(ImportMapping)), "dt")


def parse_mapping(raw: object, where: str = "mapping") -> ImportMapping:
    """Check a plain dictionary and build the mapping; every fault is one line with the alternatives."""
    table = values.table(raw, where, TOP_KEYS)
    _refuse_open_questions(table, where)
    for key in ("system", "state"):
        if table.get(key) is None:
            raise UsageError(f"{where}: {key} missing; a mapping needs system, state, action and rate")
    wanted: dict[str, Any] = {"system": str(table["system"]), "rate": _rate(table, where)}
    wanted["state"] = _channels(table["state"], f"{where}: state")
    wanted["action"] = _channels(table.get("action") or {}, f"{where}: action")
    for key, read in _READERS.items():
        if table.get(key) is not None:
            wanted[key] = read(table[key], f"{where}: {key}")
    return ImportMapping(**wanted)


def _refuse_open_questions(table: Mapping[str, Any], where: str) -> None:
    """`gpsim import --inspect` proposes '?' where only a person can tell."""
    found = ["system"] if table.get("system") == OPEN else []
    for section in ("time", "state", "action"):
        entries = table.get(section)
        for name, entry in entries.items() if isinstance(entries, Mapping) else ():
            if section == "time":
                found += [f"time.{name}"] if entry == OPEN else []
            elif isinstance(entry, Mapping):
                found += [f"{section}.{name}.{key}" for key, value in entry.items() if value == OPEN]
    if found:
        more = f" and {len(found) - 8} more" if len(found) > 8 else ""
        raise UsageError(
            f"{where}: still '{OPEN}' at {', '.join(found[:8])}{more}; fill in what the log cannot tell "
            "(a system, units), and take away the channels that you do not need"
        )


def _rate(table: Mapping[str, Any], where: str) -> float | None:
    if table.get("dt") is not None and table.get("rate") is not None:
        raise UsageError(f"{where}: give rate [Hz] or dt [s], not both")
    if table.get("dt") is not None:
        return 1.0 / values.within(
            values.positive(table["dt"], f"{where}: dt"), f"{where}: dt", 1e-9, 1e6, "s"
        )
    if table.get("rate") is None:
        raise UsageError(f"{where}: rate missing; a number [Hz], or 'source' to keep the state's own stamps")
    if table["rate"] == "source":
        return None
    return values.positive(table["rate"], f"{where}: rate", LARGEST, "Hz, or 'source'")


def _channels(raw: object, where: str) -> tuple[ChannelSource, ...]:
    if not isinstance(raw, Mapping):
        raise UsageError(f"{where}: expected channel names, each with its field and unit")
    check_channels(raw, where)
    return tuple(_channel(str(name), entry, f"{where}.{name}") for name, entry in raw.items())


def _channel(name: str, raw: object, where: str) -> ChannelSource:
    table = values.table(raw, where, _CHANNEL_KEYS)
    origins = [key for key in ("field", "quaternion", "derivative_of") if table.get(key) is not None]
    if len(origins) != 1:
        got = " and ".join(origins) or "none"
        raise UsageError(f"{where}: needs exactly one of field, quaternion, derivative_of; got {got}")
    if table.get("unit") is None:
        raise UsageError(f"{where}: unit missing, as in {{field: pose.position.x, unit: m}}")
    sign = values.number(table.get("sign", 1), f"{where}.sign")
    if sign not in (1.0, -1.0):
        raise UsageError(f"{where}.sign: must be 1 or -1, got {table['sign']}; use scale for a factor")
    return ChannelSource(
        channel=Channel(name, str(table["unit"]), values.flag(table.get("wraps", False), f"{where}.wraps")),
        topic=values.text(table.get("topic")),
        field=values.text(table.get("field")),
        quaternion=values.text(table.get("quaternion")),
        angle=values.choice(table.get("angle", "yaw"), get_args(AngleName), f"{where}.angle"),
        derivative_of=values.text(table.get("derivative_of")),
        scale=values.within(table.get("scale", 1.0), f"{where}.scale", -LARGEST, LARGEST),
        sign=sign,
        offset=values.within(table.get("offset", 0.0), f"{where}.offset", -LARGEST, LARGEST),
    )


def _time(raw: object, where: str) -> TimeColumns:
    table = values.table(raw, where, ("field", "scale", "seconds", "nanoseconds", "step"))
    time = TimeColumns(
        field=values.text(table.get("field")),
        scale=values.positive(table.get("scale", 1.0), f"{where}.scale", unit="s per count"),
        seconds=values.text(table.get("seconds")),
        nanoseconds=values.text(table.get("nanoseconds")),
        step=None if table.get("step") is None else values.positive(table["step"], f"{where}.step"),
    )
    if sum(x is not None for x in (time.field, time.seconds, time.step)) != 1:
        raise UsageError(f"{where}: give one of field, seconds (with nanoseconds) and step")
    return time


def _clock(raw: object, where: str) -> ClockChoice:
    table = values.table(raw, where, tuple(f.name for f in fields(ClockChoice)))
    stamps = get_args(StampChoice)
    apply = table.get("apply_offset", False)
    topics = table.get("topics") or {}
    if not isinstance(topics, Mapping):
        raise UsageError(f"{where}.topics: expected topic: header|receive")
    return ClockChoice(
        stamps=values.choice(table.get("stamps", "auto"), stamps, f"{where}.stamps"),
        topics={
            str(name): values.choice(value, stamps, f"{where}.topics.{name}")
            for name, value in topics.items()
        },
        offsets={
            name: values.within(value, f"{where}.offsets.{name}", -APART, APART, "s")
            for name, value in values.numbers(table.get("offsets") or {}, f"{where}.offsets").items()
        },
        apply_offset=apply
        if isinstance(apply, bool)
        else values.within(apply, f"{where}.apply_offset", -APART, APART, "s"),
        kind=values.choice(table.get("kind", "auto"), ("auto", "session", "episode"), f"{where}.kind"),
    )


def _smoothing(raw: object, where: str) -> Smoothing:
    table = values.table(raw, where, tuple(f.name for f in fields(Smoothing)))
    names = table.get("channels") or ()
    if isinstance(names, str) or not isinstance(names, list | tuple):
        raise UsageError(f"{where}.channels: expected a list of channel names")
    return Smoothing(
        method=values.choice(
            table.get("method", "gaussian"), ("gaussian", "savgol", "none"), f"{where}.method"
        ),
        sigma=values.positive(table.get("sigma", 2.0), f"{where}.sigma", WIDEST, "samples"),
        window=values.whole(table.get("window", 9), f"{where}.window", 1, WIDEST),
        order=values.whole(table.get("order", 3), f"{where}.order", 1, 10),
        edges=values.choice(table.get("edges", "trim"), ("trim", "local"), f"{where}.edges"),
        channels=tuple(str(name) for name in names),
    )


def _episodes(raw: object, where: str) -> EpisodeRule:
    table = values.table(raw, where, tuple(f.name for f in fields(EpisodeRule)))
    by = values.choice(table.get("by", "file"), ("file", "gap", "flag", "column"), f"{where}.by")
    variants = table.get("variants") or {}
    if not isinstance(variants, Mapping) or not all(isinstance(v, Mapping) for v in variants.values()):
        raise UsageError(f"{where}.variants: expected episode name: {{channel: field}}")
    return EpisodeRule(
        by="file" if by == "gap" else by,  # a gap always ends an episode, whatever else does
        topic=values.text(table.get("topic")),
        field=values.text(table.get("field")),
        equals=values.number(table.get("equals", 1.0), f"{where}.equals"),
        min_duration=values.within(
            table.get("min_duration", 0.0), f"{where}.min_duration", 0.0, values.SECONDS, "s"
        ),
        variants={str(k): {str(c): str(f) for c, f in v.items()} for k, v in variants.items()},
    )


def _held_out(raw: object, where: str) -> HeldOutRule:
    if raw in (False, "none"):
        return HeldOutRule(share=0.0)
    table = values.table(raw, where, tuple(f.name for f in fields(HeldOutRule)))
    share = values.number(table.get("share", 0.2), f"{where}.share")
    if not 0.0 <= share < 1.0:
        raise UsageError(f"{where}.share: must lie in [0, 1), got {share}")
    number, moment = table.get("episodes_from"), table.get("time_from")
    return HeldOutRule(
        share=share,
        episodes_from=None if number is None else values.whole(number, f"{where}.episodes_from", 0, 10**9),
        time_from=None if moment is None else values.number(moment, f"{where}.time_from"),
    )


def _checks(raw: object, where: str) -> Checks:
    table = values.table(raw, where, tuple(f.name for f in fields(Checks)))
    return Checks(
        jump=values.positive(table.get("jump", 1.0), f"{where}.jump"),
        quaternion=values.positive(table.get("quaternion", 0.01), f"{where}.quaternion", 1.0, ""),
        outlier=values.positive(table.get("outlier", 50.0), f"{where}.outlier", LARGEST, ""),
        max_rate={
            name: values.positive(value, f"{where}.max_rate.{name}", LARGEST, "per s")
            for name, value in values.numbers(table.get("max_rate") or {}, f"{where}.max_rate").items()
        },
    )


def _noise(raw: object, where: str) -> dict[str, float]:
    return {
        name: values.within(value, f"{where}.{name}", 0.0, LARGEST)
        for name, value in values.numbers(raw, where).items()
    }


def _word(known: tuple[str, ...]) -> Callable[[object, str], Any]:
    return lambda value, where: values.choice(value, known, where)


_READERS: dict[str, Callable[[object, str], Any]] = {
    "parameters": values.numbers,
    "integrator": _word(("euler", "semi_implicit", "rk4")),
    "noise": _noise,
    "layout": _word(("files", "folder")),
    "files": lambda value, _: str(value),
    "time": _time,
    "gap_limit": values.positive,
    "hold_limit": values.positive,
    "commands": _word(("hold", "mean")),
    "clock": _clock,
    "velocities": _smoothing,
    "smoothing": _smoothing,
    "episodes": _episodes,
    "held_out": _held_out,
    "checks": _checks,
    "description": lambda value, _: str(value),
    "model": lambda value, _: str(value),
}
