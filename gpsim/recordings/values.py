"""Names and values of data, checked: taken as they are, or refused with one line that says where."""

from __future__ import annotations

import csv
import re
import sys
from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, fields
from functools import lru_cache
from typing import Annotated, Any, TypeVar

from numpy.typing import NDArray

from gpsim.errors import UsageError, near

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
                f"{where}: a channel must not be called '{name}', which is a column of every recording; rename it"
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


Columns = dict[str, NDArray[Any]]
"""A table: its columns by their names, all of one length."""


LARGEST = 1e30  # no measurement in any SI unit is larger; its powers still are numbers
SECONDS = 1e9  # the longest time that a setting may name, some 30 years
_EXPONENT = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)[eE][+-]?\d+", re.ASCII)
T = TypeVar("T")


@dataclass(frozen=True)
class Sound:
    """How pydantic takes a value of data: as what `by` makes of it, which raises ValueError where it is unsound."""

    by: Callable[[Any], Any]

    def __get_pydantic_core_schema__(self, source: Any, handler: Any) -> Any:
        from pydantic import PlainValidator  # here: a sixth of a second that most commands need not wait for

        return PlainValidator(self.by).__get_pydantic_core_schema__(source, handler)


def number(value: object) -> float:
    """A finite number; also 1e-3, which YAML 1.1 takes for text because it has no decimal point."""
    if isinstance(value, str) and _EXPONENT.fullmatch(value):
        value = float(value)
    largest = sys.float_info.max
    if isinstance(value, bool) or not isinstance(value, int | float) or not abs(value) <= largest:
        raise ValueError(f"expected a finite number, got {one_line(repr(value), 60)}")
    return float(value)


def within(least: float, most: float, unit: str = "", *, above: bool = False, whole: bool = False) -> Sound:
    """A number from `least` to `most`; above: it must be positive; whole: an integer; unit: for the message."""
    counted = f" [{unit}]" if unit else ""

    def by(value: object) -> float:
        found = number(value)
        if above and not found > 0:
            raise ValueError(f"must be positive{counted}, got {found:g}")
        if not least <= found <= most:
            raise ValueError(f"must lie between {least:g} and {most:g}{counted}, got {found:g}")
        if whole and not found.is_integer():
            raise ValueError(f"expected a whole number, got {found:g}")
        return int(found) if whole else found

    return Sound(by)


def positive(most: float = SECONDS, unit: str = "s") -> Sound:
    """A number above 0 and not above `most`."""
    return within(0.0, most, unit, above=True)


def share_of(value: object) -> float:
    """A number from 0 up to, but not, 1."""
    found = number(value)
    if not 0.0 <= found < 1.0:
        raise ValueError(f"expected a number in [0, 1), got {found:g}")
    return found


def flag(value: object) -> bool:
    """True or false, not something that looks like it."""
    if not isinstance(value, bool):
        raise ValueError(f"expected true or false, got {value!r}")
    return value


Text = Annotated[str, Sound(str)]
Number = Annotated[float, Sound(number)]
Numbers = Mapping[str, Number]


def table(raw: object, where: str, known: Sequence[str]) -> Mapping[str, Any]:
    """A mapping with no other than the known keys."""
    if not isinstance(raw, Mapping):
        raise UsageError(f"{where}: expected keys and values, got {raw!r}; known keys are {', '.join(known)}")
    for key in raw:
        if key not in known:
            raise UsageError(
                f"{where}: unknown key '{key}'{near(str(key), known)} (known: {', '.join(known)})"
            )
    return raw


def checked(kind: type[T], raw: object, where: str, *, top: bool = False) -> T:
    """The dataclass that a table of data describes, by the types of its fields; a key without a value is absent.

    UsageError (where, key, what is wrong) for anything else. top: `where` is a file or the like, no key itself.
    """
    known = [field.name for field in fields(kind)]  # type: ignore[arg-type]  # a dataclass
    given = {key: value for key, value in table(raw, where, known).items() if value is not None}
    made: T = sound(kind, given, where, ": " if top else ".")
    return made


def sound(kind: Any, value: object, where: str, join: str = ".") -> Any:
    """The value as of this type; UsageError where it is none. join: what stands between where and a key."""
    from pydantic import ValidationError

    try:
        return _adapter(kind).validate_python(value)
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
    place = where + "".join(f"{'.' if i else join}{key}" for i, key in enumerate(first["loc"]))
    got, told = first["input"], first.get("ctx", {})
    words = str(told.get("expected")).replace(" or ", ", ").replace("'", "")
    what = {
        "literal_error": f"'{got}' is not one of {words}",
        "dict_type": f"expected names with numbers, got {got!r}",
        "mapping_type": f"expected names with numbers, got {got!r}",
        "value_error": str(told.get("error")),
    }.get(first["type"], first["msg"])
    raise UsageError(f"{place}{'' if what.startswith('must be positive') else ':'} {what}")


@lru_cache(maxsize=32)
def _adapter(kind: Any) -> Any:
    from pydantic import TypeAdapter

    return TypeAdapter(kind)
