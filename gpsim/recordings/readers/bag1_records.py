"""ROS 1 bags: records, all lengths little-endian uint32, and the index at the end.

A record is [header length, header fields, data length, data]. The index is connections and chunk infos; message times
lie behind every chunk.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass, replace

import numpy as np

from gpsim.recordings.readers.chunked import Catalogue
from gpsim.recordings.readers.chunked import Record as AnyRecord
from gpsim.recordings.readers.damage import MAX_HEADER, MAX_MESSAGE, DamageError, one_line
from gpsim.recordings.readers.source import Source, Stream, topic_name

MESSAGE, BAG_HEADER, INDEX, CHUNK, CHUNK_INFO, CONNECTION = 2, 3, 4, 5, 6, 7
_U32 = struct.Struct("<I")
_U64 = struct.Struct("<Q")
_TIME = struct.Struct("<II")
_LONGEST_FRONT = 128
_MOST_TRIES = 20_000


@dataclass(frozen=True)
class Record(AnyRecord):
    """A record with the fields of its header, and where it begins."""

    fields: dict[bytes, bytes]
    start: int


def parse_fields(header: bytes) -> dict[bytes, bytes]:
    """Header fields [length, name=value] of a record."""
    fields: dict[bytes, bytes] = {}
    position = 0
    while position < len(header):
        if position + 4 > len(header):
            raise DamageError("a record header ends inside a field")
        (length,) = _U32.unpack_from(header, position)
        position += 4
        name, equals, value = header[position : position + length].partition(b"=")
        if position + length > len(header) or not equals:
            raise DamageError("a record header holds a broken field")
        fields[name] = value
        position += length
    return fields


def read_record(source: Source, start: int) -> Record:
    """The record at `start`; its data may reach beyond the file."""
    (length,) = _U32.unpack(source.read(start, 4))
    if length > MAX_HEADER:
        raise DamageError(f"a record header declares {length} bytes")
    fields = parse_fields(source.read(start + 4, length))
    op = fields.get(b"op", b"")
    if len(op) != 1:
        raise DamageError("a record does not say its kind")
    (size,) = _U32.unpack(source.read(start + 4 + length, 4))
    return Record(op[0], start + 8 + length, size, fields, start)


def next_record(source: Source, start: int, op: int) -> int | None:
    """Offset of the next record of kind `op` at or after `start`, recognised by its header; None without one."""
    mark = struct.pack("<I3sB", 4, b"op=", op)
    position, tries = start, 0
    while (found := source.find(mark, position)) >= 0 and tries < _MOST_TRIES:
        tries += 1
        earliest = max(start, found - _LONGEST_FRONT)
        front = source.read(earliest, found - earliest)
        for begin in range(len(front) - 4, -1, -1):
            (length,) = _U32.unpack_from(front, begin)
            if len(front) - begin + 4 <= length <= 2 * _LONGEST_FRONT and _is_record(
                source, earliest + begin, op
            ):
                return earliest + begin
        position = found + 1
    return None


def _is_record(source: Source, start: int, op: int) -> bool:
    try:
        return read_record(source, start).op == op
    except DamageError:
        return False


def number(fields: dict[bytes, bytes], name: bytes, width: int = 4) -> int:
    """An unsigned integer field of `width` bytes."""
    value = fields.get(name, b"")
    if len(value) != width:
        raise DamageError(f"a record lacks its field {name.decode()}")
    unpacked: tuple[int] = (_U32 if width == 4 else _U64).unpack(value)
    return unpacked[0]


def time(fields: dict[bytes, bytes], name: bytes = b"time") -> int:
    """A time field [ns]."""
    value = fields.get(name, b"")
    if len(value) != 8:
        raise DamageError(f"a record lacks its field {name.decode()}")
    seconds, nanoseconds = _TIME.unpack(value)
    return int(seconds * 10**9 + nanoseconds)


def text(fields: dict[bytes, bytes], name: bytes) -> str:
    """A text field."""
    if name not in fields:
        raise DamageError(f"a record lacks its field {name.decode()}")
    try:
        return fields[name].decode()
    except UnicodeDecodeError as error:
        raise DamageError(f"field {name.decode()} is not text: {one_line(error, 60)}") from error


def read_data(source: Source, record: Record) -> bytes:
    """A record's data (not a chunk's: those have a limit of their own)."""
    if record.size > MAX_MESSAGE:
        raise DamageError(f"a record declares {record.size} bytes")
    return source.read(record.data, record.size)


def stream_of(source: Source, record: Record) -> Stream:
    """The stream a connection record describes; its type in ROS 2 spelling. What is wrong with it is its own fault."""
    identity = number(record.fields, b"conn")
    topic, fault = topic_name(record.fields.get(b"topic", b""))
    try:
        stream = _described(source, record, identity, topic)
    except DamageError as error:
        return Stream(identity, topic, "unknown", "", "none", "ros1", fault=fault or error.reason)
    return replace(stream, fault=fault)


def _described(source: Source, record: Record, identity: int, topic: str) -> Stream:
    details = parse_fields(read_data(source, record))
    package, slash, name = text(details, b"type").partition("/")
    if not slash:
        raise DamageError(f"{one_line(package, 60)!r} is not a message type")
    kind = f"{package}/{name}" if name.startswith(("msg/", "action/")) else f"{package}/msg/{name}"
    return Stream(
        id=identity,
        topic=topic,
        type=kind,
        definition=text(details, b"message_definition"),
        format="msg",
        encoding="ros1",
        digest=text(details, b"md5sum"),
    )


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
