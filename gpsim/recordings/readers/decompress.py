"""Decompression that never makes more bytes than were declared (a small chunk can stand for gigabytes)."""

from __future__ import annotations

import bz2
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import lz4.frame

from gpsim.limits import CHUNKS_BYTES, CHUNKS_GROWTH, allowed, more
from gpsim.recordings.readers.damage import MAX_CHUNK, DamageError, one_line

if sys.version_info >= (3, 14):
    from compression import zstd
else:
    from backports import zstd

_MAKERS: dict[str, Callable[[], Any]] = {
    "bz2": bz2.BZ2Decompressor,
    "lz4": lz4.frame.LZ4FrameDecompressor,
    "zstd": zstd.ZstdDecompressor,
}
_STEP = 1 << 20


def expand(data: bytes, method: str, size: int) -> tuple[bytes, str | None]:
    """Decompress a chunk that declares `size` bytes: (what could be had, why not all of it or None).

    DamageError when the declared size or the method is not acceptable.
    """
    if size > MAX_CHUNK:
        raise DamageError(f"a chunk declares {size} bytes; the limit is {MAX_CHUNK}")
    if method in ("", "none"):
        return (
            (data, None) if len(data) == size else (data, f"chunk holds {len(data)} bytes, declared {size}")
        )
    if method not in _MAKERS:
        raise DamageError(f"chunk compression {one_line(method, 40)!r} is not known")
    parts, got, reason = _decompress(data, method, size)
    if reason is None and got != size:
        reason = (
            f"{method} chunk makes {'more' if got > size else 'only'} {min(got, size)} bytes, declared {size}"
        )
    return b"".join(parts)[:size], reason


def _decompress(data: bytes, method: str, size: int) -> tuple[list[bytes], int, str | None]:
    """Pieces of at most 1 MiB until the end, a fault, or one byte more than `size`."""
    parts: list[bytes] = []
    got = 0
    machine = _MAKERS[method]()
    try:
        feed = data
        while got <= size and not machine.eof:
            part = machine.decompress(feed, max_length=min(_STEP, size + 1 - got))
            feed = b""
            parts.append(part)
            got += len(part)
            if not part and machine.needs_input:
                return parts, got, f"{method} data ends early"
    except Exception as error:  # OSError (bz2), RuntimeError (lz4), ZstdError, EOFError, MemoryError
        return parts, got, f"{method} data is damaged: {one_line(error, 80)}"
    return parts, got, None


def expand_message(data: bytes, limit: int) -> bytes:
    """One zstd-compressed message of at most `limit` bytes."""
    parts, got, reason = _decompress(data, "zstd", limit)
    if got > limit:
        reason = f"a compressed message makes more than {limit} bytes"
    if reason is not None:
        raise DamageError(reason)
    return b"".join(parts)


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
