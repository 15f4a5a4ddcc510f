"""MATLAB v5 files: numeric arrays of equal length make a table; columns of matrices are name.0, name.1."""

from __future__ import annotations

import struct
import warnings
import zlib
from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import scipy.io

from gpsim.channels import FloatArray
from gpsim.errors import UsageError
from gpsim.recordings.names import check_columns
from gpsim.recordings.readers.damage import DamageError, Ledger, one_line, refusal, regular_file
from gpsim.recordings.readers.table_log import Rows, Table, TableLog

_MAX_BYTES = 256 << 20
_HEADER = 128
_COMPRESSED = 15
_STEP = 1 << 20
_MAX_COLUMNS = 64
_MAX_DEPTH = 8


def open_matlab(path: Path, salvage: bool) -> TableLog:
    """The largest table, named after the file, others as name.length; scalars only if there is nothing else."""
    size = regular_file(path)
    try:
        _check_size(path, size)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            raw = scipy.io.loadmat(path, simplify_cells=True)
    except NotImplementedError as error:
        raise refusal(path, "header", "MATLAB 7.3 files are HDF5; save it with save(..., '-v7')") from error
    except UsageError:
        raise
    except Exception as error:
        # scipy raises MatReadError, ValueError, TypeError, zlib.error, MemoryError ...
        raise refusal(path, "MATLAB file", f"cannot be read: {one_line(error, 120)}") from error
    tables: dict[int, dict[str, FloatArray]] = {}
    found = _columns(raw)
    check_columns([name for name, _ in found], str(path))
    for name, column in found:
        tables.setdefault(len(column), {})[name] = column
    sizes = sorted(tables, key=lambda rows: rows * len(tables[rows]), reverse=True)
    sizes = [rows for rows in sizes if rows > 1] or sizes
    if not sizes:
        raise refusal(path, "MATLAB file", "it holds no numeric arrays")
    names = [path.stem, *(f"{path.stem}.{rows}" for rows in sizes[1:])]
    made = [
        Table(name, "table", tuple(tables[rows]), rows, partial(_read, tables[rows]))
        for name, rows in zip(names, sizes, strict=True)
    ]
    return TableLog(path, made, salvage=salvage)


def _read(table: Mapping[str, FloatArray], columns: Sequence[str], ledger: Ledger) -> Rows:
    return Rows({name: table[name] for name in columns})


def _check_size(path: Path, size: int) -> None:
    """Refuse a file whose compressed variables make more than 1 GiB (a few bytes can stand for gigabytes)."""
    with path.open("rb") as file:
        head = file.read(_HEADER)
        if not head.startswith(b"MATLAB 5.0") or head[126:128] not in (b"IM", b"MI"):
            return
        order = "<" if head[126:128] == b"IM" else ">"
        position, total = _HEADER, 0
        while position + 8 <= size:
            file.seek(position)
            kind, length = struct.unpack(f"{order}II", file.read(8))
            if position + 8 + length > size:
                raise DamageError(f"byte {position}: a variable of {length} bytes reaches beyond the file")
            total += _expanded(file.read(length), _MAX_BYTES - total) if kind == _COMPRESSED else length
            if total > _MAX_BYTES:
                raise DamageError(f"its variables take more than {_MAX_BYTES} bytes")
            position += 8 + length


def _expanded(data: bytes, limit: int) -> int:
    machine = zlib.decompressobj()
    total, feed = 0, data
    while feed and not machine.eof and total <= limit:
        total += len(machine.decompress(feed, _STEP))
        feed = machine.unconsumed_tail
    return total


def _columns(raw: Mapping[str, Any], prefix: str = "", depth: int = 0) -> list[tuple[str, FloatArray]]:
    """(dotted name, values) of every numeric vector, also inside structs."""
    found: list[tuple[str, FloatArray]] = []
    for key, value in raw.items():
        name = f"{prefix}{key}"
        if isinstance(value, Mapping) and depth < _MAX_DEPTH:
            found += _columns(value, f"{name}.", depth + 1)
            continue
        if key.startswith("__"):
            continue
        array = np.asarray(value)
        if array.dtype.kind not in "biuf" or array.ndim > 2 or array.size == 0:
            continue
        if array.ndim == 2 and min(array.shape) > 1:
            table = array if array.shape[0] >= array.shape[1] else array.T
            count = min(table.shape[1], _MAX_COLUMNS)
            found += [(f"{name}.{i}", np.asarray(table[:, i], dtype=np.float64)) for i in range(count)]
        else:
            found.append((name, np.asarray(array, dtype=np.float64).reshape(-1)))
    return found
