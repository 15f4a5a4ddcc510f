"""ROS 1 bags, format 2.0 (wiki.ros.org/Bags/Format/2.0), walked record by record.

rosbags' own reader holds one Python object for every message of the file, trusts every declared length and cannot
open a bag whose index is damaged; this walk holds one chunk, checks lengths against the file, and finds its way again.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from gpsim.recordings.readers.bag1_index import messages_in, read_index
from gpsim.recordings.readers.bag1_records import (
    CHUNK,
    CONNECTION,
    Record,
    next_record,
    number,
    read_record,
    stream_of,
    text,
)
from gpsim.recordings.readers.catalogue import Catalogue
from gpsim.recordings.readers.damage import MAX_CHUNK, DamageError, Ledger, expand, regular_file, wrong_kind
from gpsim.recordings.readers.source import Budget, Message, Source, Stream

MAGIC = b"#ROSBAG V2.0\n"
OnConnection = Callable[[Stream], None] | None


@dataclass
class Bag1:
    """One ROS 1 bag. `where` is the chunk being read."""

    path: Path
    where: str = "byte 0"
    distro: str | None = None
    _held: dict[int, frozenset[int]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self.size = regular_file(self.path)

    def streams(self, ledger: Ledger) -> Sequence[Stream]:
        """From the index at the end of the file; without a sound one (salvage only), from a walk through it."""
        with self.path.open("rb") as file:
            source = Source(file, self.size)
            if source.read(0, min(len(MAGIC), self.size)) != MAGIC:
                raise wrong_kind(self.path, "a ROS 1 bag", "it does not begin with #ROSBAG V2.0")
            try:
                indexed = read_index(source, len(MAGIC))
                self._held = indexed.chunks
                streams = indexed.result()
                faults = [stream.fault for stream in streams if stream.fault]
                if not (faults and ledger.salvage):
                    return streams
                ledger.lost(faults[0], "index")  # the chunks hold the same descriptions once more
            except DamageError as error:
                ledger.lost(error.reason, "index")
        quiet = ledger.silent()
        found = Catalogue()
        for connection, stamp, _ in self._walk(quiet, found.add, None):
            found.tally(connection).add(1, stamp, stamp)
        return found.result()

    def messages(self, wanted: Collection[int], ledger: Ledger) -> Iterator[Message]:
        """Messages of the wanted connections in file order."""
        chosen = frozenset(wanted)
        return (message for message in self._walk(ledger, None, chosen) if message[0] in chosen)

    def _walk(
        self, ledger: Ledger, on_connection: OnConnection, wanted: frozenset[int] | None
    ) -> Iterator[Message]:
        """Every message in file order."""
        budget = Budget(self.path, self.size)
        chunks = self._chunks(ledger, on_connection, wanted, budget)
        return budget.messages(
            (connection, stamp, chunk[start:end])
            for chunk, own in chunks
            for connection, stamp, start, end in messages_in(chunk, own, self.where, on_connection, budget)
        )

    def _chunks(
        self, ledger: Ledger, on_connection: OnConnection, wanted: frozenset[int] | None, budget: Budget
    ) -> Iterator[tuple[bytes, Ledger]]:
        """Every chunk in file order, decompressed, with the ledger that its damage belongs in.

        Damage of a chunk that holds nothing wanted, as the index says, is nobody's loss.
        """
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
                    if record.op == CHUNK:
                        chunk, position = self._chunk(source, record, own)
                        budget.chunk(len(chunk))
                        yield chunk, own
                        continue
                    if record.op == CONNECTION and on_connection is not None:
                        on_connection(stream_of(source, record))
                    if record.end > self.size:
                        raise DamageError(
                            f"the file ends at byte {self.size}, inside a record of {record.size} bytes"
                        )
                    position = record.end
                except DamageError as error:
                    own.lost(error.reason, self.where)
                    position = next_record(source, position + 1, CHUNK)

    def _chunk(self, source: Source, record: Record, ledger: Ledger) -> tuple[bytes, int]:
        """(a chunk's records, as much of them as can be had; where the walk goes on)."""
        size = number(record.fields, b"size")
        method = text(record.fields, b"compression")
        end = record.end
        if end > self.size:
            ledger.lost(
                f"the file ends at byte {self.size}, inside a chunk of {record.size} bytes", self.where
            )
            end = next_record(source, record.data, CHUNK) or self.size
        if end - record.data > MAX_CHUNK:
            raise DamageError(f"a chunk declares {record.size} bytes; the limit is {MAX_CHUNK}")
        data, reason = expand(source.read(record.data, end - record.data), method, size)
        if reason is not None:
            ledger.lost(reason, self.where)
        return data, end
