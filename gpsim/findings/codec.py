"""Between frozen dataclasses and JSON: a field is a key, in the order of the class; what a file may lack has a default.

A number that is not finite (a simulation ran away) is null in a file: `float` reads it as NaN, `float | None` as None.
Keys that nobody knows are passed over: a later version may have written them.
"""

from __future__ import annotations

import math
import types
from collections.abc import Mapping
from dataclasses import MISSING, Field, fields, is_dataclass
from functools import cache
from typing import Any, Literal, TypeVar, Union, cast, get_args, get_origin, get_type_hints

from gpsim.errors import UsageError

T = TypeVar("T")
UNWRITTEN = {"codec": "unwritten"}  # a fact that is kept beside its words and has no key
OMITTED = {"codec": "omitted"}  # where it is None, its key is left out
FLAT = {"codec": "flat"}  # a mapping whose keys stand beside those of the class
SCALARS = {float: "a number", int: "a whole number", str: "a text", bool: "true or false"}


class _DamagedError(ValueError):
    """What is wrong, at which key."""

    def __init__(self, path: str, message: str) -> None:
        super().__init__(f"{path.removeprefix('.')}: {message}" if path else message)


def written(value: Any) -> Any:
    """What JSON holds of a value: dictionaries, lists, texts, finite numbers, true, false and null."""
    if is_dataclass(value) and not isinstance(value, type):
        out: dict[str, Any] = {}
        for f in written_fields(type(value)):
            part = getattr(value, f.name)
            if f.metadata == FLAT:
                out |= written(part)
            elif part is not None or f.metadata != OMITTED:
                out[f.name] = written(part)
        return out
    if isinstance(value, Mapping):
        return {str(key): written(part) for key, part in value.items()}
    if isinstance(value, list | tuple):
        return [written(part) for part in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


def read(kind: type[T], content: Any, where: str) -> T:
    """A value of a type, of what JSON holds; raises UsageError, which begins with `where` and the key.

    content may be such a value itself, as it was computed: NumPy's numbers become Python's.
    """
    try:
        return cast(T, _read(kind, content, ""))
    except _DamagedError as error:
        raise UsageError(f"{where}: {error}") from None


def written_fields(kind: type) -> list[Field[Any]]:
    """The fields of a dataclass that have keys, in the order in which they are written: its own or its `ORDER`."""
    own = {f.name: f for f in fields(kind) if f.metadata != UNWRITTEN}
    first = {name: own[name] for name in getattr(kind, "ORDER", ())}
    return list((first | own).values())


def may_lack(field: Field[Any]) -> bool:
    """Whether a file may lack the field's key."""
    return field.default is not MISSING or field.default_factory is not MISSING


def _read(kind: Any, content: Any, path: str) -> Any:
    if hasattr(content, "item"):  # a NumPy scalar
        content = content.item()
    origin, inner = get_origin(kind), get_args(kind)
    if origin in (Union, types.UnionType):
        return _read_union(inner, content, path)
    if origin is Literal:
        _check(content in inner, f"one of {', '.join(map(str, inner))}", content, path)
        return content
    if origin is tuple:
        return _read_tuple(inner, content, path)
    if kind is Any:
        return content
    if origin is Mapping:
        _check(isinstance(content, Mapping), "an object", content, path)
        return {str(key): _read(inner[1], part, f"{path}.{key}") for key, part in content.items()}
    if is_dataclass(kind):
        return _read_class(cast(type, kind), content, path)
    return _read_scalar(kind, content, path)


def _read_class(kind: type, content: Any, path: str) -> Any:
    computed = isinstance(content, kind)
    if computed:
        content = {f.name: getattr(content, f.name) for f in fields(kind)}
    _check(isinstance(content, Mapping), "an object", content, path)
    hints, given = _hints(kind), {}
    for f in fields(kind) if computed else written_fields(kind):
        if f.metadata == UNWRITTEN:
            given[f.name] = content[f.name]
        elif f.metadata == FLAT and not computed:
            others = {other.name for other in fields(kind)}
            rest = {key: part for key, part in content.items() if key not in others}
            given[f.name] = _read(hints[f.name], rest, path)
        elif f.name in content:
            given[f.name] = _read(hints[f.name], content[f.name], f"{path}.{f.name}")
        elif not may_lack(f):
            raise _DamagedError(path, f"lacks '{f.name}'")
    return kind(**given)


def _read_tuple(inner: tuple[Any, ...], content: Any, path: str) -> tuple[Any, ...]:
    _check(isinstance(content, list | tuple), "a list", content, path)
    kinds = inner[:1] * len(content) if Ellipsis in inner else inner
    _check(len(kinds) == len(content), f"a list of {len(kinds)}", content, path)
    return tuple(
        _read(k, part, f"{path}[{i}]") for i, (k, part) in enumerate(zip(kinds, content, strict=True))
    )


def _read_union(inner: tuple[Any, ...], content: Any, path: str) -> Any:
    if types.NoneType in inner:
        if content is None or (isinstance(content, float) and not math.isfinite(content)):
            return None
        inner = tuple(kind for kind in inner if kind is not types.NoneType)
    *others, last = inner
    for kind in others:
        try:
            return _read(kind, content, path)
        except _DamagedError:  # the last one says what was expected
            continue
    return _read(last, content, path)


def _read_scalar(kind: Any, content: Any, path: str) -> Any:
    if kind is float and (content is None or content in (math.inf, -math.inf)):
        return math.nan
    right = isinstance(content, int | float) if kind is float else isinstance(content, kind)
    right &= kind is bool or not isinstance(content, bool)  # which is an int
    _check(right, SCALARS[kind], content, path)
    return math.nan if isinstance(content, float) and math.isnan(content) else content


def _check(right: bool, expected: str, content: Any, path: str) -> None:
    if not right:
        said = repr(content)
        raise _DamagedError(path, f"expected {expected}, got {said if len(said) < 60 else said[:57] + '...'}")


@cache
def _hints(kind: type) -> dict[str, Any]:
    return get_type_hints(kind)
