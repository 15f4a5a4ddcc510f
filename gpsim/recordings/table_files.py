"""Tables of recordings: their columns, and the episodes in them.

Of a Parquet file it is asked first how much its columns make: one that always says the same takes no bytes on the disk
and eight a row in memory.
"""

from __future__ import annotations

import csv
import re
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import NDArray

from gpsim.channels import Channels, IntArray
from gpsim.errors import UsageError
from gpsim.limits import TABLE_BYTES, TABLE_COLUMNS, TABLE_GROWTH, allowed, more
from gpsim.recordings.poses import pose_values
from gpsim.recordings.recording import UNSEEN, Episode
from gpsim.recordings.values import (
    LARGEST,
    LONGEST_LINE,
    Columns,
    check_columns,
    check_name,
    fault_of,
    numbers_of,
    one_line,
)

if TYPE_CHECKING:
    import pandas as pd

PARQUET: dict[str, Any] = {"thrift_string_size_limit": 16 << 20, "thrift_container_size_limit": 1 << 20}
"""What of a file's own description is believed."""
NUMBER = 8  # bytes
SMALL = 2 << 20  # bytes of a text table that is read before pandas is loaded
_NUMBERS = re.compile(rb"[-+.,eE0-9\n]+")


def check_parquet(path: Path, metadata: Any) -> None:
    """Refuse a file whose values take more memory than one of its size should; raises UsageError."""
    columns, groups = metadata.num_columns, range(metadata.num_row_groups)
    check_width(path, columns)
    values = written = 0
    for group in map(metadata.row_group, groups):
        values += sum(group.column(i).num_values for i in range(columns))
        written += group.total_byte_size
    made = max(NUMBER * max(values, metadata.num_rows * columns), written)
    limit = TABLE_BYTES + TABLE_GROWTH * path.stat().st_size
    if made > allowed(limit):
        raise UsageError(
            f"{path}: its values take {made} bytes or more, the limit for a file of its size is {allowed(limit)}; "
            f"{more(made, limit)}"
        )


def check_width(path: Path, columns: int) -> None:
    """Refuse a table of more columns than anything measures."""
    if columns > allowed(TABLE_COLUMNS):
        raise UsageError(
            f"{path}: it has {columns} columns, the limit is {allowed(TABLE_COLUMNS)}; {more(columns, TABLE_COLUMNS)}"
        )


def is_text(kind: Any) -> bool:
    """Whether an Arrow type is text; pandas' categories are a dictionary."""
    import pyarrow as pa  # here, as pandas below: who reads a small table of numbers need not wait for them

    held = kind.value_type if pa.types.is_dictionary(kind) else kind
    return str(held) in ("string", "large_string", "string_view")


def is_plain(kind: Any) -> bool:
    """Whether an Arrow type is numbers, times or text: no lists, tables or bytes, which nothing is measured in."""
    import pyarrow.types as types

    return bool(types.is_primitive(kind) or types.is_boolean(kind) or is_text(kind))


def read_frame(path: Path, precision: Literal["round_trip"] | None = None) -> pd.DataFrame:
    """A CSV or Parquet table; UsageError where it cannot be read or two columns have one name.

    Episodes are called letter by letter what the table says: NA and 007 are names, too. precision: pandas'
    float_precision, for CSV.
    """
    import pandas as pd

    if path.exists() and not path.is_file():
        raise UsageError(f"{path}: is no ordinary file; name a CSV or Parquet table")
    try:
        names = _parquet_names(path) if path.suffix == ".parquet" else _csv_names(path)
        check_columns(names, str(path))
        if path.suffix == ".parquet":
            return _parquet(path)
        frame = pd.read_csv(path, dtype={"episode": str}, float_precision=precision)
        if "episode" in frame.columns and frame["episode"].isna().any():
            said = pd.read_csv(path, usecols=["episode"], dtype=str, keep_default_na=False)["episode"]
            frame["episode"] = said.where(said != "")
        return frame
    except UsageError:
        raise
    except Exception as error:  # pandas and pyarrow raise a dozen kinds on a damaged file
        raise UsageError(f"{path}: cannot be read: {one_line(error, 160)}") from error


def _parquet_names(path: Path) -> list[str]:
    import pyarrow.parquet as pq

    with pq.ParquetFile(path, **PARQUET) as file:
        check_parquet(path, file.metadata)
        return [str(name) for name in file.schema_arrow.names]


def _parquet(path: Path) -> pd.DataFrame:
    """A file's columns of numbers, times and text; a text that is there many times is held once."""
    import pandas as pd
    import pyarrow.parquet as pq

    with pq.ParquetFile(path, **PARQUET) as file:
        fields = [field for field in file.schema_arrow if is_plain(field.type)]
    texts = [field.name for field in fields if is_text(field.type)]
    frame = pd.read_parquet(path, columns=[field.name for field in fields], read_dictionary=texts)
    for name in texts:
        frame[name] = frame[name].astype("category").astype(object)
    return frame


