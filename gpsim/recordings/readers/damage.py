"""What is lost of a file, and decompression that never makes more bytes than were declared.

(A small chunk can stand for gigabytes.)
"""

from __future__ import annotations

import bz2
import sys
from collections import Counter
from pathlib import Path
from typing import Any

import lz4.frame

from gpsim.errors import UsageError
from gpsim.limits import CHUNKS_BYTES, CHUNKS_GROWTH, allowed, more
from gpsim.recordings.values import one_line as one_line  # the readers' messages are made here

if sys.version_info >= (3, 14):
    from compression import zstd
else:
    from backports import zstd

# Largest piece of a file that is ever held in memory at once [bytes]: a chunk after decompression, a message, a
# definition. Recorders write chunks of about 1 MB; a file that declares more than this is damaged or hostile.
MAX_CHUNK = 256 << 20
MAX_MESSAGE = 64 << 20
MAX_DEFINITION = 256 << 10
MAX_PLACES = 10_000  # damaged places that salvage walks around
_STEP = 1 << 20
_MAKERS: dict[str, Any] = {
    "bz2": bz2.BZ2Decompressor, "lz4": lz4.frame.LZ4FrameDecompressor, "zstd": zstd.ZstdDecompressor,
}  # fmt: skip


class DamageError(Exception):
    """A piece of a file cannot be read: `reason` says why. Never leaves this package."""

    def __init__(self, reason: str) -> None:
        super().__init__(reason)
        self.reason = reason


class Ledger:
    """Counts what was lost, or refuses at the first loss.

    salvage: False raises UsageError(file, where, reason, remedy) at the first call of `lost`; True counts by reason.
    """

    def __init__(self, path: Path, *, salvage: bool) -> None:
        self.path = path
        self.salvage = salvage
        self.file: Counter[str] = Counter()
        self.topics: dict[str, Counter[str]] = {}
        self._readings: list[Ledger] = []
        self._places = 0

    def lost(self, reason: str, where: str, topic: str | None = None, count: int = 1) -> None:
        """Record that `count` messages of `topic` (None: a piece of the file) are lost."""
        if not self.salvage:
            place = f"{where}, topic {topic}" if topic else where
            raise UsageError(
                f"{self.path}: {place}: {one_line(reason)}; "
                "copy the file again, or import what is readable with --salvage"
            )
        self._places += 1
        kept = self.file if topic is None else self.topics.setdefault(topic, Counter())
        kept[one_line(reason)] += count

    @property
    def exhausted(self) -> bool:
        """Whether the file is damaged in so many places that the search for more of it is to end."""
        return self._places > MAX_PLACES

    def same(self) -> Ledger:
        """A fresh ledger of the same kind, for one reading of the file."""
        fresh = Ledger(self.path, salvage=self.salvage)
        self._readings.append(fresh)
        return fresh

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


def expand_message(data: bytes, limit: int) -> bytes:
    """One zstd-compressed message of at most `limit` bytes."""
    made, reason = _decompress(data, "zstd", limit)
    if len(made) > limit:
        reason = f"a compressed message expands to more than {limit} bytes"
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
