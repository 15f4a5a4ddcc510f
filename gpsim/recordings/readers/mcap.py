"""MCAP files, walked record by record, one chunk in memory at a time; chunk checksums are verified where they exist.

rosbags' own reader cannot open a file that was cut off, and decompresses whatever a chunk turns out to hold.
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from gpsim.recordings.readers.catalogue import Catalogue
from gpsim.recordings.readers.damage import MAX_CHUNK, DamageError, Ledger, expand, regular_file, wrong_kind
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
    Record,
    Schema,
    content,
    next_record,
    read_record,
    read_summary,
    schema_of,
    stream_of,
)
from gpsim.recordings.readers.source import LATEST, Budget, Message, Source, Stream

_FAST = struct.Struct("<BQHIQQ")
_HEAD = 9


@dataclass
class _Walk:
    """Channels and schemas met so far on one way through the file."""

    found: Catalogue = field(default_factory=Catalogue)
    schemas: dict[int, Schema] = field(default_factory=dict)

    def take(self, op: int, parts: Content) -> None:
        if op == SCHEMA:
            identity, schema = schema_of(parts)
            self.schemas[identity] = schema
        elif op == CHANNEL:
            self.found.add(stream_of(parts, self.schemas))


@dataclass
class Mcap:
    """One .mcap file. `where` is the record being read."""

    path: Path
    where: str = "byte 0"
    distro: str | None = None
    _held: dict[int, frozenset[int]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self.size = regular_file(self.path)

    def streams(self, ledger: Ledger) -> Sequence[Stream]:
        """From the summary; without one, from a walk through the file."""
        with self.path.open("rb") as file:
            source = Source(file, self.size)
            if source.read(0, min(len(MAGIC), self.size)) != MAGIC:
                raise wrong_kind(self.path, "an MCAP file", "it does not begin with the MCAP mark")
            try:
                summary = read_summary(source)
            except DamageError as error:
                ledger.lost(error.reason, "summary")
                summary = None
        if summary is not None:
            self._held = summary.chunks
            streams = summary.result()
            faults = [stream.fault for stream in streams if stream.fault]
            if not (faults and ledger.salvage):
                return streams
            ledger.lost(faults[0], "summary")  # the chunks hold the same descriptions once more
        walk = _Walk()
        for channel, stamp, _ in self._walk(walk, ledger.silent()):
            walk.found.tally(channel).add(1, stamp, stamp)
        return walk.found.result()

    def messages(self, wanted: Collection[int], ledger: Ledger) -> Iterator[Message]:
        """Messages of the wanted channels in file order."""
        chosen = frozenset(wanted)
        return (message for message in self._walk(_Walk(), ledger, chosen) if message[0] in chosen)

    def _walk(self, walk: _Walk, ledger: Ledger, wanted: frozenset[int] | None = None) -> Iterator[Message]:
        """Damage of a chunk that holds nothing wanted, as the summary says, is nobody's loss."""
        budget = Budget(self.path, self.size)
        return budget.messages(self._steps(walk, ledger, wanted, budget))

    def _steps(
        self, walk: _Walk, ledger: Ledger, wanted: frozenset[int] | None, budget: Budget
    ) -> Iterator[Message]:
        quiet = ledger.silent()
        with self.path.open("rb") as file:
            source = Source(file, self.size)
            position: int | None = len(MAGIC)
            while position is not None and position < self.size and not ledger.exhausted:
                self.where = f"byte {position}"
                held = self._held.get(position)
                own = quiet if wanted is not None and held is not None and not held & wanted else ledger
                try:
                    record = read_record(source, position)
                    if record.op == FOOTER:
                        return
                    if record.op == CHUNK:
                        chunk, position = self._chunk(source, record, walk, own)
                        budget.chunk(len(chunk))
                        yield from self._in_chunk(chunk, walk, own, budget)
                        continue
                    if record.end > self.size:
                        raise DamageError(
                            f"the file ends at byte {self.size}, inside a record of {record.size} bytes"
                        )
                    if record.op == MESSAGE:
                        yield _message(content(source, record))
                    elif record.op in (SCHEMA, CHANNEL):
                        walk.take(record.op, content(source, record))
                    elif not record.size:
                        budget.empty()
                    position = record.end
                except DamageError as error:
                    own.lost(error.reason, self.where)
                    position = next_record(source, position + 1, walk.found.streams, chunks=True)

    def _chunk(self, source: Source, record: Record, walk: _Walk, ledger: Ledger) -> tuple[bytes, int]:
        """(a chunk's records, as much of them as can be had; where the walk goes on)."""
        front = Content(
            source.read(record.start, min(CHUNK_HEAD.size + 64, record.size, self.size - record.start))
        )
        _, _, size, checksum = CHUNK_HEAD.unpack(front.take(CHUNK_HEAD.size))
        method, stored = front.text(), front.u64()
        begin, end = record.start + front.position, record.end
        if method not in COMPRESSIONS or begin + stored != end:
            raise DamageError(f"a chunk's head is damaged (compression {method[:8]!r}, {stored} bytes)")
        if end > self.size:
            ledger.lost(f"the file ends at byte {self.size}, inside a chunk of {stored} bytes", self.where)
            following = next_record(source, begin, walk.found.streams, chunks=True) if method else None
            end = following or self.size
        if end - begin > MAX_CHUNK:
            raise DamageError(f"a chunk declares {stored} bytes; the limit is {MAX_CHUNK}")
        data, reason = expand(source.read(begin, end - begin), COMPRESSIONS[method], size)
        if reason is None and checksum and zlib.crc32(data) != checksum:
            reason = "a chunk's checksum does not match: some of its messages are wrong"
        if reason is not None:
            ledger.lost(reason, self.where)
        return data, end

    def _in_chunk(self, chunk: bytes, walk: _Walk, ledger: Ledger, budget: Budget) -> Iterator[Message]:
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
            position = self._other(chunk, position, walk, ledger)

    def _other(self, chunk: bytes, position: int, walk: _Walk, ledger: Ledger) -> int | None:
        """Anything but a sound message: take schemas and channels, skip the rest, find the way behind damage."""
        source = Source(chunk, len(chunk))
        try:
            record = read_record(source, position)
            if record.end > len(chunk):
                raise DamageError(f"a record reaches {record.end - len(chunk)} bytes beyond its chunk")
            if record.op == MESSAGE:
                _message(content(source, record))
            walk.take(record.op, content(source, record))
            return record.end
        except DamageError as error:
            ledger.lost(error.reason, f"{self.where}, byte {position} of the chunk")
            return next_record(source, position + 1, walk.found.streams, chunks=False)


def _message(parts: Content) -> Message:
    channel, _, stamp, _ = MESSAGE_HEAD.unpack(parts.take(MESSAGE_HEAD.size))
    if stamp >= LATEST:
        raise DamageError(f"a message's time is {stamp} ns")
    return channel, stamp, parts.data[parts.position :]
