"""ROS 1 bags, format 2.0 (wiki.ros.org/Bags/Format/2.0), walked record by record."""

from __future__ import annotations

import struct
from collections.abc import Generator, Iterable, Iterator
from dataclasses import dataclass

from gpsim.recordings.readers.bag1_records import (
    CHUNK,
    CONNECTION,
    MESSAGE,
    Record,
    next_record,
    number,
    read_index,
    read_record,
    stream_of,
    text,
    time,
)
from gpsim.recordings.readers.chunked import Catalogue, Chunked, Head
from gpsim.recordings.readers.damage import DamageError, Ledger
from gpsim.recordings.readers.source import Budget, Message, Source


class Bag1(Chunked[Record]):
    """One ROS 1 bag."""

    magic = b"#ROSBAG V2.0\n"
    kind = ("a ROS 1 bag", "it does not begin with #ROSBAG V2.0")
    index_name = "index"
    chunk_op = CHUNK

    def read_index(self, source: Source) -> Catalogue:
        """What the index says."""
        return read_index(source, len(self.magic))

    def read_record(self, source: Source, position: int) -> Record:
        """The record at a place."""
        return read_record(source, position)

    def next_record(self, source: Source, start: int, found: Catalogue) -> int | None:
        """Where the next chunk begins."""
        return next_record(source, start, CHUNK)

    def head(self, source: Source, record: Record) -> Head:
        """A chunk's head."""
        size = number(record.fields, b"size")
        return Head(record.data, record.size, text(record.fields, b"compression"), size)

    def outside(self, source: Source, record: Record, found: Catalogue, budget: Budget) -> Iterable[Message]:
        """Connections are noted; messages are in chunks alone."""
        if record.op == CONNECTION and found.listing:
            found.add(stream_of(source, record))
        return ()

    def in_chunk(self, chunk: bytes, found: Catalogue, ledger: Ledger, budget: Budget) -> Iterator[Message]:
        """The messages of a chunk."""
        position: int | None = 0
        source, end = Source(chunk, len(chunk)), len(chunk)
        layout: _Layout | None = None
        while position is not None and position < end and not ledger.exhausted:
            if layout is not None:
                position = yield from _run(chunk, position, layout)
                if position >= end:
                    return
            try:
                record = read_record(source, position)
                if record.end > end:
                    raise DamageError(f"a record reaches {record.end - end} bytes beyond its chunk")
                if record.op == MESSAGE:
                    stamp = time(record.fields)
                    yield number(record.fields, b"conn"), stamp, chunk[record.data : record.end]
                    layout = _layout_of(record)
                elif record.op == CONNECTION:
                    budget.record()
                    if found.listing:
                        found.add(stream_of(source, record))
                else:
                    raise DamageError(f"a record of kind {record.op} lies inside a chunk")
                position = record.end
            except DamageError as error:
                ledger.lost(error.reason, f"{self.where}, byte {position} of the chunk")
                position = next_record(source, position + 1, MESSAGE)


_MARKS = {b"conn": b"\x09\0\0\0conn=", b"op": b"\x04\0\0\0op=\x02", b"time": b"\x0d\0\0\0time="}
_SHAPES = {b"conn": "9sI", b"op": "8s", b"time": "9sII"}
_WIDTHS = {b"conn": 2, b"op": 1, b"time": 3}


@dataclass(frozen=True)
class _Layout:
    """A message header whose three fields come in this order, read in one go."""

    order: tuple[bytes, ...]

    @property
    def shape(self) -> struct.Struct:
        """Header length, fields with their marks, data length."""
        return struct.Struct(f"<I{''.join(_SHAPES[name] for name in self.order)}I")

    def place(self, field: bytes) -> int:
        """Where a field's mark stands among the unpacked values."""
        return 1 + sum(_WIDTHS[name] for name in self.order[: self.order.index(field)])


def _layout_of(record: Record) -> _Layout | None:
    """The order of a message header that holds nothing but the three fields, as recorders write it."""
    order = tuple(record.fields)
    return _Layout(order) if sorted(order) == sorted(_MARKS) and record.data - record.start == 46 else None


def _run(chunk: bytes, position: int, layout: _Layout) -> Generator[Message, None, int]:
    """Messages in a row whose headers have this layout; returns where the first other record begins."""
    unpack, front, end = layout.shape.unpack_from, layout.shape.size, len(chunk)
    conn, op, when = (layout.place(name) for name in (b"conn", b"op", b"time"))
    conn_mark, op_mark, time_mark = _MARKS[b"conn"], _MARKS[b"op"], _MARKS[b"time"]
    while position + front <= end:
        head = unpack(chunk, position)
        start = position + front
        after = start + head[-1]
        sound = head[0] == 38 and head[conn] == conn_mark and head[op] == op_mark and head[when] == time_mark
        if not sound or after > end:
            break
        position = after
        yield head[conn + 1], head[when + 1] * 1_000_000_000 + head[when + 2], chunk[start:after]
    return position
