"""Bytes that are never read outside their bounds, whatever length a file declares."""

from __future__ import annotations

from collections.abc import Iterator
from typing import BinaryIO

from gpsim.recordings.readers.damage import DamageError

_FIRST = 1 << 12
_SEARCH = 1 << 20
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

    def find(self, pattern: bytes, start: int) -> int:
        """Offset of the next `pattern` at or after `start`; -1 without one."""
        for offset, window in self.windows(start, len(pattern)):
            found = window.find(pattern)
            if found >= 0:
                return offset + found
        return -1

    def windows(self, start: int, overlap: int) -> Iterator[tuple[int, bytes]]:
        """(offset, bytes) of consecutive pieces that overlap by `overlap` bytes: first 4 KiB, then up to 1 MiB."""
        length = _FIRST
        while start < self.size:
            yield start, self.read(start, min(length + overlap, self.size - start))
            start += length
            length = min(4 * length, _SEARCH)
