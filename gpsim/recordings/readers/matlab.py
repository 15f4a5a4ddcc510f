"""MATLAB v5 files: numeric arrays of equal length make a table; columns of matrices are name.0, name.1."""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import scipy.io

from gpsim.channels import FloatArray
from gpsim.errors import UsageError
from gpsim.recordings.names import check_columns
from gpsim.recordings.readers.damage import Ledger, one_line, refusal, regular_file
from gpsim.recordings.readers.matlab_size import check_matlab
from gpsim.recordings.readers.table_log import Rows, Table, TableLog

_MAX_COLUMNS = 64
_MAX_DEPTH = 8


def open_matlab(path: Path, salvage: bool) -> TableLog:
    """The largest table, named after the file, others as name.length; scalars only if there is nothing else."""
    size = regular_file(path)
    try:
        check_matlab(path, size)
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
