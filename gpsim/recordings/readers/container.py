"""What every bag is made of: streams of messages, in a file whose declared lengths are never believed; what is lost.

A small chunk can stand for gigabytes: decompression never makes more bytes than were declared.
"""

from __future__ import annotations

import bz2
import sys
from abc import ABC, abstractmethod
from collections import Counter
from collections.abc import Collection, Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, BinaryIO, Literal

import lz4.frame

from gpsim.errors import UsageError
from gpsim.limits import BYTES_A_MESSAGE, CHUNKS_BYTES, CHUNKS_GROWTH, EMPTY, MESSAGES, TOPICS, allowed, more
from gpsim.recordings.values import fault_of, one_line

if sys.version_info >= (3, 14):
    from compression import zstd
else:
    from backports import zstd

# Largest piece of a file that is ever held in memory at once [bytes]: a chunk after decompression, a message, a
# definition. Recorders write chunks of about 1 MB; a file that declares more than this is damaged or hostile.
MAX_CHUNK = 256 << 20
MAX_MESSAGE = 64 << 20
MAX_DEFINITION = 256 << 10
LATEST = 2**62
"""A receive time [ns] no message can have: in the year 2116."""
_WINDOW = 1 << 16  # bytes that are fetched at once: records are short and follow each other
_STEP = 1 << 20
_MAKERS: dict[str, Any] = {
    "bz2": bz2.BZ2Decompressor, "lz4": lz4.frame.LZ4FrameDecompressor, "zstd": zstd.ZstdDecompressor,
}  # fmt: skip
DefinitionFormat = Literal["msg", "idl", "none"]
Message = tuple[int, int, bytes]
"""(stream id, receive time [ns since 1970], serialised message)."""


class DamageError(Exception):
    """A piece of a file cannot be read: `reason` says why. Never leaves this package."""

    def __init__(self, reason: str) -> None:
        super().__init__(reason)
        self.reason = reason


class Ledger:
    """Counts what was lost of a file, or (salvage False) raises UsageError with place, reason and remedy at once."""

    def __init__(self, path: Path, *, salvage: bool) -> None:
        self.path, self.salvage = path, salvage
        self.file: Counter[str] = Counter()
        self.topics: dict[str, Counter[str]] = {}
        self._readings: list[Ledger] = []

    def lost(self, reason: str, where: str, topic: str | None = None, count: int = 1) -> None:
        """Record that `count` messages of `topic` (None: a piece of the file) are lost."""
        if not self.salvage:
            place = f"{where}, topic {topic}" if topic else where
            raise UsageError(
                f"{self.path}: {place}: {one_line(reason)}; "
                "copy the file again, or import what is readable with --salvage"
            )
        kept = self.file if topic is None else self.topics.setdefault(topic, Counter())
        kept[one_line(reason)] += count

    def same(self) -> Ledger:
        """A fresh ledger of the same kind, for one reading of the file."""
        self._readings.append(Ledger(self.path, salvage=self.salvage))
        return self._readings[-1]

    def silent(self) -> Ledger:
        """A ledger for a second look at the same file: never refuses, and what it counts is not kept."""
        return Ledger(self.path, salvage=True)

    def pieces(self) -> dict[str, int]:
        """Pieces of the file that were lost, by reason; a piece that several readings miss is lost once."""
        found: Counter[str] = Counter()
        for reading in self._readings:
            found |= reading.file
        return dict(self.file + found)

    def of(self, topic: str) -> dict[str, int]:
        """Messages of `topic` that were lost, by reason."""
        return dict(self.topics.get(topic, Counter()))


def refusal(path: Path, where: str, reason: str) -> UsageError:
    """The error for damage that nothing can be read behind."""
    return UsageError(f"{path}: {where}: {one_line(reason)}; copy the file again, or make a new recording")


def wrong_kind(path: Path, kind: str, why: str) -> UsageError:
    """The error for a file that is not what its name promises."""
    said = f"{path}: byte 0: not {kind} ({why})"
    return UsageError(f"{said}; use the usual file extension, or export the log again")


def regular_file(path: Path) -> int:
    """Size [bytes] of an ordinary, readable, non-empty file; UsageError for anything else."""
    try:
        if not path.is_file():
            there = "is not an ordinary file" if path.exists() else "does not exist"
            what = "is a folder" if path.is_dir() else there
            raise UsageError(f"{path}: {what}; name a log file or a ROS 2 bag folder")
        size = path.stat().st_size
        path.open("rb").close()
    except (OSError, ValueError) as error:
        said = f"{one_line(path)}: cannot be opened: {one_line(error)}"
        raise UsageError(f"{said}; check the path and its rights") from error
    if size == 0:
        raise UsageError(f"{path}: the file is empty; copy it again")
    return size


def expand(data: bytes, method: str, size: int) -> tuple[bytes, str | None]:
    """Decompress a chunk that declares `size` bytes: (what could be had, why not all of it or None).

    DamageError when the declared size or the method is not acceptable.
    """
    if size > MAX_CHUNK:
        raise DamageError(f"a chunk declares {size} bytes; the limit is {MAX_CHUNK}")
    if method in ("", "none"):
        return data, None if len(data) == size else f"chunk holds {len(data)} bytes, declared {size}"
    if method not in _MAKERS:
        raise DamageError(f"chunk compression {one_line(method, 40)!r} is not known")
    made, reason = _decompress(data, method, size)
    if reason is None and len(made) != size:
        much = f"{'more' if len(made) > size else 'only'} {min(len(made), size)}"
        reason = f"{method} chunk makes {much} bytes, declared {size}"
    return made[:size], reason


