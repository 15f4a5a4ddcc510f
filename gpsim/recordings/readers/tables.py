"""CSV (any separator, comments in front) and Parquet, read in pieces of 65 536 rows.

How a text table is written (comment lines, separator, decimal mark, header) is judged by the file's beginning.
"""

from __future__ import annotations

import difflib
import re
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq

from gpsim.channels import BoolArray, FloatArray
from gpsim.errors import UsageError
from gpsim.recordings.files import PARQUET, check_parquet, check_width, is_text
from gpsim.recordings.raw import Series, Topic
from gpsim.recordings.readers.container import DamageError, Ledger, refusal, regular_file
from gpsim.recordings.values import LONGEST_LINE, cells_of, check_columns, one_line

_HEAD = 1 << 18
_PIECE = 65_536
_LOOK = 2_000
_SHOWN = 20
_NUMBER = re.compile(
    r"[+-]?(\d+\.?\d*([eE][+-]?\d+)?|\.\d+([eE][+-]?\d+)?|nan|inf(inity)?|true|false)", re.IGNORECASE
)
_COMMA_NUMBER = re.compile(r"[+-]?\d+,\d+([eE][+-]?\d+)?")
_POINT_NUMBER = re.compile(r"[+-]?\d*\.\d+([eE][+-]?\d+)?")
Piece = Mapping[str, tuple[FloatArray, int]]
"""Some rows: by column the values (N,), NaN where empty, and how many cells are empty."""


@dataclass(frozen=True)
class Table:
    """One table of a file: its numeric columns, how many rows.

    texts: columns of text, which come as codes; pieces: reads columns and tells a ledger what is lost.
    """

    name: str
    columns: tuple[str, ...]
    rows: int
    pieces: Callable[[Sequence[str], Ledger], Iterator[Piece]]
    texts: tuple[str, ...] = ()


class TableLog:
    """The tables of one file. Times are whatever the columns hold, so epoch_ns is 0."""

    epoch_ns = 0

    def __init__(self, path: Path, tables: Sequence[Table], *, salvage: bool) -> None:
        self.path = path
        self._tables = {table.name: table for table in tables}
        self.ledger = Ledger(path, salvage=salvage)

    @property
    def losses(self) -> Mapping[str, int]:
        """Pieces of the file that could not be read (salvage only), by reason."""
        return self.ledger.pieces()

    def topics(self) -> Sequence[Topic]:
        """The tables, without times: which column tells the time is for the mapping to say."""
        return tuple(
            Topic(t.name, "table", t.rows, t.columns, None, None, has_header=False, texts=t.texts)
            for t in self._tables.values()
        )

    def series(self, wanted: Mapping[str, Sequence[str]]) -> Mapping[str, Series]:
        """The wanted columns by table; see RawLog."""
        return {name: self._series(name, tuple(dict.fromkeys(columns))) for name, columns in wanted.items()}

    def _series(self, name: str, columns: Sequence[str]) -> Series:
        if name not in self._tables:
            there = ", ".join(self._tables)
            raise UsageError(f"{self.path}: no table '{one_line(name)}'; there are: {there}")
        table = self._tables[name]
        for column in columns:
            if column not in (*table.columns, *table.texts):
                close = difflib.get_close_matches(column, table.columns, 3, 0.5) or table.columns[:_SHOWN]
                said = f"no numeric column '{one_line(column, 80)}'; there are: {', '.join(close) or 'none'}"
                raise UsageError(f"{self.path}: {said}")
        ledger = self.ledger.same()
        kept, absent = {column: [np.empty(0)] for column in columns}, dict.fromkeys(columns, 0)
        for piece in table.pieces(columns, ledger):
            for column, (part, empty) in piece.items():
                kept[column].append(part)
                absent[column] += empty
        values = {column: np.concatenate(parts) for column, parts in kept.items()}
        count = min(map(len, values.values()), default=0)
        absent = {column: empty for column, empty in absent.items() if empty}
        return Series(name, "table", np.full(count, np.nan), None, values, count, ledger.of(name), absent)


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


