"""Values of YAML files and key=value words, checked: every fault is one line that says where."""

from __future__ import annotations

import difflib
import re
import sys
from collections.abc import Mapping
from typing import Any

from gpsim.errors import UsageError
from gpsim.recordings.names import one_line

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
