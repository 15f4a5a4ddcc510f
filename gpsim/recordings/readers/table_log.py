"""How a text table is written: comment lines, separator, decimal mark, header; judged by the file's beginning."""

from __future__ import annotations

import difflib
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from gpsim.channels import FloatArray
from gpsim.errors import UsageError
from gpsim.recordings.raw import Series, Topic
from gpsim.recordings.readers.damage import DamageError, Ledger, one_line
from gpsim.recordings.values import LONGEST_LINE, cells_of

HEAD = 1 << 18
_NUMBER = re.compile(
    r"[+-]?(\d+\.?\d*([eE][+-]?\d+)?|\.\d+([eE][+-]?\d+)?|nan|inf(inity)?|true|false)", re.IGNORECASE
)
_COMMA_NUMBER = re.compile(r"[+-]?\d+,\d+([eE][+-]?\d+)?")
_POINT_NUMBER = re.compile(r"[+-]?\d*\.\d+([eE][+-]?\d+)?")
_SEPARATORS = (",", ";", "\t", "|")


@dataclass(frozen=True)
class Layout:
    """skip: lines before the data (comments, header); names: the header's cells; rows: lines of data.

    comments: numbers of the lines that are comments, where a # stands in cells, too; None where it begins one anywhere.
    texts: columns that hold words, not numbers; empty until the cells have been looked at.
    """

    skip: int
    separator: str
    decimal: str
    encoding: str
    names: tuple[str, ...]
    rows: int
    last_line: str
    comments: tuple[int, ...] | None = None
    texts: tuple[str, ...] = ()


def read_layout(path: Path) -> Layout:
    """Look at the file; DamageError when it is no text table."""
    lines_there, last = _count_lines(path)
    with path.open("rb") as file:
        raw = file.read(HEAD)
    encoding = "utf-8-sig"
    try:
        raw[: raw.rfind(b"\n") + 1].decode(encoding)
    except UnicodeDecodeError:
        encoding = "latin-1"
    lines = raw.decode(encoding, errors="replace").splitlines()
    if len(raw) == HEAD:
        lines = lines[:-1]
    comments = next((i for i, s in enumerate(lines) if s.strip() and not _is_comment(s)), len(lines))
    whole = [line for line in lines[comments:] if line.strip()]
    body = whole[:40]
    if not body:
        raise DamageError("the file holds no table, only comments or empty lines")
    separator = _separator(body)
    names, header = _header(lines[:comments], body, separator)
    first = next(i for i, line in enumerate(lines) if i >= comments and line.strip())
    decimal = _decimal(whole[header:], separator)
    rows = max(0, lines_there - header)
    last_line = last.decode(encoding, "replace")
    noted = _comments(path, encoding, separator, len(names))
    return Layout(first + header, separator, decimal, encoding, names, rows, last_line, noted)


def _count_lines(path: Path) -> tuple[int, bytes]:
    """(lines that are neither blank nor comment, the last of them); DamageError at what no text table has."""
    count, last = 0, b""
    with path.open("rb") as file:
        while line := file.readline(LONGEST_LINE + 1):
            if len(line) > LONGEST_LINE:
                raise DamageError(
                    f"a line at byte {file.tell() - len(line)} is longer than {LONGEST_LINE} bytes"
                )
            if b"\0" in line:
                raise DamageError(
                    f"byte {file.tell() - len(line) + line.index(0)} is zero, so this is no UTF-8 text table"
                )
            if line.strip() and not line.lstrip().startswith((b"#", b"%")):
                count, last = count + 1, line
    return count, last


def _comments(path: Path, encoding: str, separator: str, count: int) -> tuple[int, ...] | None:
    """Lines that are comments, where some line of data has a # before its last cell; None where none has."""
    found, in_cells = [], False
    with path.open(encoding=encoding, errors="replace") as file:
        for number, line in enumerate(file):
            if _is_comment(line):
                found.append(number)
            elif "#" in line:
                in_cells |= len(cells(line[: line.index("#")], separator)) < count
    return tuple(found) if in_cells else None


def _is_comment(line: str) -> bool:
    return line.lstrip().startswith(("#", "%"))


def cells(line: str, separator: str) -> list[str]:
    """A line's cells without quotes."""
    if separator == r"\s+":
        return [part.strip('"').strip() for part in line.split()]
    return cells_of(line.strip("\r\n"), separator)


def is_number(cell: str) -> bool:
    """Whether a cell holds a number, as any program writes it."""
    return bool(_NUMBER.fullmatch(cell) or _COMMA_NUMBER.fullmatch(cell))


