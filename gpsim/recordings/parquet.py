"""Parquet files before anything of them is read: how much their columns make, and which hold text.

A column that always says the same takes no bytes on the disk and eight a row in memory.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pyarrow as pa

from gpsim.errors import UsageError
from gpsim.limits import TABLE_BYTES, TABLE_COLUMNS, TABLE_GROWTH, allowed, more

PARQUET: dict[str, Any] = {"thrift_string_size_limit": 16 << 20, "thrift_container_size_limit": 1 << 20}
"""What of a file's own description is believed."""
NUMBER = 8  # bytes


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
    held = kind.value_type if pa.types.is_dictionary(kind) else kind
    return str(held) in ("string", "large_string", "string_view")


def is_plain(kind: Any) -> bool:
    """Whether an Arrow type is numbers, times or text: no lists, tables or bytes, which nothing is measured in."""
    types = pa.types
    return bool(types.is_primitive(kind) or types.is_boolean(kind) or is_text(kind))
