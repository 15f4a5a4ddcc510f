"""ROS 1 bags, format 2.0 (wiki.ros.org/Bags/Format/2.0), walked record by record.

rosbags' own reader holds one Python object for every message of the file, trusts every declared length and cannot
open a bag whose index is damaged; this walk holds one chunk, checks lengths against the file, and finds its way again.
"""

from __future__ import annotations

import struct
from collections.abc import Callable, Collection, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from gpsim.recordings.readers.bag1_index import Catalogue, read_index
from gpsim.recordings.readers.bag1_records import (
    CHUNK,
    CONNECTION,
    MESSAGE,
    Record,
    Source,
    next_record,
    number,
    read_record,
    stream_of,
    text,
    time,
)
from gpsim.recordings.readers.container import Message, Stream
from gpsim.recordings.readers.damage import MAX_CHUNK, MAX_MESSAGE, DamageError, Ledger, regular_file
from gpsim.recordings.readers.decompress import expand

MAGIC = b"#ROSBAG V2.0\n"
# Message headers as the C++ recorder and most tools write them: conn, op, time, each with its length in front.
_HEADER = struct.Struct("<I I5sI I3sB I5sII I")
_FIXED = (38, 9, b"conn=", 4, b"op=", MESSAGE, 13, b"time=")


@dataclass
class Bag1:
    """One ROS 1 bag. `where` is the chunk being read."""

    path: Path
    where: str = "byte 0"

    def __post_init__(self) -> None:
        self.size = regular_file(self.path)

    def streams(self, ledger: Ledger) -> Sequence[Stream]:
        """From the index at the end of the file; without a sound one (salvage only), from a walk through it."""
        with self.path.open("rb") as file:
            source = Source(file, self.size)
            self._check_magic(source)
            try:
                return read_index(source, len(MAGIC))
            except DamageError as error:
                ledger.lost(error.reason, "index")
        found = Catalogue()
        for _ in self._walk(None, ledger, found):
            pass
        return found.result()

    def messages(self, wanted: Collection[int], ledger: Ledger) -> Iterator[Message]:
        """Messages of the wanted connections in file order."""
        return self._walk(frozenset(wanted), ledger, None)

    def _check_magic(self, source: Source) -> None:
        start = source.read(0, min(len(MAGIC), self.size))
        if start != MAGIC:
            raise not_this_kind(self.path, "a ROS 1 bag", "it does not begin with #ROSBAG V2.0")

    def _walk(self, wanted: Collection[int] | None, ledger: Ledger, found: Catalogue | None) -> Iterator[Message]:
        """Every chunk in file order. wanted None: yields nothing, fills `found`."""
        with self.path.open("rb") as file:
            source = Source(file, self.size)
            position: int | None = len(MAGIC)
            while position is not None and position < self.size:
                self.where = f"byte {position}"
                try:
                    record = read_record(source, position)
                    if record.op == CHUNK:
                        yield from self._messages(self._chunk(source, record, ledger), wanted, ledger, found)
                    elif record.op == CONNECTION and found is not None:
                        stream = stream_of(source, record)
                        found.streams.setdefault(stream.id, stream)
                    if record.end > self.size:
                        raise DamageError(f"the file ends at byte {self.size}, inside a record of {record.size} bytes")
                    position = record.end
                except DamageError as error:
                    ledger.lost(error.reason, self.where)
                    position = next_record(source, position + 1, CHUNK)

    def _chunk(self, source: Source, record: Record, ledger: Ledger) -> bytes:
        """A chunk's records, as much of them as can be had."""
        size = number(record.fields, b"size")
        method = text(record.fields, b"compression")
        end = record.end
        if end > self.size:
            ledger.lost(f"the file ends at byte {self.size}, inside a chunk of {record.size} bytes", self.where)
            end = min(next_record(source, record.data, CHUNK) or self.size, self.size)
        if end - record.data > MAX_CHUNK:
            raise DamageError(f"a chunk declares {record.size} bytes; the limit is {MAX_CHUNK}")
        data, reason = expand(source.read(record.data, end - record.data), method, size)
        if reason is not None:
            ledger.lost(reason, self.where)
        return data

    def _messages(
        self, chunk: bytes, wanted: Collection[int] | None, ledger: Ledger, found: Catalogue | None
    ) -> Iterator[Message]:
        position, end = 0, len(chunk)
        unpack, front = _HEADER.unpack_from, _HEADER.size
        while position < end:
            if position + front <= end:
                head = unpack(chunk, position)
                if (head[0], *head[1:3], *head[4:7], *head[7:9]) == _FIXED and position + front + head[11] <= end:
                    start = position + front
                    position = start + head[11]
                    stamp = head[9] * 1_000_000_000 + head[10]
                    if wanted is None:
                        assert found is not None
                        found.tally(head[3]).add(1, stamp, stamp)
                    elif head[3] in wanted:
                        yield head[3], stamp, chunk[start:position]
                    continue
            moved = yield from self._other(chunk, position, wanted, ledger, found)
            if moved is None:
                return
            position = moved

    def _other(
        self, chunk: bytes, position: int, wanted: Collection[int] | None, ledger: Ledger, found: Catalogue | None
    ) -> Iterator[Message]:
        raise NotImplementedError


def not_this_kind(path: Path, kind: str, why: str) -> Exception:
    """The error for a file whose name promises another kind."""
    from gpsim.errors import UsageError

    return UsageError(f"{path}: byte 0: not {kind} ({why}); name the file by its kind, or export the log again")


_ = (Callable, MAX_MESSAGE, time)
