"""Bags of records, some of which are chunks of records: one walk through the file, which finds its way behind damage.

rosbags' own readers hold one Python object for every message of the file or decompress whatever a chunk turns out to
hold, trust every declared length and cannot open a bag that was cut off or whose index is damaged; this walk holds one
chunk and checks lengths against the file.
"""

from __future__ import annotations

import zlib
from abc import ABC, abstractmethod
from collections.abc import Collection, Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Generic, NamedTuple, TypeVar

from gpsim.recordings.readers.damage import MAX_CHUNK, DamageError, Ledger, expand, regular_file, wrong_kind
from gpsim.recordings.readers.source import Budget, Message, Source, Stream


@dataclass
class Tally:
    """Messages of one stream: how many, first and last receive time [ns]."""

    count: int = 0
    start: int | None = None
    end: int | None = None

    def add(self, count: int, start: int, end: int) -> None:
        """Count more messages."""
        self.count += count
        self.start = start if self.start is None else min(self.start, start)
        self.end = end if self.end is None else max(self.end, end)


@dataclass
class Catalogue:
    """Streams by id and what is known of their messages.

    chunks: the streams in the chunk that begins at a byte; schemas: what streams refer to (MCAP); listing: whether the
    streams are what is looked for.
    """

    streams: dict[int, Stream] = field(default_factory=dict)
    tallies: dict[int, Tally] = field(default_factory=dict)
    chunks: dict[int, frozenset[int]] = field(default_factory=dict)
    schemas: dict[int, Any] = field(default_factory=dict)
    listing: bool = False

    def tally(self, stream: int) -> Tally:
        """The tally of a stream, made when first asked for."""
        return self.tallies.setdefault(stream, Tally())

    def add(self, stream: Stream) -> None:
        """Note a stream; the first description of it that can be used stays."""
        known = self.streams.get(stream.id)
        if known is None or (known.fault and not stream.fault):
            self.streams[stream.id] = stream

    def result(self) -> list[Stream]:
        """The streams with their counts and times."""
        empty = Tally()
        found = [(s, self.tallies.get(s.id, empty)) for s in self.streams.values()]
        return [replace(s, count=t.count, start=t.start, end=t.end) for s, t in found]


@dataclass(frozen=True)
class Record:
    """Its kind, and where its data lie; `end`, where the next one begins, may be outside the file."""

    op: int
    data: int
    size: int

    @property
    def end(self) -> int:
        """Offset of the next record."""
        return self.data + self.size


class Head(NamedTuple):
    """A chunk's: where its data begin, how many bytes they are there, how compressed, how many they make, checksum."""

    begin: int
    stored: int
    method: str
    size: int
    checksum: int = 0


R = TypeVar("R", bound=Record)


