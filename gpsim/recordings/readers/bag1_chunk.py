"""The records inside a ROS 1 chunk: messages and the connections they belong to."""

from __future__ import annotations

import struct
from collections.abc import Callable, Iterator

from gpsim.recordings.readers.bag1_records import (
    CONNECTION,
    MESSAGE,
    next_record,
    number,
    read_record,
    stream_of,
    time,
)
from gpsim.recordings.readers.container import Stream
from gpsim.recordings.readers.damage import DamageError, Ledger
from gpsim.recordings.readers.source import Source

# A message header as the C++ recorder and rosbags write it: conn, op, time, each with its length in front.
_FAST = struct.Struct("<I I5sI I3sB I5sII I")
_CONSTANT = (38, 9, b"conn=", 4, b"op=", MESSAGE, 13, b"time=")

Place = tuple[int, int, int, int]
"""(connection, receive time [ns], first byte, byte behind the last) of a message in its chunk."""


def messages_in(
    chunk: bytes, ledger: Ledger, where: str, on_connection: Callable[[Stream], None] | None
) -> Iterator[Place]:
    """Every message of a chunk; what cannot be understood is told to the ledger and skipped."""
    position: int | None = 0
    source = Source(chunk, len(chunk))
    unpack, front, end = _FAST.unpack_from, _FAST.size, len(chunk)
    while position is not None and position < end:
        if position + front <= end:
            a, b, c, connection, d, e, f, g, h, seconds, nanoseconds, size = unpack(chunk, position)
            start = position + front
            if (a, b, c, d, e, f, g, h) == _CONSTANT and start + size <= end:
                position = start + size
                yield connection, seconds * 1_000_000_000 + nanoseconds, start, position
                continue
        try:
            record = read_record(source, position)
            if record.end > end:
                raise DamageError(f"a record reaches {record.end - end} bytes beyond its chunk")
            if record.op == MESSAGE:
                yield number(record.fields, b"conn"), time(record.fields), record.data, record.end
            elif record.op == CONNECTION:
                if on_connection is not None:
                    on_connection(stream_of(source, record))
            else:
                raise DamageError(f"a record of kind {record.op} lies inside a chunk")
            position = record.end
        except DamageError as error:
            ledger.lost(error.reason, f"{where}, byte {position} of the chunk")
            position = next_record(source, position + 1, MESSAGE)
