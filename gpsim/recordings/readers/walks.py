"""ROS 1 bags and MCAP files, walked record by record with one chunk in memory: sound ones, damaged and cut off.

The libraries' readers do not serve. Of a million small messages rosbags' reader of ROS 1 holds 168 MB and mcap's own
422 MB, this 47 MB with the columns; rosbags' others sort by time, so that nobody sees what came late. All trust every
declared length, and open no file that was cut off.
"""

from __future__ import annotations

import re
import struct
import zlib
from abc import abstractmethod
from bisect import bisect_right
from collections.abc import Collection, Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from gpsim.recordings.readers.container import (
    LATEST,
    MAX_CHUNK,
    MAX_DEFINITION,
    MAX_MESSAGE,
    Budget,
    Catalogue,
    Container,
    DamageError,
    DefinitionFormat,
    Ledger,
    Message,
    Source,
    Stream,
    expand,
    topic_name,
    wrong_kind,
)
from gpsim.recordings.values import one_line


class Record(NamedTuple):
    """Its kind, where it begins and where its data lie, which may be outside the file; fields: of a header (ROS 1)."""

    op: int
    start: int
    data: int
    size: int
    fields: Fields

    @property
    def end(self) -> int:
        """Where the next one begins."""
        return self.data + self.size


def data_of(source: Source, record: Record) -> bytes:
    """A record's data (not a chunk's: those have a limit of their own)."""
    if record.size > MAX_MESSAGE:
        raise DamageError(f"a record declares {record.size} bytes")
    return source.read(record.data, record.size)


