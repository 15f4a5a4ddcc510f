"""A table as a raw log: one topic, named after the file, whose fields are the numeric columns.

Nothing was received, so there are no receive times and no header stamps: the import's mapping names the time column.
"""

from __future__ import annotations

import difflib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from gpsim.channels import FloatArray
from gpsim.errors import UsageError
from gpsim.recordings.raw import Series, Topic
from gpsim.recordings.readers.damage import Ledger, one_line

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
