"""How much a MATLAB v5 file makes in memory, by the dimensions that its variables declare, before any is made.

scipy allots an array as large as its header says, of cells and structs, too, and only then looks for the values.
"""

from __future__ import annotations

import math
import struct
import warnings
import zlib
from collections.abc import Iterator, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import scipy.io

from gpsim.channels import FloatArray
from gpsim.errors import UsageError
from gpsim.limits import MATLAB_BYTES, allowed, more
from gpsim.recordings.readers.container import DamageError, Ledger, refusal, regular_file
from gpsim.recordings.readers.tables import Piece, Table, TableLog
from gpsim.recordings.values import check_columns, one_line

_HEADER = 128
_COMPRESSED, _MATRIX = 15, 14
_CELL, _STRUCT, _OBJECT = 1, 2, 3
_DEEPEST = 16
_NUMBER = 8  # bytes


class _Room:
    """Bytes that may be made of a file yet."""

    def __init__(self, order: str) -> None:
        self.order = order
        self.limit = self.left = allowed(MATLAB_BYTES)

    def take(self, count: float) -> None:
        """Take them; DamageError where there are no more."""
        self.left -= int(min(count, 2.0**62))
        if self.left < 0:
            raise DamageError(f"its variables take more than {self.limit} bytes; {more()}")

    def matrix(self, body: bytes, depth: int) -> None:
        """One variable, or a field or cell of one; what is damaged in it scipy finds."""
        if depth > _DEEPEST:
            raise DamageError(f"its variables are nested more than {_DEEPEST} deep")
        flags, position = self._element(body, 0)
        dims, position = self._element(body, position)
        _, position = self._element(body, position)
        if len(flags) < 4:
            return
        kind = struct.unpack(f"{self.order}I", flags[:4])[0] & 0xFF
        sizes = struct.unpack(f"{self.order}{len(dims) // 4}i", dims[: len(dims) // 4 * 4])
        count, fields = math.prod(max(0, size) for size in sizes), 1
        if kind in (_STRUCT, _OBJECT):
            if kind == _OBJECT:
                _, position = self._element(body, position)
            longest, position = self._element(body, position)
            names, position = self._element(body, position)
            width = struct.unpack(f"{self.order}i", longest[:4])[0] if len(longest) >= 4 else 0
            fields = len(names) // width if width > 0 else 0
        self.take(_NUMBER * count * max(1, fields))
        if kind not in (_CELL, _STRUCT, _OBJECT):
            return
        if count * max(1, fields) * 8 > len(body):
            raise DamageError(f"a variable of {len(body)} bytes declares {count} cells or structs")
        while position + 8 <= len(body):
            kind = struct.unpack_from(f"{self.order}I", body, position)[0]
            inner, position = self._element(body, position)
            if kind == _MATRIX:
                self.matrix(inner, depth + 1)

    def _element(self, body: bytes, position: int) -> tuple[bytes, int]:
        """(the data of the element at a place, where the next begins); of what is not there nothing."""
        if position + 8 > len(body):
            return b"", len(body)
        kind, length = struct.unpack_from(f"{self.order}II", body, position)
        if kind >> 16:  # a small one: its length beside its kind, its data behind
            return body[position + 4 : position + 4 + min(4, kind >> 16)], position + 8
        data = body[position + 8 : position + 8 + length]
        return data, position + 8 + length + (0 if kind == _MATRIX else -length % 8)


def check_matlab(path: Path, size: int) -> None:
    """DamageError where a file of `size` bytes makes more than it may; what is no v5 file is scipy's to refuse."""
    with path.open("rb") as file:
        head = file.read(_HEADER)
        if not head.startswith(b"MATLAB 5.0") or head[126:128] not in (b"IM", b"MI"):
            return
        room = _Room("<" if head[126:128] == b"IM" else ">")
        position = _HEADER
        while position + 8 <= size:
            file.seek(position)
            kind, length = struct.unpack(f"{room.order}II", file.read(8))
            position += 8 + length
            if position > size:
                begin = position - 8 - length
                raise DamageError(f"byte {begin}: a variable of {length} bytes reaches beyond the file")
            body = file.read(length)
            if kind == _COMPRESSED:  # of which at most one byte more than the limit is made
                try:
                    raw = zlib.decompressobj().decompress(body, 8 + room.left + 1)
                except zlib.error as error:
                    raise DamageError(f"a compressed variable is damaged: {error}") from error
                kind, _ = struct.unpack_from(f"{room.order}II", raw.ljust(8, b"\0"))
                body = raw[8:]
            room.take(len(body))
            if kind == _MATRIX:
                room.matrix(body, 0)


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
        Table(name, tuple(tables[rows]), rows, partial(_pieces, tables[rows]))
        for name, rows in zip(names, sizes, strict=True)
    ]
    return TableLog(path, made, salvage=salvage)


def _pieces(table: Mapping[str, FloatArray], columns: Sequence[str], _: Ledger) -> Iterator[Piece]:
    yield {name: (table[name], 0) for name in columns}


def _columns(raw: Mapping[str, Any], prefix: str = "", depth: int = 0) -> list[tuple[str, FloatArray]]:
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
