"""Names are data: those of channels, columns, episodes and files are taken as they are, or refused with one line."""

from __future__ import annotations

import csv
from collections import Counter
from collections.abc import Iterable, Sequence

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