class Chunked(ABC, Generic[R]):
    """One file. `where` is the record being read."""

    magic: bytes
    kind: tuple[str, str]  # what it is, and why a file is none that begins otherwise
    index_name: str
    chunk_op: int

    def __init__(self, path: Path) -> None:
        self.path = path
        self.size = regular_file(path)
        self.where = "byte 0"
        self.distro: str | None = None
        self._held: dict[int, frozenset[int]] = {}

    @abstractmethod
    def read_index(self, source: Source) -> Catalogue | None:
        """What the file's own index says; None without one, DamageError where it is not sound."""

    @abstractmethod
    def read_record(self, source: Source, position: int) -> R:
        """The record at a place."""

    @abstractmethod
    def next_record(self, source: Source, start: int, found: Catalogue) -> int | None:
        """Where the next believable record begins, at or after `start`."""

    @abstractmethod
    def head(self, source: Source, record: R) -> Head:
        """A chunk's head."""

    @abstractmethod
    def in_chunk(self, chunk: bytes, found: Catalogue, ledger: Ledger, budget: Budget) -> Iterator[Message]:
        """The messages of a chunk; what cannot be understood is told to the ledger and skipped."""

    @abstractmethod
    def outside(self, source: Source, record: R, found: Catalogue, budget: Budget) -> Iterable[Message]:
        """The messages of a record that is no chunk."""

    def is_last(self, record: R) -> bool:
        """Whether no messages come behind this record."""
        return False

    def behind(self, source: Source, head: Head, found: Catalogue) -> int | None:
        """Where to go on behind a chunk that reaches beyond the file."""
        return self.next_record(source, head.begin, found)

    def streams(self, ledger: Ledger) -> Sequence[Stream]:
        """From the index; without a sound one (damage: salvage only), from a walk through the file."""
        with self.path.open("rb") as file:
            source = Source(file, self.size)
            if source.read(0, min(len(self.magic), self.size)) != self.magic:
                raise wrong_kind(self.path, *self.kind)
            try:
                indexed = self.read_index(source)
            except DamageError as error:
                ledger.lost(error.reason, self.index_name)
                indexed = None
        if indexed is not None:
            self._held = indexed.chunks
            streams = indexed.result()
            faults = [stream.fault for stream in streams if stream.fault]
            if not (faults and ledger.salvage):
                return streams
            ledger.lost(faults[0], self.index_name)  # the chunks hold the same descriptions once more
        found = Catalogue(listing=True)
        for stream, stamp, _ in self._walk(found, ledger.silent(), None):
            found.tally(stream).add(1, stamp, stamp)
        return found.result()

    def messages(self, wanted: Collection[int], ledger: Ledger) -> Iterator[Message]:
        """Messages of the wanted streams in file order."""
        chosen = frozenset(wanted)
        return (message for message in self._walk(Catalogue(), ledger, chosen) if message[0] in chosen)

    def _walk(self, found: Catalogue, ledger: Ledger, wanted: frozenset[int] | None) -> Iterator[Message]:
        budget = Budget(self.path, self.size)
        return budget.messages(self._steps(found, ledger, wanted, budget))

    def _steps(
        self, found: Catalogue, ledger: Ledger, wanted: frozenset[int] | None, budget: Budget
    ) -> Iterator[Message]:
        """Every message in file order; damage of a chunk that holds nothing wanted, as the index says, is no loss."""
        quiet = ledger.silent()
        with self.path.open("rb") as file:
            source = Source(file, self.size)
            position: int | None = len(self.magic)
            while position is not None and position < self.size and not ledger.exhausted:
                self.where = f"byte {position}"
                held = self._held.get(position)
                own = quiet if wanted is not None and held is not None and not held & wanted else ledger
                try:
                    record = self.read_record(source, position)
                    if self.is_last(record):
                        return
                    if record.op == self.chunk_op:
                        chunk, position = self._chunk(source, record, found, own)
                        budget.chunk(len(chunk))
                        yield from self.in_chunk(chunk, found, own, budget)
                        continue
                    if record.end > self.size:
                        raise DamageError(
                            f"the file ends at byte {self.size}, inside a record of {record.size} bytes"
                        )
                    yield from self.outside(source, record, found, budget)
                    position = record.end
                except DamageError as error:
                    own.lost(error.reason, self.where)
                    position = self.next_record(source, position + 1, found)

    def _chunk(self, source: Source, record: R, found: Catalogue, ledger: Ledger) -> tuple[bytes, int]:
        """(a chunk's records, as much of them as can be had; where the walk goes on)."""
        head, end = self.head(source, record), record.end
        if end > self.size:
            ledger.lost(
                f"the file ends at byte {self.size}, inside a chunk of {head.stored} bytes", self.where
            )
            end = self.behind(source, head, found) or self.size
        if end - head.begin > MAX_CHUNK:
            raise DamageError(f"a chunk declares {head.stored} bytes; the limit is {MAX_CHUNK}")
        data, reason = expand(source.read(head.begin, end - head.begin), head.method, head.size)
        if reason is None and head.checksum and zlib.crc32(data) != head.checksum:
            reason = "a chunk's checksum does not match: some of its messages are wrong"
        if reason is not None:
            ledger.lost(reason, self.where)
        return data, end
