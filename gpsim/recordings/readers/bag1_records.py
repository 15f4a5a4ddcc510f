"""Records of ROS 1 bags: [header length, header fields, data length, data], all lengths little-endian uint32."""

from __future__ import annotations

import struct
from dataclasses import dataclass, replace

from gpsim.recordings.readers.damage import MAX_HEADER, MAX_MESSAGE, DamageError, one_line
from gpsim.recordings.readers.source import Source, Stream, topic_name

MESSAGE, BAG_HEADER, INDEX, CHUNK, CHUNK_INFO, CONNECTION = 2, 3, 4, 5, 6, 7
_U32 = struct.Struct("<I")
_U64 = struct.Struct("<Q")
_TIME = struct.Struct("<II")
_LONGEST_FRONT = 128
_MOST_TRIES = 20_000


@dataclass(frozen=True)
class Record:
    """A record's header and where its data lie; `end` may be outside the file."""

    op: int
    fields: dict[bytes, bytes]
    start: int
    data: int
    size: int

    @property
    def end(self) -> int:
        """Offset of the next record."""
        return self.data + self.size


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
    return Record(op[0], fields, start, start + 8 + length, size)


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