class Walk(Container):
    """One file. Behind damage it goes on with the next chunk that the index names, even an unsound one, or ends."""

    magic: bytes
    kind: tuple[str, str]  # what it is, and why a file is none that begins otherwise
    index_name: str
    chunk_op: int
    last_op = 0  # of the record behind which no messages come

    def __init__(self, path: Path) -> None:
        super().__init__(path)
        self._chunks: dict[int, frozenset[int]] = {}

    @abstractmethod
    def _index(self, source: Source) -> Catalogue | None:
        """What the file's own index says; None without one, DamageError where it is not sound."""

    @abstractmethod
    def _record(self, source: Source, position: int) -> Record:
        """The record at a place."""

    @abstractmethod
    def _head(self, source: Source, record: Record) -> tuple[int, str, int, int]:
        """(where a chunk's data begin, how compressed they are, how many bytes they make, their checksum or 0)."""

    @abstractmethod
    def _usual(self, chunk: bytes, position: int) -> tuple[Message, int] | None:
        """A message that lies in a chunk as every recorder writes it, and its end: what most records are."""

    @abstractmethod
    def _take(
        self, source: Source, record: Record, found: Catalogue, budget: Budget, inside: bool
    ) -> Message | None:
        """The message of a record that is no chunk; streams are noted. inside: of a chunk."""

    def streams(self, ledger: Ledger) -> Sequence[Stream]:
        """From the index; without a sound one (damage: salvage only), from a walk through the file."""
        with self.path.open("rb") as file:
            source = Source(file, self.size)
            if source.read(0, min(len(self.magic), self.size)) != self.magic:
                raise wrong_kind(self.path, *self.kind)
            try:
                indexed = self._index(source)
            except DamageError as error:
                ledger.lost(error.reason, self.index_name)
                indexed = None
        if indexed is not None:
            streams = indexed.result()
            faults = [stream.fault for stream in streams if stream.fault]
            if not (faults and ledger.salvage):
                return streams
            ledger.lost(faults[0], self.index_name)  # the chunks hold the same descriptions once more
        found, budget = Catalogue(), Budget(self.path, self.size)
        for stream, stamp, _ in budget.messages(self._walk(found, budget, ledger.silent(), None)):
            found.tally(stream, 1, stamp, stamp)
        return found.result()

    def messages(self, wanted: Collection[int], ledger: Ledger) -> Iterator[Message]:
        """Messages of the wanted streams in file order."""
        chosen, budget = frozenset(wanted), Budget(self.path, self.size)
        walk = budget.messages(self._walk(Catalogue(), budget, ledger, chosen))
        return (message for message in walk if message[0] in chosen)

    def _walk(
        self, found: Catalogue, budget: Budget, ledger: Ledger, wanted: frozenset[int] | None
    ) -> Iterator[Message]:
        """Every message in file order; damage of a chunk that holds nothing wanted, as the index says, is no loss."""
        quiet, places = ledger.silent(), sorted(self._chunks)
        with self.path.open("rb") as file:
            source, position = Source(file, self.size), len(self.magic)
            while position < self.size:
                self.where, held = f"byte {position}", self._chunks.get(position)
                own = quiet if wanted is not None and held is not None and not held & wanted else ledger
                after = ([*places[bisect_right(places, position) :], self.size])[0]
                try:
                    record = self._record(source, position)
                    if record.op == self.last_op:
                        return
                    after = record.end if record.end <= self.size else after
                    if record.op == self.chunk_op:
                        chunk = self._chunk(source, record, own)
                        budget.chunk(len(chunk))
                        yield from self._inside(chunk, found, budget)
                    elif record.end > self.size:
                        ends = f"the file ends at byte {self.size}, inside a record of {record.size} bytes"
                        raise DamageError(ends)
                    elif (message := self._take(source, record, found, budget, False)) is not None:
                        yield message
                except DamageError as error:
                    own.lost(error.reason, self.where)
                position = after

    def _chunk(self, source: Source, record: Record, ledger: Ledger) -> bytes:
        """A chunk's records, as much of them as can be had."""
        begin, method, size, checksum = self._head(source, record)
        end, stored = min(record.end, self.size), record.end - begin
        if record.end > end:
            ledger.lost(f"the file ends at byte {end}, inside a chunk of {stored} bytes", self.where)
        if end - begin > MAX_CHUNK:
            raise DamageError(f"a chunk declares {stored} bytes; the limit is {MAX_CHUNK}")
        data, reason = expand(source.read(begin, end - begin), method, size)
        if reason is None and checksum and zlib.crc32(data) != checksum:
            reason = "a chunk's checksum does not match: some of its messages are wrong"
        if reason is not None:
            ledger.lost(reason, self.where)
        return data

    def _inside(self, chunk: bytes, found: Catalogue, budget: Budget) -> Iterator[Message]:
        """The messages of a chunk up to what cannot be understood."""
        source, end, place, position = Source(chunk, len(chunk)), len(chunk), self.where, 0
        while position < end:
            if (usual := self._usual(chunk, position)) is not None:
                yield usual[0]
                position = usual[1]
                continue
            budget.record()
            self.where = f"{place}, byte {position} of the chunk"
            record = self._record(source, position)
            if record.end > end:
                raise DamageError(f"a record reaches {record.end - end} bytes beyond its chunk")
            if (message := self._take(source, record, found, budget, True)) is not None:
                yield message
            self.where, position = place, record.end


class Fields(dict[bytes, bytes]):
    """A header of ROS 1: fields [length, name=value]."""

    @classmethod
    def of(cls, header: bytes) -> Fields:
        """Those of a record's header."""
        fields, position = cls(), 0
        while position < len(header):
            if position + 4 > len(header):
                raise DamageError("a record header ends inside a field")
            length = int.from_bytes(header[position : position + 4], "little")
            position += 4
            name, equals, value = header[position : position + length].partition(b"=")
            if position + length > len(header) or not equals:
                raise DamageError("a record header holds a broken field")
            fields[name] = value
            position += length
        return fields

    def number(self, name: str, width: int = 4) -> int:
        """A whole number of so many bytes."""
        value = self.get(name.encode(), b"")
        if len(value) != width:
            raise DamageError(f"a record lacks its field {name}")
        return int.from_bytes(value, "little")

    def time(self, name: str = "time") -> int:
        """A time [ns], which is written as seconds and nanoseconds."""
        both = self.number(name, 8)
        return (both & 0xFFFFFFFF) * 10**9 + (both >> 32)

    def text(self, name: str) -> str:
        """A text."""
        try:
            return self[name.encode()].decode()
        except KeyError as error:
            raise DamageError(f"a record lacks its field {name}") from error
        except UnicodeDecodeError as error:
            raise DamageError(f"field {name} is not text: {one_line(error, 60)}") from error


