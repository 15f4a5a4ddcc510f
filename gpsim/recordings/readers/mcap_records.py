"""Records of MCAP files (mcap.dev/spec): op code, length as little-endian uint64, content."""

from __future__ import annotations

import re
import struct
import zlib
from collections.abc import Collection
from dataclasses import dataclass

import numpy as np

from gpsim.recordings.readers.chunked import Catalogue, Record
from gpsim.recordings.readers.damage import MAX_CHUNK, MAX_DEFINITION, MAX_MESSAGE, DamageError, one_line
from gpsim.recordings.readers.source import LATEST, DefinitionFormat, Source, Stream, topic_name

FOOTER, SCHEMA, CHANNEL, MESSAGE, CHUNK, MESSAGE_INDEX, CHUNK_INDEX, STATISTICS = 2, 3, 4, 5, 6, 7, 8, 0x0B
LAST_OP = 0x0F
_MOST_TRIES = 200_000
COMPRESSIONS = {"": "none", "lz4": "lz4", "zstd": "zstd"}
CHUNK_HEAD = struct.Struct("<QQQI")
MESSAGE_HEAD = struct.Struct("<HIQQ")
_RECORD = struct.Struct("<BQ")
_U16, _U32, _U64 = struct.Struct("<H"), struct.Struct("<I"), struct.Struct("<Q")
_FORMATS: dict[str, DefinitionFormat] = {
    "ros2msg": "msg",
    "ros1msg": "msg",
    "ros2idl": "idl",
    "omgidl": "idl",
}
_START = re.compile(rb"[\x05\x06](?=.{4}\x00\x00\x00\x00)", re.DOTALL)


def read_record(source: Source, position: int) -> Record:
    """The record at `position`."""
    op, size = _RECORD.unpack(source.read(position, _RECORD.size))
    if op == 0:
        raise DamageError("a record of kind 0")
    return Record(op, position + _RECORD.size, size)


def content(source: Source, record: Record) -> Content:
    """A record's content (not a chunk's: those have a limit of their own)."""
    if record.size > MAX_MESSAGE:
        raise DamageError(f"a record declares {record.size} bytes")
    return Content(source.read(record.data, record.size))


class Content:
    """Reads the parts of a record one after the other."""

    def __init__(self, data: bytes) -> None:
        self.data = data
        self.position = 0

    def take(self, count: int) -> bytes:
        """The next `count` bytes."""
        if self.position + count > len(self.data):
            raise DamageError(f"a record of {len(self.data)} bytes declares a part of {count} bytes")
        self.position += count
        return self.data[self.position - count : self.position]

    def u16(self) -> int:
        """The next uint16."""
        return int(_U16.unpack(self.take(2))[0])

    def u32(self) -> int:
        """The next uint32."""
        return int(_U32.unpack(self.take(4))[0])

    def u64(self) -> int:
        """The next uint64."""
        return int(_U64.unpack(self.take(8))[0])

    def blob(self) -> bytes:
        """The next bytes with their length in front."""
        return self.take(self.u32())

    def text(self) -> str:
        """The next text with its length in front."""
        raw = self.blob()
        try:
            return raw.decode()
        except UnicodeDecodeError as error:
            raise DamageError(f"a record's text is not text: {one_line(raw[:40])}") from error


@dataclass(frozen=True)
class Schema:
    """A message definition."""

    name: str
    encoding: str
    definition: str
    fault: str = ""


def schema_of(parts: Content) -> tuple[int, Schema]:
    """(id, schema); one that cannot be used is at fault by itself."""
    identity = parts.u16()
    try:
        return _schema_of(identity, parts)
    except DamageError as error:
        return identity, Schema("unknown", "", "", error.reason)


def _schema_of(identity: int, parts: Content) -> tuple[int, Schema]:
    name, encoding = parts.text(), parts.text()
    if encoding not in _FORMATS:
        return identity, Schema(name, encoding, "")
    if len(parts.data) - parts.position > MAX_DEFINITION:
        raise DamageError(f"definition of {one_line(name, 60)} is longer than {MAX_DEFINITION} bytes")
    return identity, Schema(name, encoding, parts.text())


def stream_of(parts: Content, schemas: dict[int, Schema]) -> Stream:
    """The stream a channel record describes; what is wrong with its name or type is its own fault."""
    identity, schema_id = parts.u16(), parts.u16()
    topic, fault = topic_name(parts.blob())
    encoding = parts.text()
    schema = schemas.get(schema_id, Schema("unknown", "", ""))
    name = schema.name
    if schema.encoding == "ros1msg" and "/msg/" not in name:
        name = name.replace("/", "/msg/", 1)
    form = _FORMATS.get(schema.encoding, "none") if schema.definition else "none"
    fault = fault or schema.fault
    return Stream(identity, topic, name, schema.definition, form, encoding, fault=fault)


def next_record(source: Source, start: int, channels: Collection[int], *, chunks: bool) -> int | None:
    """Offset of the next believable message (of a known channel) or chunk at or after `start`; None without one."""
    tries = 0
    for offset, window in source.windows(start, _RECORD.size):
        for match in _START.finditer(window):
            tries += 1
            if tries > _MOST_TRIES:
                return None
            if _believable(source, offset + match.start(), channels, chunks=chunks):
                return offset + match.start()
    return None


