"""What a table says, apart from how it looks: the page and the terminal show the same sheets."""

from __future__ import annotations

import math
import unicodedata
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any, TypeGuard

from rich.text import Text

_BIDIRECTIONAL = frozenset("\u061c\u200e\u200f\u202a\u202b\u202c\u202d\u202e\u2066\u2067\u2068\u2069")
"""What makes text run the other way: a line would no longer say what it reads."""


def printable(text: object) -> str:
    """The text without control characters, line breaks and tabs apart; what no encoding can hold becomes `?`."""
    kept = (
        c for c in str(text) if c in "\n\t" or not (unicodedata.category(c) == "Cc" or c in _BIDIRECTIONAL)
    )
    return "".join("?" if unicodedata.category(c) == "Cs" else c for c in kept)


def literal(text: object, style: str = "") -> Text:
    """A text for Rich, in which `[red]` is no colour."""
    return Text(printable(text), style=style)


MISSING = "–"


@dataclass(frozen=True)
class Cell:
    """Text of a cell. marked: shown as falling short; name: whose colour it carries (a policy), if any.

    below: what belongs to the text but weighs less, as its interval; title: the long form of the text.
    """

    text: str
    marked: bool = False
    name: str = ""
    title: str = ""
    below: str = ""


@dataclass(frozen=True)
class Sheet:
    """A table: the first `labels` columns are words, the others numbers; rows hold one cell a column.

    The last `tail` columns may stand in a table of their own where there is little room.
    """

    title: str
    columns: tuple[str, ...]
    rows: tuple[tuple[Cell, ...], ...]
    labels: int = 1
    note: str = ""
    tail: int = 0


def row(*cells: Cell | str) -> tuple[Cell, ...]:
    """A row of cells; words become plain cells."""
    return tuple(cell if isinstance(cell, Cell) else Cell(cell) for cell in cells)


def sheet(
    title: str,
    columns: Iterable[str],
    rows: Iterable[Iterable[Cell | str]],
    labels: int = 1,
    note: str = "",
    tail: int = 0,
) -> Sheet:
    """A sheet of rows of cells; words become plain cells."""
    return Sheet(title, tuple(columns), tuple(row(*cells) for cells in rows), labels, note, tail)


def known(value: Any) -> TypeGuard[float]:
    """Whether value is a finite number."""
    return isinstance(value, int | float) and math.isfinite(value)


def fixed(value: Any, digits: int = 1) -> str:
    """A number with so many decimals, MISSING where there is none."""
    return f"{value:.{digits}f}" if known(value) else MISSING


def significant(value: Any, digits: int = 3) -> str:
    """A number with so many significant digits, without an exponent from 1e-4 to 1e6; MISSING where there is none."""
    if not known(value):
        return MISSING
    if value == 0 or 1e-4 <= abs(value) < 1e6:
        decimals = digits - 1 - (math.floor(math.log10(abs(value))) if value else 0)
        return f"{value:.{max(0, decimals)}f}"
    return f"{value:.{digits - 1}e}"


def percent(share: Any, digits: int = 2) -> str:
    """A share in per cent with so many significant digits, at least all before the point."""
    return f"{significant(100.0 * share, digits)} %" if known(share) else MISSING


def whole_percent(share: Any) -> str:
    """A share in whole per cent, with decimals only where rounding would claim all or nothing."""
    if not known(share):
        return MISSING
    text = f"{100.0 * share:.0f}"
    if (text == "100" and share < 1.0) or (text == "0" and share > 0.0):
        text = f"{100.0 * share:.1f}"
    return f"{text} %"


def coefficient(value: Any) -> str:
    """An R2 with enough nines to tell it from 1."""
    if not known(value):
        return MISSING
    for digits in (3, 4, 5, 6):
        if value < 1.0 - 10.0**-digits:
            return f"{value:.{digits}f}"
    return "1.000000" if value >= 1.0 else f"> {1.0 - 1e-6:.6f}"


def plus_minus(value: Any, spread: Any) -> str:
    """A mean and its standard deviation."""
    return f"{fixed(value)} ± {fixed(spread)}" if known(value) and known(spread) else fixed(value)


def span(interval: Sequence[float] | None, digits: int = 1) -> str:
    """An interval from low to high."""
    if not interval or len(interval) != 2 or not all(known(value) for value in interval):
        return MISSING
    return f"{fixed(interval[0], digits)} to {fixed(interval[1], digits)}"


def unit(text: str) -> str:
    """A unit as printed: m/s^2 as m/s²."""
    return text.replace("^2", "²").replace("^3", "³")


def with_unit(name: str, units: Any) -> str:
    """`name [unit]`, or the name alone where no unit is known."""
    found = unit(str(units.get(name, "")))
    return f"{name} [{found}]" if found else name
