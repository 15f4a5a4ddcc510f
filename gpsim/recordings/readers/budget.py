"""What one walk through a file may make: bytes, messages, empty records. Refuses what no recorder writes."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from pathlib import Path

from gpsim.errors import UsageError
from gpsim.limits import BYTES_A_MESSAGE, CHUNKS_BYTES, CHUNKS_GROWTH, EMPTY, MESSAGES, allowed, more
from gpsim.recordings.readers.container import Message


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
            self._refuse(f"make more than {self._most_bytes} bytes of messages")
        if not count:
            self.empty()

    def empty(self) -> None:
        """Note a chunk or a record in which there is nothing."""
        self._empty += 1
        if self._empty > self._most_empty:
            self._refuse(f"hold more than {self._most_empty} chunks and records with nothing in them")

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
