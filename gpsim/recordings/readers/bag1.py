"""ROS 1 bags, format 2.0 (wiki.ros.org/Bags/Format/2.0): header length, header fields, data length, data.

All lengths are little-endian uint32.
"""

from __future__ import annotations

import re
import struct
from collections.abc import Iterable, Iterator

import numpy as np

from gpsim.recordings.readers.damage import DamageError, Ledger, one_line
from gpsim.recordings.readers.source import Budget, Catalogue, Message, Source, Stream, topic_name
from gpsim.recordings.readers.walk import Head, Record, Walk, data_of, search

_U32, _U64, _TWO = struct.Struct("<I"), struct.Struct("<Q"), struct.Struct("<II")
MESSAGE, BAG_HEADER, INDEX, CHUNK, CHUNK_INFO, CONNECTION = 2, 3, 4, 5, 6, 7
_MAX_HEADER = 1 << 20
_FRONT = 128  # bytes of a header before its kind, at the most
_TIMES = np.dtype([("seconds", "<u4"), ("nanoseconds", "<u4"), ("offset", "<u4")])
_MESSAGE = re.compile(  # a message's header of three fields in any order, as recorders write it
    rb"&\0\0\0(?:\x09\0\0\0conn=(.{4})|\x0d\0\0\0time=(.{8})|(\x04\0\0\0op=\x02)){3}(.{4})", re.DOTALL
)


def _fields(header: bytes) -> dict[bytes, bytes]:
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


def _field(fields: dict[bytes, bytes], name: bytes, width: int | None = None) -> bytes:
    value = fields.get(name)
    if value is None or (width is not None and len(value) != width):
        raise DamageError(f"a record lacks its field {name.decode()}")
    return value


def _number(fields: dict[bytes, bytes], name: bytes) -> int:
    return int(_U32.unpack(_field(fields, name, 4))[0])


def _place(fields: dict[bytes, bytes], name: bytes) -> int:
    return int(_U64.unpack(_field(fields, name, 8))[0])


def _time(fields: dict[bytes, bytes], name: bytes = b"time") -> int:
    """A time field [ns]."""
    seconds, nanoseconds = _TWO.unpack(_field(fields, name, 8))
    return int(seconds * 10**9 + nanoseconds)


def _text(fields: dict[bytes, bytes], name: bytes) -> str:
    try:
        return _field(fields, name).decode()
    except UnicodeDecodeError as error:
        raise DamageError(f"field {name.decode()} is not text: {one_line(error, 60)}") from error


