"""ROS 1 bags and MCAP files, walked record by record with one chunk in memory: sound ones, damaged and cut off.

The libraries' readers do not serve, measured on three million small messages: rosbags' reader of ROS 1 holds an object
for every message (170 bytes each), mcap's runs out of 300 MB, and rosbags' of MCAP expands whatever a chunk turns out
to hold. All sort by time, trust every declared length, and open no file that was cut off.
"""

from __future__ import annotations

import re
import zlib
from abc import ABC, abstractmethod
from collections.abc import Callable, Collection, Iterable, Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

from gpsim.recordings.readers.damage import (
    MAX_CHUNK,
    MAX_MESSAGE,
    DamageError,
    Ledger,
    expand,
    regular_file,
    wrong_kind,
)  # fmt: skip
from gpsim.recordings.readers.source import Budget, Catalogue, Message, Source, Stream


class Record(NamedTuple):
    """Its kind, where it begins and where its data lie, which may be outside the file; fields: of a header (ROS 1)."""

    op: int
    start: int
    data: int
    size: int
    fields: dict[bytes, bytes]

    @property
    def end(self) -> int:
        """Where the next one begins."""
        return self.data + self.size


class Head(NamedTuple):
    """A chunk's: where its data begin, how many bytes they are there, how compressed, how many they make, checksum."""

    begin: int
    stored: int
    method: str
    size: int
    checksum: int = 0


def data_of(source: Source, record: Record) -> bytes:
    """A record's data (not a chunk's: those have a limit of their own)."""
    if record.size > MAX_MESSAGE:
        raise DamageError(f"a record declares {record.size} bytes")
    return source.read(record.data, record.size)


def search(
    source: Source, start: int, mark: re.Pattern[bytes], most: int, find: Callable[[int], int | None]
) -> int | None:
    """What `find` makes of the first place of `mark` where it finds anything; `most` places are looked at."""
    tries = 0
    for offset, window in source.windows(start, 9):
        for match in mark.finditer(window):
            tries += 1
            if tries > most:
                return None
            if (found := find(offset + match.start())) is not None:
                return found
    return None


class Walk(ABC):
    """One file. `where` is the record being read."""

    magic: bytes
    kind: tuple[str, str]  # what it is, and why a file is none that begins otherwise
    index_name: str
    chunk_op: int
    last_op = 0  # of the record behind which no messages come
    unsearched: tuple[str, ...] = ()  # chunks so compressed hold what would be taken for a way out of them

    def __init__(self, path: Path) -> None:
        self.path = path
        self.size = regular_file(path)
        self.where = "byte 0"
        self.distro: str | None = None
        self._held: dict[int, frozenset[int]] = {}

    @abstractmethod
    def index(self, source: Source) -> Catalogue | None:
        """What the file's own index says; None without one, DamageError where it is not sound."""

    @abstractmethod
    def record(self, source: Source, position: int) -> Record:
        """The record at a place."""

    @abstractmethod
    def next_record(
        self, source: Source, start: int, found: Catalogue, *, inside: bool = False
    ) -> int | None:
        """Where the next believable record begins, at or after `start`; inside: of a chunk, a message."""

    @abstractmethod
    def head(self, source: Source, record: Record) -> Head:
        """A chunk's head."""

    @abstractmethod
    def in_chunk(self, chunk: bytes, found: Catalogue, ledger: Ledger, budget: Budget) -> Iterator[Message]:
        """The messages of a chunk; what cannot be understood is told to the ledger and skipped."""

    @abstractmethod
    def outside(self, source: Source, record: Record, found: Catalogue, budget: Budget) -> Iterable[Message]:
        """The messages of a record that is no chunk."""

    def streams(self, ledger: Ledger) -> Sequence[Stream]:
        """From the index; without a sound one (damage: salvage only), from a walk through the file."""
        with self.path.open("rb") as file:
            source = Source(file, self.size)
            if source.read(0, min(len(self.magic), self.size)) != self.magic:
                raise wrong_kind(self.path, *self.kind)
            try:
                indexed = self.index(source)
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
            found.tally(stream, 1, stamp, stamp)
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
                    record = self.record(source, position)
                    if record.op == self.last_op:
                        return
                    if record.op == self.chunk_op:
                        chunk, position = self._chunk(source, record, found, own)
                        budget.chunk(len(chunk))
                        yield from self.in_chunk(chunk, found, own, budget)
                        continue
                    if record.end > self.size:
                        ends = f"the file ends at byte {self.size}, inside a record of {record.size} bytes"
                        raise DamageError(ends)
                    yield from self.outside(source, record, found, budget)
                    position = record.end
                except DamageError as error:
                    own.lost(error.reason, self.where)
                    position = self.next_record(source, position + 1, found)

    def _chunk(self, source: Source, record: Record, found: Catalogue, ledger: Ledger) -> tuple[bytes, int]:
        """(a chunk's records, as much of them as can be had; where the walk goes on)."""
        head, end = self.head(source, record), record.end
        if end > self.size:
            ends = f"the file ends at byte {self.size}, inside a chunk of {head.stored} bytes"
            ledger.lost(ends, self.where)
            behind = None if head.method in self.unsearched else self.next_record(source, head.begin, found)
            end = behind or self.size
        if end - head.begin > MAX_CHUNK:
            raise DamageError(f"a chunk declares {head.stored} bytes; the limit is {MAX_CHUNK}")
        data, reason = expand(source.read(head.begin, end - head.begin), head.method, head.size)
        if reason is None and head.checksum and zlib.crc32(data) != head.checksum:
            reason = "a chunk's checksum does not match: some of its messages are wrong"
        if reason is not None:
            ledger.lost(reason, self.where)
        return data, end
