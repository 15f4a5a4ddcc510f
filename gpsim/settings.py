"""From the plain mapping of a resolved configuration to frozen dataclasses, checked at the door."""

from __future__ import annotations

import dataclasses
import types
import typing
from collections.abc import Mapping, Sequence
from typing import Any, TypeVar

from gpsim.errors import UsageError

T = TypeVar("T")


def build(cls: type[T], values: Mapping[str, Any], where: str, **fixed: Any) -> T:
    """An instance of the dataclass `cls` from `values` (keys `name` are skipped) and `fixed` fields.

    Raises UsageError that names the key, as `policy.gamma: expected a number, got 'high'`.
    """
    hints = typing.get_type_hints(cls)
    fields = {f.name: f for f in dataclasses.fields(cls)}  # type: ignore[arg-type]
    given = {key: value for key, value in values.items() if key != "name"}
    free = [name for name in fields if name not in fixed]
    unknown = sorted(set(given) - set(free))
    if unknown:
        raise UsageError(f"{where}: no setting '{unknown[0]}'; there are: {', '.join(free)}")
    arguments = {key: _checked(value, hints[key], f"{where}.{key}") for key, value in given.items()}
    none = dataclasses.MISSING
    needed = [name for name, f in fields.items() if f.default is none and f.default_factory is none]
    missing = [name for name in needed if name not in arguments and name not in fixed]
    if missing:
        raise UsageError(f"{where}: setting '{missing[0]}' is missing")
    try:
        return cls(**arguments, **fixed)
    except ValueError as error:
        raise UsageError(f"{where}: {error}") from error


def choice(value: Any, alternatives: Sequence[str], where: str) -> str:
    """`value` if it is one of the alternatives, else a UsageError that lists them."""
    if value not in alternatives:
        raise UsageError(f"{where}: '{value}' is not one of {', '.join(alternatives)}")
    return str(value)


def positive(value: Any, where: str) -> int:
    """A whole number of at least 1."""
    if isinstance(value, bool) or not isinstance(value, int) or value < 1:
        raise UsageError(f"{where}: expected a whole number of at least 1, got {value!r}")
    return value


def whole(value: Any, where: str) -> int:
    """A whole number of at least 0."""
    if isinstance(value, bool) or not isinstance(value, int) or value < 0:
        raise UsageError(f"{where}: expected a whole number of at least 0, got {value!r}")
    return value


def number(value: Any, where: str) -> float:
    """A number."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise UsageError(f"{where}: expected a number, got {value!r}")
    return float(value)


def share(value: Any, where: str) -> float:
    """A number of at least 0 and less than 1."""
    if not 0.0 <= number(value, where) < 1.0:
        raise UsageError(f"{where}: expected a number in [0, 1), got {value!r}")
    return float(value)


def texts(value: Any, where: str) -> list[str]:
    """A list of texts."""
    if not isinstance(value, list | tuple) or not all(isinstance(item, str) for item in value):
        raise UsageError(f"{where}: expected a list of texts, as [a, b], got {value!r}")
    return list(value)


def truth(value: Any, where: str) -> bool:
    """True or false."""
    if not isinstance(value, bool):
        raise UsageError(f"{where}: expected true or false, got {value!r}")
    return value


def _checked(value: Any, hint: Any, where: str) -> Any:
    origin, arguments = typing.get_origin(hint), typing.get_args(hint)
    if origin in (typing.Union, types.UnionType):
        if value is None and type(None) in arguments:
            return None
        return _checked(value, next(a for a in arguments if a is not type(None)), where)
    if origin is typing.Literal:
        return choice(value, arguments, where)
    if hint is bool:
        return truth(value, where)
    if hint is int:
        return _expect(value, isinstance(value, int) and not isinstance(value, bool), "a whole number", where)
    if hint is float:
        return number(value, where)
    if hint is str:
        return _expect(value, isinstance(value, str), "a text", where)
    if origin is not None and issubclass(origin, Mapping):
        _expect(value, isinstance(value, Mapping), "a mapping", where)
        return {key: _checked(item, arguments[1], f"{where}.{key}") for key, item in value.items()}
    if origin is not None and issubclass(origin, Sequence):
        _expect(value, isinstance(value, list | tuple), "a list", where)
        return tuple(_checked(item, arguments[0], f"{where}[{i}]") for i, item in enumerate(value))
    return value


def _expect(value: Any, good: bool, what: str, where: str) -> Any:
    if not good:
        raise UsageError(f"{where}: expected {what}, got {value!r}")
    return value
