"""MCAP files, walked record by record, one chunk in memory at a time; chunk checksums are verified where they exist."""

from __future__ import annotations

import struct
from collections.abc import Iterable, Iterator

from gpsim.recordings.readers.chunked import Catalogue, Chunked, Head, Record
from gpsim.recordings.readers.damage import DamageError, Ledger
from gpsim.recordings.readers.mcap_records import (
    CHANNEL,
    CHUNK,
    CHUNK_HEAD,
    COMPRESSIONS,
    FOOTER,
    MAGIC,
    MESSAGE,
    MESSAGE_HEAD,
    SCHEMA,
    Content,
    content,
    next_record,
    read_record,
    read_summary,
    take,
)
from gpsim.recordings.readers.source import LATEST, Budget, Message, Source

_FAST = struct.Struct("<BQHIQQ")
_HEAD = 9


class Mcap(Chunked[Record]):
    """One .mcap file."""

    magic = MAGIC
    kind = ("an MCAP file", "it does not begin with the MCAP mark")
    index_name = "summary"
    chunk_op = CHUNK

    def read_index(self, source: Source) -> Catalogue | None:
        """What the summary says."""
        return read_summary(source)

    def read_record(self, source: Source, position: int) -> Record:
        """The record at a place."""
        return read_record(source, position)

    def next_record(self, source: Source, start: int, found: Catalogue) -> int | None:
        """Where the next message or chunk begins."""
        return next_record(source, start, found.streams, chunks=True)

    def is_last(self, record: Record) -> bool:
        """Whether it is the footer."""
        return record.op == FOOTER

    def behind(self, source: Source, head: Head, found: Catalogue) -> int | None:
        """What is not compressed holds messages, which are no way out of the chunk."""
        return None if head.method == "none" else super().behind(source, head, found)

    def head(self, source: Source, record: Record) -> Head:
        """A chunk's head."""
        front = Content(
            source.read(record.data, min(CHUNK_HEAD.size + 64, record.size, self.size - record.data))
        )
        _, _, size, checksum = CHUNK_HEAD.unpack(front.take(CHUNK_HEAD.size))
        method, stored = front.text(), front.u64()
        begin = record.data + front.position
        if method not in COMPRESSIONS or begin + stored != record.end:
            raise DamageError(f"a chunk's head is damaged (compression {method[:8]!r}, {stored} bytes)")
        return Head(begin, stored, COMPRESSIONS[method], size, checksum)

    def outside(self, source: Source, record: Record, found: Catalogue, budget: Budget) -> Iterable[Message]:
        """A message; schemas and channels are noted."""
        if record.op == MESSAGE:
            return (_message(content(source, record)),)
        if record.op in (SCHEMA, CHANNEL):
            take(record.op, content(source, record), found)
        elif not record.size:
            budget.empty()
        return ()

    def in_chunk(self, chunk: bytes, found: Catalogue, ledger: Ledger, budget: Budget) -> Iterator[Message]:
        """The messages of a chunk."""
        position: int | None = 0
        unpack, front, end = _FAST.unpack_from, _FAST.size, len(chunk)
        while position is not None and position < end and not ledger.exhausted:
            if position + front <= end:
                op, size, channel, _, stamp, _ = unpack(chunk, position)
                after = position + _HEAD + size
                if op == MESSAGE and size >= MESSAGE_HEAD.size and after <= end and stamp < LATEST:
                    yield channel, stamp, chunk[position + front : after]
                    position = after
                    continue
            budget.record()
            position = self._other(chunk, position, found, ledger)

    def _other(self, chunk: bytes, position: int, found: Catalogue, ledger: Ledger) -> int | None:
        """Anything but a sound message: take schemas and channels, skip the rest, find the way behind damage."""
        source = Source(chunk, len(chunk))
        try:
            record = read_record(source, position)
            if record.end > len(chunk):
                raise DamageError(f"a record reaches {record.end - len(chunk)} bytes beyond its chunk")
            if record.op == MESSAGE:
                _message(content(source, record))
            take(record.op, content(source, record), found)
            return record.end
        except DamageError as error:
            ledger.lost(error.reason, f"{self.where}, byte {position} of the chunk")
            return next_record(source, position + 1, found.streams, chunks=False)


def _message(parts: Content) -> Message:
    channel, _, stamp, _ = MESSAGE_HEAD.unpack(parts.take(MESSAGE_HEAD.size))
    if stamp >= LATEST:
        raise DamageError(f"a message's time is {stamp} ns")
    return channel, stamp, parts.data[parts.position :]