def _decompress(data: bytes, method: str, size: int) -> tuple[bytes, str | None]:
    """(what is made until the end, a fault, or one byte more than `size`, in steps of 1 MiB; the fault)."""
    parts: list[bytes] = []
    got, feed, reason = 0, data, None
    machine = _MAKERS[method]()
    try:
        while got <= size and not machine.eof:
            part = machine.decompress(feed, max_length=min(_STEP, size + 1 - got))
            feed = b""
            parts.append(part)
            got += len(part)
            if not part and machine.needs_input:
                reason = f"{method} data ends early"
                break
    except Exception as error:  # OSError (bz2), RuntimeError (lz4), ZstdError, EOFError, MemoryError
        reason = f"{method} data is damaged: {one_line(error, 80)}"
    return b"".join(parts), reason


def expand_message(data: bytes) -> bytes:
    """One zstd-compressed message."""
    made, reason = _decompress(data, "zstd", MAX_MESSAGE)
    if len(made) > MAX_MESSAGE:
        reason = f"a compressed message expands to more than {MAX_MESSAGE} bytes"
    if reason is not None:
        raise DamageError(reason)
    return made


def expand_file(source: Path, target: Path) -> str | None:
    """Decompress a zstd file, piece by piece, into as many bytes as chunks may make; why not all of it, or None."""
    limit = allowed(CHUNKS_BYTES + CHUNKS_GROWTH * source.stat().st_size)
    written, inside = 0, True
    try:
        with source.open("rb") as packed, target.open("wb") as out:
            machine = zstd.ZstdDecompressor()
            while feed := packed.read(_STEP):
                inside = True
                while feed or not machine.needs_input:
                    piece = machine.decompress(feed, max_length=_STEP)
                    feed = b""
                    written += len(piece)
                    if written > limit:
                        return f"{source.name} makes more than {limit} bytes ({more()})"
                    out.write(piece)
                    if machine.eof:  # several frames may follow one another
                        feed, machine = machine.unused_data, zstd.ZstdDecompressor()
                        inside = bool(feed)
    except (zstd.ZstdError, EOFError, OSError, MemoryError) as error:
        return f"{source.name} cannot be decompressed behind byte {written}: {one_line(error, 80)}"
    return f"{source.name} ends early" if inside else None


class Source:
    """Bytes of a file or of a chunk; reading outside them is damage, never a short or a huge read."""

    def __init__(self, data: bytes | BinaryIO, size: int) -> None:
        self._data, self.size = data, size
        self._start, self._held = 0, b""

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


@dataclass(frozen=True)
class Stream:
    """One publisher of one topic (ROS 1: connection, mcap: channel, sqlite3: topic).

    count: messages the index announces, None without an index; start, end: first and last receive time [ns];
    type: in ROS 2 spelling, as geometry_msgs/msg/PoseStamped; digest: md5 of the definition (ROS 1), else "".
    fault: why it cannot be read, known before any message is looked at; it concerns nobody who wants other topics.
    """

    id: int
    topic: str
    type: str = "unknown"
    definition: str = ""
    format: DefinitionFormat = "none"
    encoding: str = ""
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


def check_topics(path: Path, count: int) -> None:
    """Refuse a bag of more topics than any robot has."""
    if count > allowed(TOPICS):
        told = f"it has {count} topics, the limit is {allowed(TOPICS)}; {more(count, TOPICS)}"
        raise UsageError(f"{path}: {told}")


@dataclass
class Catalogue:
    """Streams by id and what is known of their messages.

    tallies: number, first and last receive time [ns]; counts: numbers that are told elsewhere, and hold; chunks: the
    streams in the chunk that begins at a byte; schemas: what streams refer to (MCAP).
    """

    streams: dict[int, Stream] = field(default_factory=dict)
    tallies: dict[int, tuple[int, int, int]] = field(default_factory=dict)
    counts: dict[int, int] = field(default_factory=dict)
    chunks: dict[int, frozenset[int]] = field(default_factory=dict)
    schemas: dict[int, Any] = field(default_factory=dict)

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


class Container(ABC):
    """A bag file, or a folder of them.

    where: the place being read; size: of a file [bytes]; distro: the ROS 2 distribution it says it was recorded with,
    known once `streams` was asked for.
    """

    def __init__(self, path: Path) -> None:
        self.path, self.size = path, regular_file(path)
        self.where = "byte 0"
        self.distro: str | None = None

    @abstractmethod
    def streams(self, ledger: Ledger) -> Sequence[Stream]:
        """The streams, from the index where the file has a sound one, else from a walk through the file."""

    @abstractmethod
    def messages(self, wanted: Collection[int], ledger: Ledger) -> Iterator[Message]:
        """The messages of the wanted streams in file order, one chunk in memory at a time."""


class Budget:
    """Of a file of `size` bytes. Every refusal is a UsageError that says how to allow more."""

    def __init__(self, path: Path, size: int) -> None:
        self._path, self._size = path, size
        self._most_bytes = allowed(CHUNKS_BYTES + CHUNKS_GROWTH * size)
        self._most_records = allowed(MESSAGES + size // BYTES_A_MESSAGE)
        self._most_empty = allowed(EMPTY)
        self._bytes = self._records = self._empty = 0

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
