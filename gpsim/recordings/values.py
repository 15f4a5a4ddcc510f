"""Names and values of data, checked: taken as they are, or refused with one line that says where."""

from __future__ import annotations

import csv
import difflib
import re
import sys
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from gpsim.errors import UsageError

LONGEST = 200  # characters
LONGEST_LINE = 1 << 18  # bytes of a line of a text table
RESERVED = ("episode", "t")  # columns of every recording


def one_line(text: object, limit: int = 200) -> str:
    """Text that is safe inside a one-line message: printable, no line breaks, at most `limit` characters."""
    flat = " ".join(str(text).split())
    flat = "".join(c if c.isprintable() else "?" for c in flat)
    return flat if len(flat) <= limit else f"{flat[:limit]}..."


def fault_of(name: str) -> str:
    """Why a name cannot be used; empty where it can."""
    if not name.strip():
        return "is empty"
    if len(name) > LONGEST:
        return f"has {len(name)} characters; the limit is {LONGEST}"
    strange = next((c for c in name if not c.isprintable()), None)
    return "" if strange is None else f"holds a line break or control character ({strange!a})"


def check_name(name: str, where: str) -> None:
    """Refuse a name that is empty, too long, or would break the line it is shown in; where: what has the name."""
    fault = fault_of(name)
    if fault:
        raise UsageError(f"{where}: the name '{one_line(name, 40)}' {fault}; choose another")


def check_channels(names: Iterable[str], where: str) -> None:
    """The same for channels, which cannot be called as a recording's own columns either."""
    for name in names:
        check_name(name, where)
        if name in RESERVED:
            raise UsageError(
                f"{where}: no channel can be called '{name}', a recording's own column is; rename it"
            )


def check_columns(names: Sequence[str], where: str) -> None:
    """Refuse a table with two columns of one name, or with a name that cannot be used."""
    for number, name in enumerate(names):
        check_name(name, f"{where}: column {number + 1}")
    twice = [name for name, count in Counter(names).items() if count > 1]
    if twice:
        named = ", ".join(
            f"'{name}' (columns {', '.join(str(i + 1) for i, other in enumerate(names) if other == name)})"
            for name in twice[:5]
        )
        raise UsageError(f"{where}: several columns are called {named}; give each its own name")


def cells_of(line: str, separator: str) -> list[str]:
    """The cells of a line of a text table, without quotes; a separator inside quotes cuts nothing."""
    try:
        made = next(csv.reader([line], delimiter=separator, skipinitialspace=True), [])
    except csv.Error:  # a cell of more than 128 KiB
        made = line.split(separator)
    return [cell.strip() for cell in made]


_FINITE = sys.float_info.max
LARGEST = 1e30  # no measurement in any SI unit is larger; its powers still are numbers
SECONDS = 1e9  # the longest time that a setting may name, some 30 years
_EXPONENT = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)[eE][+-]?\d+", re.ASCII)


def table(raw: object, where: str, known: tuple[str, ...]) -> Mapping[str, Any]:
    """A mapping with no other than the known keys."""
    if not isinstance(raw, Mapping):
        raise UsageError(f"{where}: expected keys and values, got {raw!r}; known keys are {', '.join(known)}")
    for key in raw:
        if key not in known:
            near = difflib.get_close_matches(str(key), known, n=1)
            hint = f"; did you mean {near[0]}?" if near else ""
            raise UsageError(f"{where}: unknown key '{key}'{hint} (known: {', '.join(known)})")
    return raw


def text(value: object) -> str | None:
    """Text, or nothing."""
    return None if value is None else str(value)


def flag(value: object, where: str) -> bool:
    """True or false, not something that looks like it."""
    if not isinstance(value, bool):
        raise UsageError(f"{where}: expected true or false, got {value!r}")
    return value


def number(value: object, where: str) -> float:
    """A finite number; also 1e-3, which YAML 1.1 takes for text because it has no decimal point."""
    if isinstance(value, str) and _EXPONENT.fullmatch(value):
        value = float(value)
    if isinstance(value, bool) or not isinstance(value, int | float) or not abs(value) <= _FINITE:
        raise UsageError(f"{where}: expected a finite number, got {one_line(repr(value), 60)}")
    return float(value)


def within(value: object, where: str, least: float, most: float, unit: str = "") -> float:
    """A number from `least` to `most`; unit: what it is counted in, for the message."""
    found = number(value, where)
    if not least <= found <= most:
        counted = f" [{unit}]" if unit else ""
        raise UsageError(f"{where}: must lie between {least:g} and {most:g}{counted}, got {found:g}")
    return found


def positive(value: object, where: str, most: float = SECONDS, unit: str = "s") -> float:
    """A number above 0 and not above `most`."""
    found = number(value, where)
    if not found > 0:
        counted = f" [{unit}]" if unit else ""
        raise UsageError(f"{where} must be positive{counted}, got {found:g}")
    return within(found, where, 0.0, most, unit)


def whole(value: object, where: str, least: int, most: int) -> int:
    """A whole number from `least` to `most`."""
    found = within(value, where, least, most)
    if not found.is_integer():
        raise UsageError(f"{where}: expected a whole number, got {found:g}")
    return int(found)


def numbers(raw: object, where: str) -> dict[str, float]:
    """Names with finite numbers."""
    if not isinstance(raw, Mapping):
        raise UsageError(f"{where}: expected names with numbers, got {raw!r}")
    return {str(name): number(value, f"{where}.{name}") for name, value in raw.items()}


def choice(value: Any, known: tuple[Any, ...], where: str) -> Any:
    """One of the known words."""
    if value not in known:
        raise UsageError(f"{where}: '{value}' is not one of {', '.join(str(k) for k in known)}")
    return value