def _separator(body: list[str]) -> str:
    """The candidate that cuts most lines into the same number of cells."""
    best, share = r"\s+", 0.0
    for candidate in _SEPARATORS:
        counts = [line.count(candidate) for line in body]
        usual = max(set(counts), key=counts.count)
        agreeing = counts.count(usual) / len(counts)
        if usual > 0 and agreeing > share:
            best, share = candidate, agreeing
    return best


def _decimal(body: list[str], separator: str) -> str:
    """The mark that numbers are written with; DamageError where commas are thousands separators."""
    if separator == ",":
        return "."
    found = [cell for line in body for cell in cells(line, separator)]
    commas = [cell for cell in found if _COMMA_NUMBER.fullmatch(cell)]
    if commas and any(_POINT_NUMBER.fullmatch(cell) for cell in found):
        raise DamageError(
            f"{one_line(commas[0], 40)!r} beside numbers with a decimal point; "
            "write numbers without thousands separators"
        )
    return "," if commas else "."


def _header(comments: list[str], body: list[str], separator: str) -> tuple[tuple[str, ...], int]:
    """(column names, how many lines of the body the header takes)."""
    first = cells(body[0], separator)
    if any(cell and not is_number(cell) for cell in first):
        return _named(first), 1
    for line in reversed(comments):
        names = cells(line.strip().lstrip("#%"), separator)
        if len(names) == len(first) and all(name and not is_number(name) for name in names):
            return _named(names), 0
    return tuple(f"column_{i}" for i in range(len(first))), 0


def _named(names: list[str]) -> tuple[str, ...]:
    """The header's names; empty ones (an index that was written along) are numbered."""
    return tuple(name or f"column_{index}" for index, name in enumerate(names))


_SHOWN = 20


@dataclass(frozen=True)
class Rows:
    """Columns of a table: (N,) values each; empty cells are NaN and counted in `absent`."""

    values: Mapping[str, FloatArray]
    absent: Mapping[str, int] = field(default_factory=dict)


Reader = Callable[[Sequence[str], Ledger], Rows]


@dataclass(frozen=True)
class Table:
    """One table of a file. type: what --inspect shows; columns: the numeric ones; rows: how many.

    texts: columns of text, which `read` gives as codes.
    """

    name: str
    type: str
    columns: tuple[str, ...]
    rows: int
    read: Reader
    texts: tuple[str, ...] = ()


class TableLog:
    """The tables of one file. Times are whatever the columns hold, so epoch_ns is 0."""

    epoch_ns = 0

    def __init__(self, path: Path, tables: Sequence[Table], *, salvage: bool) -> None:
        self.path = path
        self._tables = {table.name: table for table in tables}
        self._ledger = Ledger(path, salvage=salvage)

    @property
    def losses(self) -> Mapping[str, int]:
        """Pieces of the file that could not be read (salvage only), by reason."""
        return self._ledger.pieces()

    def lost(self, reason: str, where: str) -> None:
        """Note that a piece of the file is lost; UsageError unless it is to be salvaged."""
        self._ledger.lost(reason, where)

    def topics(self) -> Sequence[Topic]:
        """The tables, without times: which column tells the time is for the mapping to say."""
        return tuple(
            Topic(t.name, t.type, t.rows, t.columns, None, None, has_header=False, texts=t.texts)
            for t in self._tables.values()
        )

    def series(self, wanted: Mapping[str, Sequence[str]]) -> Mapping[str, Series]:
        """The wanted columns by table; see RawLog."""
        return {name: self._series(name, tuple(dict.fromkeys(columns))) for name, columns in wanted.items()}

    def _series(self, name: str, columns: Sequence[str]) -> Series:
        if name not in self._tables:
            raise UsageError(
                f"{self.path}: no table '{one_line(name)}'; there are: {', '.join(self._tables)}"
            )
        table = self._tables[name]
        for column in columns:
            if column not in (*table.columns, *table.texts):
                raise UsageError(f"{self.path}: {_no_column(column, table.columns)}")
        ledger = self._ledger.same()
        rows = table.read(columns, ledger)
        count = min((len(v) for v in rows.values.values()), default=0)
        receive = np.full(count, np.nan)
        absent = {column: empty for column, empty in rows.absent.items() if empty}
        return Series(name, table.type, receive, None, rows.values, count, ledger.of(name), absent)


def _no_column(column: str, columns: Sequence[str]) -> str:
    close = difflib.get_close_matches(column, columns, 3, 0.5) or list(columns)[:_SHOWN]
    return f"no numeric column '{one_line(column, 80)}'; there are: {', '.join(close) or 'none'}"