class Bag1(Walk):
    """A ROS 1 bag, format 2.0 (wiki.ros.org/Bags/Format/2.0): header length, header fields, data length, data.

    Lengths are little-endian uint32. The index is connections and chunk infos at its end; message times lie behind
    every chunk.
    """

    magic = b"#ROSBAG V2.0\n"
    kind = ("a ROS 1 bag", "it does not begin with #ROSBAG V2.0")
    index_name = "index"
    MESSAGE, BAG_HEADER, INDEX, CHUNK, CHUNK_INFO, CONNECTION = 2, 3, 4, 5, 6, 7
    chunk_op = CHUNK
    _MAX_HEADER = 1 << 20
    _TIMES = np.dtype([("seconds", "<u4"), ("nanoseconds", "<u4"), ("offset", "<u4")])
    _MESSAGE = re.compile(  # a message's header of three fields in any order
        rb"&\0\0\0(?:\x09\0\0\0conn=(.{4})|\x0d\0\0\0time=(.{8})|(\x04\0\0\0op=\x02)){3}(.{4})", re.DOTALL
    )

    def _record(self, source: Source, position: int) -> Record:
        length = int.from_bytes(source.read(position, 4), "little")
        if length > self._MAX_HEADER:
            raise DamageError(f"a record header declares {length} bytes")
        fields = Fields.of(source.read(position + 4, length))
        op = fields.get(b"op", b"")
        if len(op) != 1:
            raise DamageError("a record has no kind")
        size = int.from_bytes(source.read(position + 4 + length, 4), "little")
        return Record(op[0], position, position + 8 + length, size, fields)

    def _head(self, source: Source, record: Record) -> tuple[int, str, int, int]:
        size = record.fields.number("size")
        return record.data, record.fields.text("compression"), size, 0

    def _usual(self, chunk: bytes, position: int) -> tuple[Message, int] | None:
        """A message with a header of its three fields."""
        found = self._MESSAGE.match(chunk, position)
        if found is None or not all(parts := found.groups()):
            return None
        start, (connection, time, _, size) = found.end(), parts
        after = start + int.from_bytes(size, "little")
        if after > len(chunk):
            return None
        seconds, nanoseconds = struct.unpack("<II", time)
        stamp = seconds * 1_000_000_000 + nanoseconds
        return (int.from_bytes(connection, "little"), stamp, chunk[start:after]), after

    def _take(
        self, source: Source, record: Record, found: Catalogue, budget: Budget, inside: bool
    ) -> Message | None:
        """Messages are in chunks alone, and nothing else is there but connections."""
        if record.op == self.CONNECTION:
            found.add(self._stream(source, record))
        elif inside and record.op == self.MESSAGE:
            stamp = record.fields.time()
            return record.fields.number("conn"), stamp, source.read(record.data, record.size)
        elif inside:
            raise DamageError(f"a record of kind {record.op} lies inside a chunk")
        return None

    def _stream(self, source: Source, record: Record) -> Stream:
        """What a connection record describes, its type in ROS 2 spelling; what is wrong with it is its own fault."""
        identity = record.fields.number("conn")
        topic, fault = topic_name(record.fields.get(b"topic", b""))
        try:
            details = Fields.of(data_of(source, record))
            package, slash, name = details.text("type").partition("/")
            if not slash:
                raise DamageError(f"{one_line(package, 60)!r} is not a message type")
            kind = f"{package}/{name}" if name.startswith(("msg/", "action/")) else f"{package}/msg/{name}"
            definition, digest = details.text("message_definition"), details.text("md5sum")
        except DamageError as error:
            return Stream(identity, topic, encoding="ros1", fault=fault or error.reason)
        return Stream(identity, topic, kind, definition, "msg", "ros1", digest, fault=fault)

    def _index(self, source: Source) -> Catalogue:
        head = self._record(source, len(self.magic))
        if head.op != self.BAG_HEADER:
            raise DamageError("the bag header is missing")
        position, chunks = head.fields.number("index_pos", 8), head.fields.number("chunk_count")
        if position == 0:
            raise DamageError("the bag was never closed, so it has no index (rosbag reindex would make one)")
        if position > source.size:
            raise DamageError(f"the index should be at byte {position}, the file ends at {source.size}")
        if head.fields.get(b"encryptor"):
            raise DamageError("the bag is encrypted")
        found = Catalogue(chunks=self._chunks)
        for _ in range(head.fields.number("conn_count")):
            record = self._expect(source, position, self.CONNECTION)
            stream = self._stream(source, record)
            found.streams[stream.id] = stream
            position = record.end
        for _ in range(chunks):
            record = self._expect(source, position, self.CHUNK_INFO)
            self._chunk_info(source, record, found)
            position = record.end
        unknown = sorted(set(found.tallies) - set(found.streams))
        if unknown:
            raise DamageError(f"the index counts messages of connection {unknown[0]}, which it does not list")
        return found

    def _expect(self, source: Source, position: int, op: int) -> Record:
        record = self._record(source, position)
        if record.op != op:
            there = f"a record of kind {record.op} where {op} belongs"
            raise DamageError(f"the index holds {there}, at byte {position}")
        return record

    def _chunk_info(self, source: Source, record: Record, found: Catalogue) -> None:
        fields, data = record.fields, data_of(source, record)
        count = fields.number("count")
        if len(data) != 8 * count:
            raise DamageError(f"a chunk info at byte {record.start} declares {count} connections")
        counts: dict[int, int] = {}
        for connection, messages in struct.iter_unpack("<II", data):
            counts[connection] = counts.get(connection, 0) + messages
        place = fields.number("chunk_pos", 8)
        ranges = self._times(source, place, count)
        whole = (fields.time("start_time"), fields.time("end_time")) if count else (0, 0)
        found.chunks[place] = frozenset(counts)
        for connection, messages in counts.items():
            if messages:
                found.tally(connection, messages, *ranges.get(connection, whole))

    def _times(self, source: Source, chunk: int, count: int) -> dict[int, tuple[int, int]]:
        """First and last receive time [ns] of each connection in a chunk; empty where the records are not sound."""
        ranges: dict[int, tuple[int, int]] = {}
        try:
            position = self._record(source, chunk).end
            for _ in range(count):
                record = self._expect(source, position, self.INDEX)
                most = 12 * record.fields.number("count")
                data = np.frombuffer(data_of(source, record)[:most], dtype=self._TIMES)
                stamps = data["seconds"].astype(np.int64) * 10**9 + data["nanoseconds"]
                if len(stamps):
                    ranges[record.fields.number("conn")] = (int(stamps.min()), int(stamps.max()))
                position = record.end
        except (DamageError, ValueError):
            return {}
        return ranges


