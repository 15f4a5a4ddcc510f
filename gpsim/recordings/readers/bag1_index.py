"""The index of a ROS 1 bag: connections and chunk infos at its end, message times behind every chunk.

The records inside a ROS 1 chunk: messages and the connections they belong to.
"""

from __future__ import annotations

import struct
from collections.abc import Callable, Generator, Iterator
from dataclasses import dataclass

import numpy as np

from gpsim.recordings.readers.bag1_records import (
    BAG_HEADER,
    CHUNK_INFO,
    CONNECTION,
    INDEX,
    MESSAGE,
    Record,
    next_record,
    number,
    read_data,
    read_record,
    stream_of,
    time,
)
from gpsim.recordings.readers.catalogue import Catalogue
from gpsim.recordings.readers.damage import DamageError, Ledger
from gpsim.recordings.readers.source import Budget, Source, Stream

_PAIR = struct.Struct("<II")
_TIMES = np.dtype([("seconds", "<u4"), ("nanoseconds", "<u4"), ("offset", "<u4")])


def read_index(source: Source, start: int) -> Catalogue:
    """Streams with counts and time ranges; `start` is the bag header's offset. DamageError where it is not sound."""
    head = read_record(source, start)
    if head.op != BAG_HEADER:
        raise DamageError("the bag header is missing")
    position = number(head.fields, b"index_pos", 8)
    chunks = number(head.fields, b"chunk_count")
    if position == 0:
        raise DamageError("the bag was never closed, so it has no index (rosbag reindex would make one)")
    if position > source.size:
        raise DamageError(f"the index should be at byte {position}, the file ends at {source.size}")
    if head.fields.get(b"encryptor"):
        raise DamageError("the bag is encrypted")
    found = Catalogue()
    for _ in range(number(head.fields, b"conn_count")):
        record = _expect(source, position, CONNECTION)
        stream = stream_of(source, record)
        found.streams[stream.id] = stream
        position = record.end
    for _ in range(chunks):
        record = _expect(source, position, CHUNK_INFO)
        _read_chunk_info(source, record, found)
        position = record.end
    unknown = sorted(set(found.tallies) - set(found.streams))
    if unknown:
        raise DamageError(f"the index counts messages of connection {unknown[0]}, which it does not list")
    return found


def _expect(source: Source, position: int, op: int) -> Record:
    record = read_record(source, position)
    if record.op != op:
        raise DamageError(
            f"the index holds a record of kind {record.op} where {op} belongs, at byte {position}"
        )
    return record


def _read_chunk_info(source: Source, record: Record, found: Catalogue) -> None:
    count = number(record.fields, b"count")
    data = read_data(source, record)
    if len(data) != 8 * count:
        raise DamageError(f"a chunk info at byte {record.start} declares {count} connections")
    counts: dict[int, int] = {}
    for connection, messages in _PAIR.iter_unpack(data):
        counts[connection] = counts.get(connection, 0) + messages
    ranges = _message_times(source, number(record.fields, b"chunk_pos", 8), count)
    whole = (time(record.fields, b"start_time"), time(record.fields, b"end_time")) if count else (0, 0)
    found.chunks[number(record.fields, b"chunk_pos", 8)] = frozenset(counts)
    for connection, messages in counts.items():
        if messages:
            found.tally(connection).add(messages, *ranges.get(connection, whole))


def _message_times(source: Source, chunk: int, count: int) -> dict[int, tuple[int, int]]:
    """First and last receive time [ns] of each connection in a chunk; empty where the records are not sound."""
    ranges: dict[int, tuple[int, int]] = {}
    try:
        position = read_record(source, chunk).end
        for _ in range(count):
            record = _expect(source, position, INDEX)
            data = np.frombuffer(
                read_data(source, record)[: 12 * number(record.fields, b"count")], dtype=_TIMES
            )
            stamps = data["seconds"].astype(np.int64) * 10**9 + data["nanoseconds"]
            if len(stamps):
                ranges[number(record.fields, b"conn")] = (int(stamps.min()), int(stamps.max()))
            position = record.end
    except (DamageError, ValueError):
        return {}
    return ranges


Place = tuple[int, int, int, int]
"""(connection, receive time [ns], first byte, byte behind the last) of a message in its chunk."""

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


def messages_in(
    chunk: bytes, ledger: Ledger, where: str, on_connection: Callable[[Stream], None] | None, budget: Budget
) -> Iterator[Place]:
    """Every message of a chunk; what cannot be understood is told to the ledger and skipped."""
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
                yield number(record.fields, b"conn"), time(record.fields), record.data, record.end
                layout = _layout_of(record)
            elif record.op == CONNECTION:
                budget.record()
                if on_connection is not None:
                    on_connection(stream_of(source, record))
            else:
                raise DamageError(f"a record of kind {record.op} lies inside a chunk")
            position = record.end
        except DamageError as error:
            ledger.lost(error.reason, f"{where}, byte {position} of the chunk")
            position = next_record(source, position + 1, MESSAGE)


def _run(chunk: bytes, position: int, layout: _Layout) -> Generator[Place, None, int]:
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
        yield head[conn + 1], head[when + 1] * 1_000_000_000 + head[when + 2], start, after
    return position
