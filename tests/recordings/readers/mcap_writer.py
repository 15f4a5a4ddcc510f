"""MCAP files written from the specification (mcap.dev/spec) with what rosbags' writer lacks: lz4, checksums, no chunks."""

from __future__ import annotations

import struct
import zlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import lz4.frame
from backports import zstd

MAGIC = b"\x89MCAP0\r\n"


@dataclass(frozen=True)
class Chunks:
    """size None: messages lie outside chunks. checksum: crc32 of every chunk and of the summary."""

    compression: str = ""
    size: int | None = 4096
    summary: bool = True
    checksum: bool = True


def text(value: str) -> bytes:
    raw = value.encode()
    return struct.pack("<I", len(raw)) + raw


def record(op: int, body: bytes) -> bytes:
    return struct.pack("<BQ", op, len(body)) + body


@dataclass
class _File:
    options: Chunks
    out: bytearray = field(
        default_factory=lambda: bytearray(MAGIC + record(1, text("ros2") + text("gpsim tests")))
    )
    chunk: bytearray = field(default_factory=bytearray)
    index: dict[int, list[tuple[int, int]]] = field(default_factory=dict)
    chunk_indexes: list[bytes] = field(default_factory=list)

    def message(self, channel: int, stamp: int, data: bytes) -> None:
        raw = record(5, struct.pack("<HIQQ", channel, 0, stamp, stamp) + data)
        if self.options.size is None:
            self.out += raw
            return
        self.index.setdefault(channel, []).append((stamp, len(self.chunk)))
        self.chunk += raw
        if len(self.chunk) >= self.options.size:
            self.close_chunk()

    def close_chunk(self) -> None:
        if not self.chunk:
            return
        raw = bytes(self.chunk)
        squeeze = {"": bytes, "lz4": lz4.frame.compress, "zstd": zstd.compress}[self.options.compression]
        packed = squeeze(raw)
        stamps = [stamp for entries in self.index.values() for stamp, _ in entries] or [0]
        start, end = min(stamps), max(stamps)
        checksum = zlib.crc32(raw) if self.options.checksum else 0
        body = struct.pack("<QQQI", start, end, len(raw), checksum) + text(self.options.compression)
        at = len(self.out)
        self.out += record(6, body + struct.pack("<Q", len(packed)) + packed)
        length, offsets = len(self.out) - at, b""
        for channel, entries in self.index.items():
            offsets += struct.pack("<HQ", channel, len(self.out))
            pairs = b"".join(struct.pack("<QQ", *entry) for entry in entries)
            self.out += record(7, struct.pack("<HI", channel, len(pairs)) + pairs)
        behind = len(self.out) - at - length
        self.chunk_indexes.append(
            struct.pack("<QQQQ", start, end, at, length)
            + struct.pack("<I", len(offsets))
            + offsets
            + struct.pack("<Q", behind)
            + text(self.options.compression)
            + struct.pack("<QQ", len(packed), len(raw))
        )
        self.chunk.clear()
        self.index.clear()


def write_mcap(
    types: Mapping[str, str],
    definitions: Mapping[str, str],
    rows: Sequence[tuple[int, str, bytes]],
    options: Chunks,
) -> bytes:
    """A whole file. types: topic to type; definitions: type to text; rows: (time [ns], topic, CDR bytes)."""
    file = _File(options)
    names = list(dict.fromkeys(types.values()))
    schemas = b"".join(
        record(3, struct.pack("<H", i + 1) + text(name) + text("ros2msg") + text(definitions[name]))
        for i, name in enumerate(names)
    )
    channels = {topic: i + 1 for i, topic in enumerate(types)}
    described = b"".join(
        record(
            4,
            struct.pack("<HH", i, names.index(types[topic]) + 1)
            + text(topic)
            + text("cdr")
            + struct.pack("<I", 0),
        )
        for topic, i in channels.items()
    )
    (file.out if options.size is None else file.chunk).extend(schemas + described)
    for stamp, topic, data in rows:
        file.message(channels[topic], stamp, data)
    file.close_chunk()
    file.out += record(0x0F, struct.pack("<I", 0))
    return bytes(file.out) + _end(file, schemas + described, channels, rows)


def _end(
    file: _File, described: bytes, channels: Mapping[str, int], rows: Sequence[tuple[int, str, bytes]]
) -> bytes:
    if not file.options.summary:
        return record(2, struct.pack("<QQI", 0, 0, 0)) + MAGIC
    counts = {i: sum(1 for _, topic, _ in rows if channels[topic] == i) for i in channels.values()}
    pairs = b"".join(struct.pack("<HQ", i, count) for i, count in counts.items())
    stamps = [stamp for stamp, _, _ in rows] or [0]
    chunks = len(file.chunk_indexes)
    numbers = struct.pack("<QHIIIIQQ", len(rows), 1, len(channels), 0, 0, chunks, min(stamps), max(stamps))
    summary = described + b"".join(record(8, index) for index in file.chunk_indexes)
    summary += record(0x0B, numbers + struct.pack("<I", len(pairs)) + pairs)
    front = struct.pack("<BQQQ", 2, 20, len(file.out), 0)
    checksum = zlib.crc32(summary + front) if file.options.checksum else 0
    return summary + front + struct.pack("<I", checksum) + MAGIC