class Content:
    """Reads the parts of a record of MCAP one after the other."""

    def __init__(self, data: bytes) -> None:
        self.data, self.position = data, 0

    def take(self, count: int) -> bytes:
        """The next `count` bytes."""
        if self.position + count > len(self.data):
            raise DamageError(f"a record of {len(self.data)} bytes declares a part of {count} bytes")
        self.position += count
        return self.data[self.position - count : self.position]

    def number(self, width: int) -> int:
        """The next number, of so many bytes."""
        return int.from_bytes(self.take(width), "little")

    def blob(self) -> bytes:
        """The next bytes with their length in front."""
        return self.take(self.number(4))

    def text(self) -> str:
        """The next text with its length in front."""
        raw = self.blob()
        try:
            return raw.decode()
        except UnicodeDecodeError as error:
            raise DamageError(f"a record's text is not text: {one_line(raw[:40])}") from error

    def pairs(self) -> Iterator[tuple[int, int]]:
        """The next map of uint16 to uint64."""
        inner = Content(self.blob())
        while inner.position < len(inner.data):
            yield inner.number(2), inner.number(8)


class Schema(NamedTuple):
    """A message definition."""

    name: str = "unknown"
    encoding: str = ""
    definition: str = ""
    fault: str = ""


class Mcap(Walk):
    """An MCAP file (mcap.dev/spec): a record is op code, length as little-endian uint64, content.

    Chunk checksums are verified where they exist.
    """

    FOOTER, SCHEMA, CHANNEL, MESSAGE, CHUNK, MESSAGE_INDEX, CHUNK_INDEX, STATISTICS = 2, 3, 4, 5, 6, 7, 8, 11
    magic = b"\x89MCAP0\r\n"
    kind = ("an MCAP file", "it does not begin with the MCAP mark")
    index_name = "summary"
    chunk_op = CHUNK
    last_op = FOOTER
    _COMPRESSIONS = {"": "none", "lz4": "lz4", "zstd": "zstd"}  # noqa: RUF012
    _FORMATS: dict[str, DefinitionFormat] = {  # noqa: RUF012
        "ros2msg": "msg", "ros1msg": "msg", "ros2idl": "idl", "omgidl": "idl",
    }  # fmt: skip
    _RECORD, _CHUNK_HEAD = struct.Struct("<BQ"), struct.Struct("<QQQI")
    _MESSAGE_HEAD, _USUAL = struct.Struct("<HIQQ"), struct.Struct("<BQHIQQ")  # alone, and with the record's
    _TIMES = np.dtype([("time", "<u8"), ("offset", "<u8")])

    def _record(self, source: Source, position: int) -> Record:
        op, size = self._RECORD.unpack(source.read(position, self._RECORD.size))
        if op == 0:
            raise DamageError("a record of kind 0")
        return Record(op, position, position + self._RECORD.size, size, Fields())

    def _head(self, source: Source, record: Record) -> tuple[int, str, int, int]:
        count = min(self._CHUNK_HEAD.size + 64, record.size, self.size - record.data)
        front = Content(source.read(record.data, count))
        _, _, size, checksum = self._CHUNK_HEAD.unpack(front.take(self._CHUNK_HEAD.size))
        method, stored = front.text(), front.number(8)
        begin = record.data + front.position
        if method not in self._COMPRESSIONS or begin + stored != record.end:
            raise DamageError(f"a chunk's head is damaged (compression {method[:8]!r}, {stored} bytes)")
        return begin, self._COMPRESSIONS[method], size, checksum

    def _usual(self, chunk: bytes, position: int) -> tuple[Message, int] | None:
        """A message that lies in the chunk as a whole, at a time that can be."""
        start = position + self._USUAL.size
        if start > len(chunk):
            return None
        op, size, channel, _, stamp, _ = self._USUAL.unpack_from(chunk, position)
        after = position + self._RECORD.size + size
        if op != self.MESSAGE or after < start or after > len(chunk) or stamp >= LATEST:
            return None
        return (channel, stamp, chunk[start:after]), after

    def _take(
        self, source: Source, record: Record, found: Catalogue, budget: Budget, inside: bool
    ) -> Message | None:
        """A message; schemas and channels are noted, and other records are no affair of this."""
        if record.op == self.MESSAGE:
            parts = Content(data_of(source, record))
            channel, _, stamp, _ = self._MESSAGE_HEAD.unpack(parts.take(self._MESSAGE_HEAD.size))
            if stamp >= LATEST:
                raise DamageError(f"a message's time is {stamp} ns")
            return channel, stamp, parts.data[parts.position :]
        if record.op in (self.SCHEMA, self.CHANNEL):
            self._describe(record.op, Content(data_of(source, record)), found)
        elif not inside and not record.size:
            budget.empty()
        return None

    def _describe(self, op: int, parts: Content, found: Catalogue) -> None:
        """Note a schema or a channel; what is wrong with one is its own fault."""
        identity = parts.number(2)
        if op == self.SCHEMA:
            try:
                found.schemas[identity] = self._schema(parts)
            except DamageError as error:
                found.schemas[identity] = Schema(fault=error.reason)
            return
        schema: Schema = found.schemas.get(parts.number(2), Schema())
        topic, fault = topic_name(parts.blob())
        ros1 = schema.encoding == "ros1msg" and "/msg/" not in schema.name
        name = schema.name.replace("/", "/msg/", 1) if ros1 else schema.name
        form = self._FORMATS.get(schema.encoding, "none") if schema.definition else "none"
        told = Stream(
            identity, topic, name, schema.definition, form, parts.text(), fault=fault or schema.fault
        )
        found.add(told)

    def _schema(self, parts: Content) -> Schema:
        name, encoding = parts.text(), parts.text()
        if encoding not in self._FORMATS:
            return Schema(name, encoding)
        if len(parts.data) - parts.position > MAX_DEFINITION:
            raise DamageError(f"definition of {one_line(name, 60)} is longer than {MAX_DEFINITION} bytes")
        return Schema(name, encoding, parts.text())

    def _index(self, source: Source) -> Catalogue | None:
        size = 9 + 20 + len(self.magic)  # of a footer
        tail = source.read(max(0, source.size - size), min(size, source.size))
        if len(tail) < size or not tail.endswith(self.magic):
            raise DamageError("the file was cut off or never closed: it does not end with the MCAP mark")
        if tail[0] != self.FOOTER or tail[1:9] != (20).to_bytes(8, "little"):
            raise DamageError("the footer is damaged")
        start, _, checksum = struct.unpack("<QQI", tail[9:29])
        if start == 0:
            return None
        footer = source.size - size
        if not len(self.magic) <= start <= footer or footer - start > MAX_CHUNK:
            raise DamageError(f"the footer places the summary at byte {start}")
        if checksum and zlib.crc32(source.read(start, footer + 25 - start)) != checksum:
            raise DamageError("the summary's checksum does not match")
        found, faults, chunks, position = Catalogue(chunks=self._chunks), list[DamageError](), 0, start
        while position < footer:
            record = self._record(source, position)
            parts = Content(data_of(source, record))
            if record.op in (self.SCHEMA, self.CHANNEL):
                self._describe(record.op, parts, found)
            elif record.op == self.CHUNK_INDEX:
                chunks += 1
                try:
                    self._chunk_index(source, parts, found)
                except DamageError as error:
                    faults.append(error)
            elif record.op == self.STATISTICS:
                parts.take(42)
                found.counts = dict(parts.pairs())
            position = record.end
        if faults:
            raise faults[0]
        if not chunks or (not found.streams and any(found.counts.values())):
            return None  # messages outside chunks have no index, so nothing tells when they came
        unknown = sorted(set(found.counts) - set(found.streams))
        if unknown:
            raise DamageError(f"the summary counts messages of channel {unknown[0]}, which it does not list")
        return found

    def _chunk_index(self, source: Source, parts: Content, found: Catalogue) -> None:
        _, _, place, _ = (parts.number(8) for _ in range(4))
        offsets = list(parts.pairs())
        if offsets:  # a writer may leave the offsets away: then nobody knows what the chunk holds
            found.chunks[place] = frozenset(channel for channel, _ in offsets)
        for channel, position in offsets:
            record = self._record(source, position)
            if record.op != self.MESSAGE_INDEX:
                there = f"at byte {position}, a record of kind {record.op} is there"
                raise DamageError(f"the summary places a message index {there}")
            index = Content(data_of(source, record))
            index.take(2)
            raw = index.blob()
            times: Any = np.frombuffer(raw[: len(raw) // 16 * 16], dtype=self._TIMES)["time"]
            if len(times):
                found.tally(channel, len(times), int(times.min()), int(times.max()))