def _layout(path: Path) -> Layout:
    lines_there, last = _count_lines(path)
    with path.open("rb") as file:
        raw = file.read(_HEAD)
    encoding = "utf-8-sig"
    try:
        raw[: raw.rfind(b"\n") + 1].decode(encoding)
    except UnicodeDecodeError:
        encoding = "latin-1"
    lines = raw.decode(encoding, errors="replace").splitlines()
    if len(raw) == _HEAD:
        lines = lines[:-1]
    first = next((i for i, s in enumerate(lines) if s.strip() and not _is_comment(s)), len(lines))
    whole = [line for line in lines[first:] if line.strip()]
    body = whole[:40]
    if not body:
        raise DamageError("the file holds no table, only comments or empty lines")
    separator = _separator(body)
    names, header = _header(lines[:first], body, separator)
    return Layout(
        skip=first + header,
        separator=separator,
        decimal=_decimal(whole[header:], separator),
        encoding=encoding,
        names=tuple(name or f"column_{i}" for i, name in enumerate(names)),  # an index that was written along
        rows=max(0, lines_there - header),
        last_line=last.decode(encoding, "replace"),
        comments=_comments(path, encoding, separator, len(names)),
    )


def _count_lines(path: Path) -> tuple[int, bytes]:
    """(lines that are neither blank nor comment, the last of them); DamageError at what no text table has."""
    count, last = 0, b""
    with path.open("rb") as file:
        while line := file.readline(LONGEST_LINE + 1):
            begin = file.tell() - len(line)
            if len(line) > LONGEST_LINE:
                raise DamageError(f"a line at byte {begin} is longer than {LONGEST_LINE} bytes")
            if b"\0" in line:
                place = begin + line.index(0)
                raise DamageError(f"byte {place} is zero, so this is no UTF-8 text table")
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
                in_cells |= len(_cells(line[: line.index("#")], separator)) < count
    return tuple(found) if in_cells else None


def _is_comment(line: str) -> bool:
    return line.lstrip().startswith(("#", "%"))


def _cells(line: str, separator: str) -> list[str]:
    if separator == r"\s+":
        return [part.strip('"').strip() for part in line.split()]
    return cells_of(line.strip("\r\n"), separator)


def _is_number(cell: str) -> bool:
    return bool(_NUMBER.fullmatch(cell) or _COMMA_NUMBER.fullmatch(cell))


def _separator(body: list[str]) -> str:
    """The candidate that cuts most lines into the same number of cells."""
    best, share = r"\s+", 0.0
    for candidate in (",", ";", "\t", "|"):
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
    found = [cell for line in body for cell in _cells(line, separator)]
    commas = [cell for cell in found if _COMMA_NUMBER.fullmatch(cell)]
    if commas and any(_POINT_NUMBER.fullmatch(cell) for cell in found):
        beside = f"{one_line(commas[0], 40)!r} beside numbers with a decimal point"
        raise DamageError(f"{beside}; write numbers without thousands separators")
    return "," if commas else "."


def _header(comments: list[str], body: list[str], separator: str) -> tuple[Sequence[str], int]:
    """(column names, how many lines of the body the header takes)."""
    first = _cells(body[0], separator)
    if any(cell and not _is_number(cell) for cell in first):
        return first, 1
    for line in reversed(comments):
        names = _cells(line.strip().lstrip("#%"), separator)
        if len(names) == len(first) and all(name and not _is_number(name) for name in names):
            return names, 0
    return [""] * len(first), 0


