"""CSV (any separator, comments in front) and Parquet, read in pieces of 65 536 rows."""

from __future__ import annotations

import warnings
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq

from gpsim.channels import BoolArray, FloatArray
from gpsim.errors import UsageError
from gpsim.recordings.readers.damage import DamageError, Ledger, one_line, refusal, regular_file
from gpsim.recordings.readers.source import Codes
from gpsim.recordings.readers.table_log import Layout, Rows, Table, TableLog, cells, is_number, read_layout
from gpsim.recordings.table_files import PARQUET, check_parquet, check_width, is_text
from gpsim.recordings.values import check_columns

_PIECE = 65_536
_LOOK = 2_000


def open_csv(path: Path, salvage: bool) -> TableLog:
    """A text table; UsageError when it is none."""
    regular_file(path)
    try:
        layout = read_layout(path)
        check_width(path, len(layout.names))
        check_columns(layout.names, str(path))
        columns, texts = _kinds_of_columns(path, layout)
    except (DamageError, OSError) as error:
        raise refusal(path, "table", one_line(error)) from error
    count = len(cells(layout.last_line, layout.separator))
    cut = layout.rows > 1 and 0 < count < len(layout.names)
    read = partial(_read_csv, path, replace(layout, texts=texts), cut)
    log = TableLog(path, [Table(path.stem, "table", columns, layout.rows, read, texts)], salvage=salvage)
    if cut:
        log.lost(f"the last line has {count} of {len(layout.names)} cells", "the end")
    return log


def _pieces(
    path: Path, layout: Layout, columns: Sequence[str], rows: int | None = None
) -> Iterator[pd.DataFrame]:
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
    try:
        table = next(
            iter(_pieces(path, layout, layout.names, _LOOK)), pd.DataFrame(columns=list(layout.names))
        )
    except Exception as error:
        raise DamageError(f"not a table: {one_line(error, 120)}") from error
    numeric, texts = [], []
    for name in layout.names:
        column = table[name].dropna()
        numbers = pd.api.types.is_numeric_dtype(column) or (
            len(column) > 0 and sum(is_number(str(cell).strip()) for cell in column) * 2 >= len(column)
        )
        if numbers if len(column) else layout.rows > _LOOK:
            numeric.append(name)
        elif len(column):
            texts.append(name)
    return tuple(numeric), tuple(texts)


def _read_csv(path: Path, layout: Layout, cut: bool, columns: Sequence[str], ledger: Ledger) -> Rows:
    """The columns; `cut`: the last row ends in the middle of a number, for all that is known."""
    kept: dict[str, list[FloatArray]] = {name: [] for name in columns}
    absent = dict.fromkeys(columns, 0)
    texts: dict[str, Codes] = {name: Codes() for name in layout.texts if name in columns}
    first = layout.skip + 1
    try:
        for piece, is_last in _with_last(_pieces(path, layout, columns)):
            rows = piece[:-1] if cut and is_last else piece  # whoever opened the file has counted the cut one
            read = {
                name: texts[name].of(rows[name]) if name in texts else _numbers(rows[name], layout.decimal)
                for name in columns
            }
            good = _good_rows(
                rows, {name: bad for name, (_, _, bad) in read.items()}, first, path.stem, ledger
            )
            for name, (values, empty, _) in read.items():
                absent[name] += int(empty.sum())
                kept[name].append(values[good])
            first += len(piece)
    except (
        pd.errors.ParserError,
        pd.errors.EmptyDataError,
        ValueError,
        OverflowError,
        MemoryError,
        OSError,
    ) as error:
        ledger.lost(
            f"the rest of the table cannot be read: {one_line(error, 120)}", f"behind line {first - 1}"
        )
    return Rows({name: np.concatenate([np.empty(0), *parts]) for name, parts in kept.items()}, absent)


def _with_last(pieces: Iterator[pd.DataFrame]) -> Iterator[tuple[pd.DataFrame, bool]]:
    """Each piece, and whether it is the last; what was read before a fault comes before the fault."""
    piece = next(pieces, None)
    while piece is not None:
        try:
            following = next(pieces, None)
        except Exception:
            yield piece, False
            raise
        yield piece, following is None
        piece = following


