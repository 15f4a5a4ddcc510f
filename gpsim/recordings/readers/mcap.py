"""MCAP files (mcap.dev/spec): a record is op code, length as little-endian uint64, content."""

from __future__ import annotations

import re
import struct
import zlib
from collections.abc import Iterable, Iterator
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from gpsim.recordings.readers.damage import MAX_CHUNK, MAX_DEFINITION, DamageError, Ledger, one_line
from gpsim.recordings.readers.source import (
    LATEST,
    Budget,
    Catalogue,
    DefinitionFormat,
    Message,
    Source,
    Stream,
    topic_name,
)  # fmt: skip
from gpsim.recordings.readers.walk import Head, Record, Walk, data_of, search

FOOTER, SCHEMA, CHANNEL, MESSAGE, CHUNK, MESSAGE_INDEX, CHUNK_INDEX, STATISTICS, LAST = (
    2, 3, 4, 5, 6, 7, 8, 0x0B, 0x0F,
)  # fmt: skip
_COMPRESSIONS = {"": "none", "lz4": "lz4", "zstd": "zstd"}
_RECORD, _CHUNK_HEAD, _MESSAGE_HEAD = struct.Struct("<BQ"), struct.Struct("<QQQI"), struct.Struct("<HIQQ")
_USUAL = struct.Struct("<BQHIQQ")  # a record and a message's head, in one go
_FORMATS: dict[str, DefinitionFormat] = {
    "ros2msg": "msg", "ros1msg": "msg", "ros2idl": "idl", "omgidl": "idl",
}  # fmt: skip
_START = re.compile(rb"[\x05\x06](?=.{4}\x00\x00\x00\x00)", re.DOTALL)
_TIMES = np.dtype([("time", "<u8"), ("offset", "<u8")])


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

    def number(self, kind: str) -> int:
        """The next number, of one of struct's kinds."""
        return int(struct.unpack(f"<{kind}", self.take(struct.calcsize(f"<{kind}")))[0])

    def blob(self) -> bytes:
        """The next bytes with their length in front."""
        return self.take(self.number("I"))

    def text(self) -> str:
        """The next text with its length in front."""
        raw = self.blob()
        try:
            return raw.decode()
        except UnicodeDecodeError as error:
            raise DamageError(f"a record's text is not text: {one_line(raw[:40])}") from error


class Schema(NamedTuple):
    """A message definition."""

    name: str = "unknown"
    encoding: str = ""
    definition: str = ""
    fault: str = ""