def open_csv(path: Path, salvage: bool) -> TableLog:
    """A text table; UsageError when it is none."""
    regular_file(path)
    try:
        layout = _layout(path)
        check_width(path, len(layout.names))
        check_columns(layout.names, str(path))
        columns, texts = _kinds_of_columns(path, layout)
    except (DamageError, OSError) as error:
        raise refusal(path, "table", one_line(error)) from error
    count = len(_cells(layout.last_line, layout.separator))
    cut = layout.rows > 1 and 0 < count < len(layout.names)
    # A last row that ends early ends in the middle of a number, for all that is known.
    pieces = partial(_of_csv, path, replace(layout, texts=texts), layout.rows - 1 if cut else None)
    log = TableLog(path, [Table(path.stem, columns, layout.rows, pieces, texts)], salvage=salvage)
    if cut:
        log.ledger.lost(f"the last line has {count} of {len(layout.names)} cells", "the end")
    return log


def _frames(path: Path, layout: Layout, columns: Sequence[str], rows: int | None) -> Iterator[pd.DataFrame]:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        reader = pd.read_csv(
            path,
            sep=layout.separator,
            decimal=layout.decimal,
            encoding=layout.encoding,
            encoding_errors="replace",
            names=list(layout.names),
            usecols=list(columns),
            skiprows=layout.skip if layout.comments is None else [*range(layout.skip), *layout.comments],
            nrows=rows,
            chunksize=_PIECE,
            header=None,
            index_col=False,
            comment="#" if layout.comments is None else None,
            dtype={name: str for name in layout.texts if name in columns},
            float_precision="round_trip",
            low_memory=False,
        )
        with reader:
            yield from reader


def _kinds_of_columns(path: Path, layout: Layout) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """(numeric columns, columns of text).

    Of a numeric column at least half of the first rows' filled cells are numbers; what begins later may be one.
    """
    empty = pd.DataFrame(columns=list(layout.names))
    try:
        table = next(iter(_frames(path, layout, layout.names, _LOOK)), empty)
    except Exception as error:
        raise DamageError(f"not a table: {one_line(error, 120)}") from error
    numeric, texts = [], []
    for name in layout.names:
        column = table[name].dropna()
        numbers = pd.api.types.is_numeric_dtype(column) or (
            len(column) > 0 and sum(_is_number(str(cell).strip()) for cell in column) * 2 >= len(column)
        )
        if numbers if len(column) else layout.rows > _LOOK:
            numeric.append(name)
        elif len(column):
            texts.append(name)
    return tuple(numeric), tuple(texts)


def _of_csv(
    path: Path, layout: Layout, rows: int | None, columns: Sequence[str], ledger: Ledger
) -> Iterator[Piece]:
    """The columns of the first `rows` rows, or of all; a row with several cells that are no numbers is lost once."""
    texts = {name: Codes() for name in layout.texts if name in columns}
    first = layout.skip + 1
    try:
        for frame in _frames(path, layout, columns, rows):
            empty = {name: frame[name].isna().to_numpy(dtype=np.bool_) for name in columns}
            values = {
                name: texts[name].of(frame[name]) if name in texts else _numbers(frame[name], layout.decimal)
                for name in columns
            }
            none = np.zeros(len(frame), dtype=np.bool_)
            bad = {
                name: none if name in texts else _odd(frame[name], values[name], empty[name])
                for name in columns
            }
            out = np.logical_or.reduce([none, *bad.values()])
            if out.any():
                row = int(np.flatnonzero(out)[0])
                name = next(name for name in columns if bad[name][row])
                where = f"line {first + row}, column {name}: {one_line(frame[name].iloc[row], 40)!r}"
                ledger.lost("a cell is not a number", where, path.stem, int(out.sum()))
            yield {name: (values[name][~out], int(empty[name].sum())) for name in columns}
            first += len(frame)
    except (
        pd.errors.ParserError,
        pd.errors.EmptyDataError,
        ValueError,
        OverflowError,
        MemoryError,
        OSError,
    ) as error:
        reason = f"the rest of the table cannot be read: {one_line(error, 120)}"
        ledger.lost(reason, f"behind line {first - 1}")