def _good_rows(
    rows: pd.DataFrame, bad: Mapping[str, BoolArray], first: int, topic: str, ledger: Ledger
) -> BoolArray:
    """(N,) rows whose cells are all numbers; a row with several that are none is lost once. first: its line."""
    out = np.zeros(len(rows), dtype=np.bool_)
    for wrong in bad.values():
        out |= wrong
    if out.any():
        row = int(np.flatnonzero(out)[0])
        name = next(name for name, wrong in bad.items() if wrong[row])
        cell = one_line(rows[name].iloc[row], 40)
        where = f"line {first + row}, column {name}: {cell!r}"
        ledger.lost("a cell is not a number", where, topic, int(out.sum()))
    return ~out


def _numbers(column: Any, decimal: str) -> tuple[FloatArray, BoolArray, BoolArray]:
    """(values, empty cells, cells that are no numbers)."""
    empty = column.isna().to_numpy()
    if pd.api.types.is_numeric_dtype(column):
        return column.to_numpy(dtype=np.float64), empty, np.zeros(len(column), dtype=np.bool_)
    text = column.astype(str).str.strip().replace({"True": "1", "true": "1", "False": "0", "false": "0"})
    if decimal == ",":
        text = text.str.replace(",", ".", regex=False)
    values = pd.to_numeric(text, errors="coerce").to_numpy(dtype=np.float64)
    named = text.str.lower().isin(["nan", "inf", "-inf", "+inf", "infinity", "-infinity"]).to_numpy()
    return values, empty, np.isnan(values) & ~empty & ~named


def open_parquet(path: Path, salvage: bool) -> TableLog:
    """A Parquet file's flat numeric, boolean and time columns (times become seconds)."""
    regular_file(path)
    try:
        with pq.ParquetFile(path, **PARQUET) as file:
            check_parquet(path, file.metadata)
            names = file.schema_arrow.names
            columns = tuple(f.name for f in file.schema_arrow if _is_numeric(f.type))
            texts = tuple(f.name for f in file.schema_arrow if is_text(f.type))
            rows = file.metadata.num_rows
    except UsageError:
        raise
    except Exception as error:
        # pyarrow raises ArrowInvalid, OSError, ArrowNotImplementedError, MemoryError ...
        raise refusal(path, "footer", f"not a Parquet file: {one_line(error, 120)}") from error
    check_columns(names, str(path))
    table = Table(path.stem, "table", columns, rows, partial(_read_parquet, path, texts), texts)
    return TableLog(path, [table], salvage=salvage)


def _is_numeric(kind: Any) -> bool:
    types = pa.types
    return bool(
        types.is_integer(kind)
        or types.is_floating(kind)
        or types.is_boolean(kind)
        or types.is_timestamp(kind)
    )


def _read_parquet(path: Path, texts: Sequence[str], columns: Sequence[str], ledger: Ledger) -> Rows:
    kept: dict[str, list[FloatArray]] = {name: [] for name in columns}
    absent = dict.fromkeys(columns, 0)
    codes = {name: Codes() for name in texts if name in columns}
    rows = 0
    try:
        with pq.ParquetFile(path, read_dictionary=list(codes), **PARQUET) as file:
            for batch in file.iter_batches(batch_size=_PIECE, columns=list(columns), use_threads=False):
                made = {
                    name: codes[name].of(batch.column(name).to_pandas())[0]
                    if name in codes
                    else _seconds_or_numbers(batch.column(name))
                    for name in columns
                }
                for name in columns:
                    absent[name] += batch.column(name).null_count
                    kept[name].append(made[name])
                rows += batch.num_rows
    except Exception as error:  # as above
        ledger.lost(f"the rest of the table cannot be read: {one_line(error, 120)}", f"behind row {rows}")
    return Rows({name: np.concatenate([np.empty(0), *parts]) for name, parts in kept.items()}, absent)


def _seconds_or_numbers(column: Any) -> FloatArray:
    if pa.types.is_timestamp(column.type):
        ticks = {"s": 1.0, "ms": 1e3, "us": 1e6, "ns": 1e9}[column.type.unit]
        return np.asarray(column.cast(pa.int64()).to_numpy(zero_copy_only=False), dtype=np.float64) / ticks
    if pa.types.is_boolean(column.type):
        column = column.cast(pa.int8())
    return np.asarray(column.to_numpy(zero_copy_only=False), dtype=np.float64)
