"""key=value words: changes of a mapping as they are typed, and the mapping with them."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from typing import Any

from gpsim.errors import UsageError
from gpsim.recordings.names import one_line
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