def _believable(source: Source, position: int, channels: Collection[int], *, chunks: bool) -> bool:
    try:
        record = read_record(source, position)
        if record.op == CHUNK:
            return chunks and _is_chunk(source, record)
        if record.size < MESSAGE_HEAD.size or record.end > source.size:
            return False
        channel, _, stamp, _ = MESSAGE_HEAD.unpack(source.read(record.data, MESSAGE_HEAD.size))
        after = source.read(record.end, 1)[0] if record.end < source.size else MESSAGE
        return stamp < LATEST and 0 < after <= LAST_OP and (channel in channels or not channels)
    except DamageError:
        return False


def _is_chunk(source: Source, record: Record) -> bool:
    parts = Content(
        source.read(record.data, min(record.size, CHUNK_HEAD.size + 16, source.size - record.data))
    )
    start, end, _, _ = CHUNK_HEAD.unpack(parts.take(CHUNK_HEAD.size))
    method, size = parts.text(), parts.u64()
    return start <= end < LATEST and method in COMPRESSIONS and parts.position + size == record.size


MAGIC = b"\x89MCAP0\r\n"
_FOOTER_SIZE = 9 + 20 + len(MAGIC)
_TIMES = np.dtype([("time", "<u8"), ("offset", "<u8")])


def read_summary(source: Source) -> Catalogue | None:
    """Streams with counts and times; None where a sound file has no summary. DamageError where it is not sound."""
    tail = source.read(max(0, source.size - _FOOTER_SIZE), min(_FOOTER_SIZE, source.size))
    if len(tail) < _FOOTER_SIZE or not tail.endswith(MAGIC):
        raise DamageError("the file was cut off or never closed: it does not end with the MCAP mark")
    if tail[0] != FOOTER or tail[1:9] != (20).to_bytes(8, "little"):
        raise DamageError("the footer is damaged")
    parts = Content(tail[9:29])
    start, _, checksum = parts.u64(), parts.u64(), parts.u32()
    if start == 0:
        return None
    footer = source.size - _FOOTER_SIZE
    if not len(MAGIC) <= start <= footer or footer - start > MAX_CHUNK:
        raise DamageError(f"the footer places the summary at byte {start}")
    if checksum and zlib.crc32(source.read(start, footer + 25 - start)) != checksum:
        raise DamageError("the summary's checksum does not match")
    found, counts, chunks, position = Catalogue(), dict[int, int](), 0, start
    while position < footer:
        record = read_record(source, position)
        parts = content(source, record)
        take(record.op, parts, found)
        if record.op == CHUNK_INDEX:
            chunks += 1
            _take_chunk_index(source, parts, found)
        elif record.op == STATISTICS:
            counts = _counts(parts)
        position = record.end
    if not chunks or (not found.streams and any(counts.values())):
        return None  # messages outside chunks have no index, so nothing tells when they came
    unknown = sorted(set(counts) - set(found.streams))
    if unknown:
        raise DamageError(f"the summary counts messages of channel {unknown[0]}, which it does not list")
    for channel, count in counts.items():
        found.tally(channel).count = count
    return found


def take(op: int, parts: Content, found: Catalogue) -> None:
    """Note a schema or a channel; other records are none of its affair."""
    if op == SCHEMA:
        identity, schema = schema_of(parts)
        found.schemas[identity] = schema
    elif op == CHANNEL:
        found.add(stream_of(parts, found.schemas))


def _counts(parts: Content) -> dict[int, int]:
    """Messages by channel, of a record of statistics."""
    parts.take(42)
    pairs, counts = Content(parts.blob()), dict[int, int]()
    while pairs.position < len(pairs.data):
        channel = pairs.u16()
        counts[channel] = pairs.u64()
    return counts


def _take_chunk_index(source: Source, parts: Content, found: Catalogue) -> None:
    start, end, place, _ = parts.u64(), parts.u64(), parts.u64(), parts.u64()
    offsets = Content(parts.blob())
    held: set[int] = set()
    while offsets.position < len(offsets.data):
        channel, position = offsets.u16(), offsets.u64()
        held.add(channel)
        count, first, last = _message_times(source, position, start, end)
        if count:
            found.tally(channel).add(count, first, last)
    if held:  # a writer may leave the offsets away: then nobody knows what the chunk holds
        found.chunks[place] = frozenset(held)


def _message_times(source: Source, position: int, start: int, end: int) -> tuple[int, int, int]:
    """Number, first and last time of a channel's messages in a chunk, which itself lasts from start to end."""
    record = read_record(source, position)
    if record.op != MESSAGE_INDEX:
        raise DamageError(
            f"the summary places a message index at byte {position}, a record of kind {record.op} is there"
        )
    parts = content(source, record)
    parts.u16()
    raw = parts.blob()
    times = np.frombuffer(raw[: len(raw) // 16 * 16], dtype=_TIMES)["time"]
    if not len(times):
        return 0, start, end
    return len(times), int(times.min()), int(times.max())