class Codes:
    """Texts as 0, 1, 2 ... in the order in which they first appear, over all the pieces of a column."""

    def __init__(self) -> None:
        self.known: dict[str, int] = {}

    def of(self, column: pd.Series) -> FloatArray:
        """(N,), NaN where empty."""
        empty = column.isna().to_numpy(dtype=np.bool_)
        held = column[~empty].astype("category").cat  # a word is looked at once, however often it is there
        code = np.full(len(held.categories), np.nan)
        for at in held.codes.drop_duplicates().tolist():
            code[at] = self.known.setdefault(str(held.categories[at]).strip(), len(self.known))
        codes = np.full(len(column), np.nan)
        codes[~empty] = code[held.codes.to_numpy()]
        return codes


def _numbers(column: Any, decimal: str) -> FloatArray:
    if not pd.api.types.is_numeric_dtype(column):
        column = (
            column.astype(str).str.strip().replace({"True": "1", "true": "1", "False": "0", "false": "0"})
        )
        if decimal == ",":
            column = column.str.replace(",", ".", regex=False)
        column = pd.to_numeric(column, errors="coerce")
    return np.asarray(column.to_numpy(dtype=np.float64))


def _odd(column: Any, values: FloatArray, empty: BoolArray) -> BoolArray:
    """(N,) cells that are no numbers, not even `nan`."""
    unread = np.isnan(values) & ~empty
    if not unread.any() or pd.api.types.is_numeric_dtype(column):
        return np.zeros(len(values), dtype=np.bool_)
    text = column.astype(str).str.strip().str.lower()
    named = text.isin(["nan", "inf", "-inf", "+inf", "infinity", "-infinity"]).to_numpy(dtype=np.bool_)
    return np.asarray(unread & ~named)


def open_parquet(path: Path, salvage: bool) -> TableLog:
    """A Parquet file's flat numeric, boolean and time columns (times become seconds)."""
    regular_file(path)
    types = pa.types
    kinds = (types.is_integer, types.is_floating, types.is_boolean, types.is_timestamp)
    try:
        with pq.ParquetFile(path, **PARQUET) as file:
            check_parquet(path, file.metadata)
            names = file.schema_arrow.names
            columns = tuple(f.name for f in file.schema_arrow if any(kind(f.type) for kind in kinds))
            texts = tuple(f.name for f in file.schema_arrow if is_text(f.type))
            rows = file.metadata.num_rows
    except UsageError:
        raise
    except Exception as error:
        # pyarrow raises ArrowInvalid, OSError, ArrowNotImplementedError, MemoryError ...
        raise refusal(path, "footer", f"not a Parquet file: {one_line(error, 120)}") from error
    check_columns(names, str(path))
    table = Table(path.stem, columns, rows, partial(_of_parquet, path, texts), texts)
    return TableLog(path, [table], salvage=salvage)


def _of_parquet(path: Path, texts: Sequence[str], columns: Sequence[str], ledger: Ledger) -> Iterator[Piece]:
    codes, rows = {name: Codes() for name in texts if name in columns}, 0
    try:
        with pq.ParquetFile(path, read_dictionary=list(codes), **PARQUET) as file:
            for batch in file.iter_batches(batch_size=_PIECE, columns=list(columns), use_threads=False):
                held = {name: batch.column(name) for name in columns}
                yield {
                    name: (
                        codes[name].of(column.to_pandas()) if name in codes else _seconds_or_numbers(column),
                        column.null_count,
                    )
                    for name, column in held.items()
                }
                rows += batch.num_rows
    except Exception as error:  # as above
        ledger.lost(f"the rest of the table cannot be read: {one_line(error, 120)}", f"behind row {rows}")


def _seconds_or_numbers(column: Any) -> FloatArray:
    if pa.types.is_timestamp(column.type):
        ticks = {"s": 1.0, "ms": 1e3, "us": 1e6, "ns": 1e9}[column.type.unit]
        return np.asarray(column.cast(pa.int64()).to_numpy(zero_copy_only=False), dtype=np.float64) / ticks
    if pa.types.is_boolean(column.type):
        column = column.cast(pa.int8())
    return np.asarray(column.to_numpy(zero_copy_only=False), dtype=np.float64)