class Mcap(Walk):
    """One .mcap file; chunk checksums are verified where they exist."""

    magic = b"\x89MCAP0\r\n"
    kind = ("an MCAP file", "it does not begin with the MCAP mark")
    index_name = "summary"
    chunk_op = CHUNK
    last_op = FOOTER
    unsearched = ("none",)

    def record(self, source: Source, position: int) -> Record:
        """The record at a place."""
        op, size = _RECORD.unpack(source.read(position, _RECORD.size))
        if op == 0:
            raise DamageError("a record of kind 0")
        return Record(op, position, position + _RECORD.size, size, {})

    def next_record(
        self, source: Source, start: int, found: Catalogue, *, inside: bool = False
    ) -> int | None:
        """Where the next message (of a known channel) or chunk begins."""

        def begins(position: int) -> int | None:
            try:
                record = self.record(source, position)
                if record.op == CHUNK:
                    return position if not inside and self._is_chunk(source, record) else None
                if record.size < _MESSAGE_HEAD.size or record.end > source.size:
                    return None
                channel, _, stamp, _ = _MESSAGE_HEAD.unpack(source.read(record.data, _MESSAGE_HEAD.size))
                after = source.read(record.end, 1)[0] if record.end < source.size else MESSAGE
            except DamageError:
                return None
            known = channel in found.streams or not found.streams
            return position if stamp < LATEST and 0 < after <= LAST and known else None

        return search(source, start, _START, 200_000, begins)

    def _is_chunk(self, source: Source, record: Record) -> bool:
        count = min(record.size, _CHUNK_HEAD.size + 16, source.size - record.data)
        parts = Content(source.read(record.data, count))
        start, end, _, _ = _CHUNK_HEAD.unpack(parts.take(_CHUNK_HEAD.size))
        method, size = parts.text(), parts.number("Q")
        return start <= end < LATEST and method in _COMPRESSIONS and parts.position + size == record.size

    def head(self, source: Source, record: Record) -> Head:
        """A chunk's head."""
        count = min(_CHUNK_HEAD.size + 64, record.size, self.size - record.data)
        front = Content(source.read(record.data, count))
        _, _, size, checksum = _CHUNK_HEAD.unpack(front.take(_CHUNK_HEAD.size))
        method, stored = front.text(), front.number("Q")
        begin = record.data + front.position
        if method not in _COMPRESSIONS or begin + stored != record.end:
            raise DamageError(f"a chunk's head is damaged (compression {method[:8]!r}, {stored} bytes)")
        return Head(begin, stored, _COMPRESSIONS[method], size, checksum)

    def outside(self, source: Source, record: Record, found: Catalogue, budget: Budget) -> Iterable[Message]:
        """A message; schemas and channels are noted."""
        if record.op == MESSAGE:
            return (self._message(Content(data_of(source, record))),)
        if record.op in (SCHEMA, CHANNEL):
            self._take(record.op, Content(data_of(source, record)), found)
        elif not record.size:
            budget.empty()
        return ()

    def in_chunk(self, chunk: bytes, found: Catalogue, ledger: Ledger, budget: Budget) -> Iterator[Message]:
        """The messages of a chunk; schemas and channels are noted, the rest skipped."""
        source, end = Source(chunk, len(chunk)), len(chunk)
        unpack, front, least = _USUAL.unpack_from, _USUAL.size, _MESSAGE_HEAD.size
        position: int | None = 0
        while position is not None and position < end and not ledger.exhausted:
            if position + front <= end:
                op, size, channel, _, stamp, _ = unpack(chunk, position)
                after = position + 9 + size
                if op == MESSAGE and size >= least and after <= end and stamp < LATEST:
                    yield channel, stamp, chunk[position + front : after]
                    position = after
                    continue
            budget.record()
            try:
                record = self.record(source, position)
                if record.end > end:
                    raise DamageError(f"a record reaches {record.end - end} bytes beyond its chunk")
                if record.op == MESSAGE:
                    self._message(Content(data_of(source, record)))
                self._take(record.op, Content(data_of(source, record)), found)
                position = record.end
            except DamageError as error:
                ledger.lost(error.reason, f"{self.where}, byte {position} of the chunk")
                position = self.next_record(source, position + 1, found, inside=True)

    def _message(self, parts: Content) -> Message:
        channel, _, stamp, _ = _MESSAGE_HEAD.unpack(parts.take(_MESSAGE_HEAD.size))
        if stamp >= LATEST:
            raise DamageError(f"a message's time is {stamp} ns")
        return channel, stamp, parts.data[parts.position :]

    def _take(self, op: int, parts: Content, found: Catalogue) -> None:
        """Note a schema or a channel; what is wrong with one is its own fault. Other records are no affair of this."""
        if op == SCHEMA:
            identity = parts.number("H")
            try:
                found.schemas[identity] = self._schema(parts)
            except DamageError as error:
                found.schemas[identity] = Schema(fault=error.reason)
        elif op == CHANNEL:
            identity, schema_id = parts.number("H"), parts.number("H")
            topic, fault = topic_name(parts.blob())
            encoding = parts.text()
            schema: Schema = found.schemas.get(schema_id, Schema())
            ros1 = schema.encoding == "ros1msg" and "/msg/" not in schema.name
            name = schema.name.replace("/", "/msg/", 1) if ros1 else schema.name
            form = _FORMATS.get(schema.encoding, "none") if schema.definition else "none"
            stream = Stream(identity, topic, name, schema.definition, form, encoding)
            found.add(replace(stream, fault=fault or schema.fault))

    def _schema(self, parts: Content) -> Schema:
        name, encoding = parts.text(), parts.text()
        if encoding not in _FORMATS:
            return Schema(name, encoding)
        if len(parts.data) - parts.position > MAX_DEFINITION:
            raise DamageError(f"definition of {one_line(name, 60)} is longer than {MAX_DEFINITION} bytes")
        return Schema(name, encoding, parts.text())

    def index(self, source: Source) -> Catalogue | None:
        """Streams with counts and times; None where a sound file has no summary."""
        size = 9 + 20 + len(self.magic)  # of a footer
        tail = source.read(max(0, source.size - size), min(size, source.size))
        if len(tail) < size or not tail.endswith(self.magic):
            raise DamageError("the file was cut off or never closed: it does not end with the MCAP mark")
        if tail[0] != FOOTER or tail[1:9] != (20).to_bytes(8, "little"):
            raise DamageError("the footer is damaged")
        start, _, checksum = struct.unpack("<QQI", tail[9:29])
        if start == 0:
            return None
        footer = source.size - size
        if not len(self.magic) <= start <= footer or footer - start > MAX_CHUNK:
            raise DamageError(f"the footer places the summary at byte {start}")
        if checksum and zlib.crc32(source.read(start, footer + 25 - start)) != checksum:
            raise DamageError("the summary's checksum does not match")
        found, chunks, position = Catalogue(), 0, start
        while position < footer:
            record = self.record(source, position)
            parts = Content(data_of(source, record))
            self._take(record.op, parts, found)
            if record.op == CHUNK_INDEX:
                chunks += 1
                self._chunk_index(source, parts, found)
            elif record.op == STATISTICS:
                parts.take(42)
                pairs = Content(parts.blob())
                found.counts = {}
                while pairs.position < len(pairs.data):
                    channel = pairs.number("H")
                    found.counts[channel] = pairs.number("Q")
            position = record.end
        if not chunks or (not found.streams and any(found.counts.values())):
            return None  # messages outside chunks have no index, so nothing tells when they came
        unknown = sorted(set(found.counts) - set(found.streams))
        if unknown:
            raise DamageError(f"the summary counts messages of channel {unknown[0]}, which it does not list")
        return found

    def _chunk_index(self, source: Source, parts: Content, found: Catalogue) -> None:
        _, _, place, _ = (parts.number("Q") for _ in range(4))
        offsets, held = Content(parts.blob()), set[int]()
        while offsets.position < len(offsets.data):
            channel, position = offsets.number("H"), offsets.number("Q")
            held.add(channel)
            record = self.record(source, position)
            if record.op != MESSAGE_INDEX:
                there = f"at byte {position}, a record of kind {record.op} is there"
                raise DamageError(f"the summary places a message index {there}")
            index = Content(data_of(source, record))
            index.take(2)
            raw = index.blob()
            times: Any = np.frombuffer(raw[: len(raw) // 16 * 16], dtype=_TIMES)["time"]
            if len(times):
                found.tally(channel, len(times), int(times.min()), int(times.max()))
        if held:  # a writer may leave the offsets away: then nobody knows what the chunk holds
            found.chunks[place] = frozenset(held)
