"""What every bag is made of: streams of messages, in a file whose declared lengths are never believed."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, BinaryIO, Literal, Protocol

from gpsim.errors import UsageError
from gpsim.limits import BYTES_A_MESSAGE, CHUNKS_BYTES, CHUNKS_GROWTH, EMPTY, MESSAGES, allowed, more
from gpsim.recordings.readers.damage import DamageError, Ledger
from gpsim.recordings.values import fault_of, one_line

DefinitionFormat = Literal["msg", "idl", "none"]
Message = tuple[int, int, bytes]
"""(stream id, receive time [ns since 1970], serialised message)."""
LATEST = 2**62
"""A receive time [ns] no message can have: in the year 2116."""
_WINDOW = 1 << 16  # bytes that are fetched at once: records are short and follow each other


class Source:
    """Bytes of a file or of a chunk; reading outside them is damage, never a short or a huge read."""

    def __init__(self, data: bytes | BinaryIO, size: int) -> None:
        self._data = data
        self._start, self._held = 0, b""
        self.size = size

    def read(self, offset: int, count: int) -> bytes:
        """Exactly `count` bytes."""
        if offset < 0 or count < 0 or offset + count > self.size:
            raise DamageError(f"the file ends at byte {self.size}, {count} bytes are declared at {offset}")
        if isinstance(self._data, bytes):
            return self._data[offset : offset + count]
        at = offset - self._start
        if not 0 <= at <= len(self._held) - count:
            self._data.seek(offset)
            self._start, self._held, at = offset, self._data.read(max(count, _WINDOW)), 0
        found = self._held[at : at + count]
        if len(found) != count:
            raise DamageError(f"{count} bytes are declared at {offset}, {len(found)} can be read")
        return found

    def windows(self, start: int, overlap: int) -> Iterator[tuple[int, bytes]]:
        """(offset, bytes) of consecutive pieces that overlap by `overlap` bytes: first 4 KiB, then up to 1 MiB."""
        length = 1 << 12
        while start < self.size:
            yield start, self.read(start, min(length + overlap, self.size - start))
            start += length
            length = min(4 * length, 1 << 20)


@dataclass(frozen=True)
class Stream:
    """One publisher of one topic (ROS 1: connection, mcap: channel, sqlite3: topic).

    count: messages the index announces, None without an index; start, end: first and last receive time [ns];
    type: in ROS 2 spelling, as geometry_msgs/msg/PoseStamped; digest: md5 of the definition (ROS 1), else "".
    fault: why it cannot be read, known before any message is looked at; it concerns nobody who wants other topics.
    """

    id: int
    topic: str
    type: str
    definition: str
    format: DefinitionFormat
    encoding: str
    digest: str = ""
    count: int | None = None
    start: int | None = None
    end: int | None = None
    fault: str = ""


def topic_name(raw: bytes | str) -> tuple[str, str]:
    """(a topic's name, why it is none): a name that cannot be shown in a line stands between quotes, with a fault."""
    try:
        name = raw.decode() if isinstance(raw, bytes) else raw
    except UnicodeDecodeError:
        return f"'{one_line(raw, 60)}'", "its name is no text"
    fault = fault_of(name)
    return (name, "") if not fault else (f"'{one_line(name, 60)}'", f"its name {fault}")


@dataclass
class Catalogue:
    """Streams by id and what is known of their messages.

    tallies: number, first and last receive time [ns]; counts: numbers that are told elsewhere, and hold; chunks: the
    streams in the chunk that begins at a byte; schemas: what streams refer to (MCAP); listing: whether the streams are
    what is looked for.
    """

    streams: dict[int, Stream] = field(default_factory=dict)
    tallies: dict[int, tuple[int, int, int]] = field(default_factory=dict)
    counts: dict[int, int] = field(default_factory=dict)
    chunks: dict[int, frozenset[int]] = field(default_factory=dict)
    schemas: dict[int, Any] = field(default_factory=dict)
    listing: bool = False

    def tally(self, stream: int, count: int, start: int, end: int) -> None:
        """Count more messages."""
        known = self.tallies.get(stream, (0, start, end))
        self.tallies[stream] = (known[0] + count, min(known[1], start), max(known[2], end))

    def add(self, stream: Stream) -> None:
        """Note a stream; the first description of it that can be used stays."""
        known = self.streams.get(stream.id)
        if known is None or (known.fault and not stream.fault):
            self.streams[stream.id] = stream

    def result(self) -> list[Stream]:
        """The streams with their counts and times."""
        found = []
        for stream in self.streams.values():
            count, start, end = self.tallies.get(stream.id, (0, None, None))
            found.append(replace(stream, count=self.counts.get(stream.id, count), start=start, end=end))
        return found


class Container(Protocol):
    """A bag file or folder.

    distro: the ROS 2 distribution it says it was recorded with, known once `streams` was asked for; size: of a file, in
    bytes.
    """

    distro: str | None
    size: int

    @property
    def where(self) -> str:
        """The place being read."""
        ...

    def streams(self, ledger: Ledger) -> Sequence[Stream]:
        """The streams, from the index where the file has a sound one, else from a walk through the file."""
        ...

    def messages(self, wanted: Collection[int], ledger: Ledger) -> Iterator[Message]:
        """The messages of the wanted streams in file order, one chunk in memory at a time."""
        ...


class Budget:
    """Of a file of `size` bytes. Every refusal is a UsageError that says how to allow more."""

    def __init__(self, path: Path, size: int) -> None:
        self._path, self._size = path, size
        self._bytes, self._most_bytes = 0, allowed(CHUNKS_BYTES + CHUNKS_GROWTH * size)
        self._records, self._most_records = 0, allowed(MESSAGES + size // BYTES_A_MESSAGE)
        self._empty, self._most_empty = 0, allowed(EMPTY)

    def chunk(self, count: int) -> None:
        """Note a chunk that makes `count` bytes."""
        self._bytes += count
        if self._bytes > self._most_bytes:
            self._refuse(f"expand to more than {self._most_bytes} bytes of messages")
        if not count:
            self.empty()

    def empty(self) -> None:
        """Note a chunk or a record in which there is nothing."""
        self._empty += 1
        if self._empty > self._most_empty:
            self._refuse(f"contain more than {self._most_empty} empty chunks and records")

    def record(self) -> None:
        """Note a record that is no message."""
        self._records += 1
        if self._records > self._most_records:
            self._refuse(f"make more than {self._most_records} records")

    def messages(self, found: Iterable[Message]) -> Iterator[Message]:
        """The messages of the walk."""
        for count, message in enumerate(found):
            if count >= self._most_records:
                self._refuse(f"make more than {self._most_records} messages")
            yield message

    def _refuse(self, what: str) -> None:
        raise UsageError(f"{self._path}: {self._size} bytes of file {what}; {more()}")