class Bag1(Walk):
    """One ROS 1 bag. The index is connections and chunk infos at its end; message times lie behind every chunk."""

    magic = b"#ROSBAG V2.0\n"
    kind = ("a ROS 1 bag", "it does not begin with #ROSBAG V2.0")
    index_name = "index"
    chunk_op = CHUNK

    def record(self, source: Source, position: int) -> Record:
        """The record at a place."""
        (length,) = _U32.unpack(source.read(position, 4))
        if length > _MAX_HEADER:
            raise DamageError(f"a record header declares {length} bytes")
        fields = _fields(source.read(position + 4, length))
        op = fields.get(b"op", b"")
        if len(op) != 1:
            raise DamageError("a record has no kind")
        (size,) = _U32.unpack(source.read(position + 4 + length, 4))
        return Record(op[0], position, position + 8 + length, size, fields)

    def next_record(
        self, source: Source, start: int, found: Catalogue, *, inside: bool = False
    ) -> int | None:
        """Where the next chunk or message begins, recognised by its header."""
        op = MESSAGE if inside else CHUNK

        def believed(begin: int) -> bool:
            try:
                return self.record(source, begin).op == op
            except DamageError:
                return False

        def begins(mark: int) -> int | None:
            earliest = max(start, mark - _FRONT)
            front = source.read(earliest, mark - earliest)
            for begin in range(len(front) - 4, -1, -1):
                (length,) = _U32.unpack_from(front, begin)
                fits = len(front) - begin + 4 <= length <= 2 * _FRONT
                if fits and believed(earliest + begin):
                    return earliest + begin
            return None

        mark = re.compile(re.escape(struct.pack("<I3sB", 4, b"op=", op)))
        return search(source, start, mark, 20_000, begins)

    def head(self, source: Source, record: Record) -> Head:
        """A chunk's head."""
        size = _number(record.fields, b"size")
        return Head(record.data, record.size, _text(record.fields, b"compression"), size)

    def outside(self, source: Source, record: Record, found: Catalogue, budget: Budget) -> Iterable[Message]:
        """Connections are noted; messages are in chunks alone."""
        if record.op == CONNECTION and found.listing:
            found.add(self._stream(source, record))
        return ()

    def in_chunk(self, chunk: bytes, found: Catalogue, ledger: Ledger, budget: Budget) -> Iterator[Message]:
        """The messages of a chunk: what looks as every recorder writes it in one go, anything else field by field."""
        source, end = Source(chunk, len(chunk)), len(chunk)
        position: int | None = 0
        while position is not None and position < end and not ledger.exhausted:
            if (usual := _MESSAGE.match(chunk, position)) and all(parts := usual.groups()):
                start = usual.end()
                after = start + _U32.unpack(parts[3])[0]
                if after <= end:
                    seconds, nanoseconds = _TWO.unpack(parts[1])
                    yield _U32.unpack(parts[0])[0], seconds * 1_000_000_000 + nanoseconds, chunk[start:after]
                    position = after
                    continue
            try:
                record = self.record(source, position)
                if record.end > end:
                    raise DamageError(f"a record reaches {record.end - end} bytes beyond its chunk")
                if record.op == MESSAGE:
                    stamp = _time(record.fields)
                    yield _number(record.fields, b"conn"), stamp, chunk[record.data : record.end]
                elif record.op == CONNECTION:
                    budget.record()
                    if found.listing:
                        found.add(self._stream(source, record))
                else:
                    raise DamageError(f"a record of kind {record.op} lies inside a chunk")
                position = record.end
            except DamageError as error:
                ledger.lost(error.reason, f"{self.where}, byte {position} of the chunk")
                position = self.next_record(source, position + 1, found, inside=True)

    def _stream(self, source: Source, record: Record) -> Stream:
        """What a connection record describes, its type in ROS 2 spelling; what is wrong with it is its own fault."""
        identity = _number(record.fields, b"conn")
        topic, fault = topic_name(record.fields.get(b"topic", b""))
        try:
            details = _fields(data_of(source, record))
            package, slash, name = _text(details, b"type").partition("/")
            if not slash:
                raise DamageError(f"{one_line(package, 60)!r} is not a message type")
            kind = f"{package}/{name}" if name.startswith(("msg/", "action/")) else f"{package}/msg/{name}"
            definition, digest = _text(details, b"message_definition"), _text(details, b"md5sum")
        except DamageError as error:
            return Stream(identity, topic, "unknown", "", "none", "ros1", fault=fault or error.reason)
        return Stream(identity, topic, kind, definition, "msg", "ros1", digest, fault=fault)

    def index(self, source: Source) -> Catalogue:
        """Streams with counts and time ranges."""
        head = self.record(source, len(self.magic))
        if head.op != BAG_HEADER:
            raise DamageError("the bag header is missing")
        position = _place(head.fields, b"index_pos")
        chunks = _number(head.fields, b"chunk_count")
        if position == 0:
            raise DamageError("the bag was never closed, so it has no index (rosbag reindex would make one)")
        if position > source.size:
            raise DamageError(f"the index should be at byte {position}, the file ends at {source.size}")
        if head.fields.get(b"encryptor"):
            raise DamageError("the bag is encrypted")
        found = Catalogue()
        for _ in range(_number(head.fields, b"conn_count")):
            record = self._expect(source, position, CONNECTION)
            stream = self._stream(source, record)
            found.streams[stream.id] = stream
            position = record.end
        for _ in range(chunks):
            record = self._expect(source, position, CHUNK_INFO)
            self._chunk_info(source, record, found)
            position = record.end
        unknown = sorted(set(found.tallies) - set(found.streams))
        if unknown:
            raise DamageError(f"the index counts messages of connection {unknown[0]}, which it does not list")
        return found

    def _expect(self, source: Source, position: int, op: int) -> Record:
        record = self.record(source, position)
        if record.op != op:
            there = f"a record of kind {record.op} where {op} belongs"
            raise DamageError(f"the index holds {there}, at byte {position}")
        return record

    def _chunk_info(self, source: Source, record: Record, found: Catalogue) -> None:
        count, data = _number(record.fields, b"count"), data_of(source, record)
        if len(data) != 8 * count:
            raise DamageError(f"a chunk info at byte {record.start} declares {count} connections")
        counts: dict[int, int] = {}
        for connection, messages in _TWO.iter_unpack(data):
            counts[connection] = counts.get(connection, 0) + messages
        place = _place(record.fields, b"chunk_pos")
        ranges = self._times(source, place, count)
        whole = (_time(record.fields, b"start_time"), _time(record.fields, b"end_time")) if count else (0, 0)
        found.chunks[place] = frozenset(counts)
        for connection, messages in counts.items():
            if messages:
                found.tally(connection, messages, *ranges.get(connection, whole))

    def _times(self, source: Source, chunk: int, count: int) -> dict[int, tuple[int, int]]:
        """First and last receive time [ns] of each connection in a chunk; empty where the records are not sound."""
        ranges: dict[int, tuple[int, int]] = {}
        try:
            position = self.record(source, chunk).end
            for _ in range(count):
                record = self._expect(source, position, INDEX)
                most = 12 * _number(record.fields, b"count")
                data = np.frombuffer(data_of(source, record)[:most], dtype=_TIMES)
                stamps = data["seconds"].astype(np.int64) * 10**9 + data["nanoseconds"]
                if len(stamps):
                    ranges[_number(record.fields, b"conn")] = (int(stamps.min()), int(stamps.max()))
                position = record.end
        except (DamageError, ValueError):
            return {}
        return ranges
