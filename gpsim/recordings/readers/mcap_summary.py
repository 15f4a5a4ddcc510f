"""The summary at the end of an MCAP file: channels, how many messages each has, and when."""

from __future__ import annotations

import zlib
from dataclasses import dataclass, field

import numpy as np

from gpsim.recordings.readers.catalogue import Catalogue
from gpsim.recordings.readers.damage import MAX_CHUNK, DamageError
from gpsim.recordings.readers.mcap_records import (
    CHANNEL,
    CHUNK_INDEX,
    FOOTER,
    MESSAGE_INDEX,
    SCHEMA,
    STATISTICS,
    Content,
    Schema,
    content,
    read_record,
    schema_of,
    stream_of,
)
from gpsim.recordings.readers.source import Source

MAGIC = b"\x89MCAP0\r\n"
_FOOTER_SIZE = 9 + 20 + len(MAGIC)
_TIMES = np.dtype([("time", "<u8"), ("offset", "<u8")])


@dataclass
class Summary:
    """What the summary section holds."""

    found: Catalogue = field(default_factory=Catalogue)
    schemas: dict[int, Schema] = field(default_factory=dict)
    counts: dict[int, int] | None = None
    chunks: int = 0


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
    summary = Summary()
    position = start
    while position < footer:
        record = read_record(source, position)
        _take(source, record.op, content(source, record), summary)
        position = record.end
    if not summary.chunks:
        return None  # messages outside chunks have no index, so nothing tells when they came
    return _result(summary)


def _result(summary: Summary) -> Catalogue | None:
    found = summary.found
    if summary.counts is not None:
        if not found.streams and any(summary.counts.values()):
            return None
        unknown = sorted(set(summary.counts) - set(found.streams))
        if unknown:
            raise DamageError(f"the summary counts messages of channel {unknown[0]}, which it does not list")
        for channel, count in summary.counts.items():
            found.tally(channel).count = count
    return found


def _take(source: Source, op: int, parts: Content, summary: Summary) -> None:
    if op == SCHEMA:
        identity, schema = schema_of(parts)
        summary.schemas[identity] = schema
    elif op == CHANNEL:
        summary.found.add(stream_of(parts, summary.schemas))
    elif op == CHUNK_INDEX:
        summary.chunks += 1
        _take_chunk_index(source, parts, summary.found)
    elif op == STATISTICS:
        parts.take(42)
        pairs = Content(parts.blob())
        summary.counts = {}
        while pairs.position < len(pairs.data):
            channel = pairs.u16()
            summary.counts[channel] = pairs.u64()


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