def _csv_names(path: Path) -> list[str]:
    with path.open("rb") as file:
        if len(file.readline(LONGEST_LINE + 1)) > LONGEST_LINE:
            raise UsageError(
                f"{path}: its first line is longer than {LONGEST_LINE} bytes; write a table with line breaks"
            )
    with path.open(newline="", encoding="utf-8-sig", errors="replace") as file:
        first = next((row for row in csv.reader(file) if row), [])
    check_width(path, len(first))
    return [name.strip() or f"column_{number}" for number, name in enumerate(first)]


def read_exactly(path: Path) -> Columns:
    """The columns of a table, each number the nearest to what is written; UsageError as `read_frame`."""
    plain = _plain(path)
    return columns_of(read_frame(path, "round_trip")) if plain is None else plain


def _plain(path: Path) -> Columns | None:
    """What pandas reads of a small text table that holds numbers alone; None of any other, or of a damaged one."""
    if path.suffix == ".parquet" or not path.is_file() or path.stat().st_size > SMALL:
        return None
    try:
        head, _, body = path.read_bytes().partition(b"\n")
        names = head.decode().split(",")
        if len(head) > LONGEST_LINE or len({*names}) < len(names) or len(names) > allowed(TABLE_COLUMNS):
            return None
        if any(fault_of(name) or name != name.strip() or '"' in name for name in names):
            return None
        if not _NUMBERS.fullmatch(body):
            return None
        rows = [line.split(",") for line in body.decode().split("\n") if line]
        written = dict(zip(names, zip(*rows, strict=True), strict=True))
        texts = {"episode": np.array(written.pop("episode"), dtype=object)} if "episode" in written else {}
        if any((values == "").any() for values in texts.values()):
            return None
        numbers = {
            name: np.array([float(cell or "nan") for cell in cells]) for name, cells in written.items()
        }
    except (OSError, ValueError):
        return None
    return {name: (texts | numbers)[name] for name in names}


def columns_of(frame: pd.DataFrame) -> Columns:
    """The columns of a table that is there already; an episode without a name is called ""."""
    columns = {str(name): _values(frame[name]) for name in frame.columns}
    if "episode" in columns:
        columns["episode"] = np.where(frame["episode"].isna(), "", frame["episode"].to_numpy(object))
    return columns


def _values(column: pd.Series[Any]) -> NDArray[Any]:
    """What is missing among numbers is NaN."""
    kind = column.dtype.kind
    if isinstance(column.dtype, np.dtype):
        return column.to_numpy()
    if kind in "fiub":
        return column.to_numpy(np.float64, na_value=np.nan)
    return column.to_numpy(f"{kind}8[ns]" if kind in "mM" else object)


def episodes_of(
    table: Columns, where: str, state: Channels, action: Channels, poses: Channels = UNSEEN
) -> tuple[Episode, ...]:
    """The episodes of a table with the columns episode, t, `state`, `action` and `poses`; where: its name in messages.

    The last row's action of an episode never acted, and may be empty. UsageError names episode, row and column.
    """
    named = table["episode"].tolist()
    if "" in named:
        raise UsageError(f"{where}: row {named.index('')}: no episode; give every row its episode's name")
    places = {name: place for place, name in enumerate(dict.fromkeys(named))}
    of = np.array([places[name] for name in named], dtype=np.int64)
    each = np.split(np.argsort(of, kind="stable"), np.cumsum(np.bincount(of))[:-1])
    columns = ("t", *state.names, *action.names)
    return tuple(
        replace(
            _episode(str(name), table, columns, rows, 1 + len(state), where),
            poses=pose_values(table, rows, poses),
        )
        for name, rows in zip(places, each if places else [], strict=True)
    )


def _episode(
    name: str, table: Columns, columns: Sequence[str], rows: IntArray, states: int, where: str
) -> Episode:
    check_name(name, f"{where}: column episode")
    try:
        values = numbers_of(table, columns, rows)
    except (ValueError, TypeError) as error:
        raise UsageError(f"{where}: episode {name}: a value is not a number: {error}") from error
    used = np.ones(values.shape, dtype=np.bool_)
    used[-1, states:] = False
    unfinite, large = ~np.isfinite(values) & used, (np.abs(values) > LARGEST) & np.isfinite(values) & used
    for bad in (np.argwhere(unfinite), np.argwhere(large)):
        if len(bad):
            row, column = (int(i) for i in bad[0])
            value, more = values[row, column], f"({len(bad)} such value(s)); drop or repair the rows"
            place, channel = f"{where}: episode {name}, row {rows[row]}", columns[column]
            if not np.isfinite(value):
                raise UsageError(f"{place}, channel {channel}: {value} is not finite {more}")
            raise UsageError(
                f"{place}, column {channel}: {value:g} is no measurement, none is larger than {LARGEST:g} {more}"
            )
    t = values[:, 0]
    back = np.flatnonzero(np.diff(t) <= 0)
    if back.size:
        row = int(back[0]) + 1
        raise UsageError(
            f"{where}: episode {name}, row {rows[row]}: t does not increase ({t[row - 1]:g}, then {t[row]:g}); "
            "sort the rows, or give every run an episode of its own"
        )
    return Episode(name, t, values[:, 1:states], values[:-1, states:])
