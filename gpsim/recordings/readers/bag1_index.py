"""The index of a ROS 1 bag: connections and chunk infos at its end, message times behind every chunk."""

from __future__ import annotations

import struct

import numpy as np

from gpsim.recordings.readers.bag1_records import (
    BAG_HEADER,
    CHUNK_INFO,
    CONNECTION,
    INDEX,
    Record,
    number,
    read_data,
    read_record,
    stream_of,
    time,
)
from gpsim.recordings.readers.catalogue import Catalogue
from gpsim.recordings.readers.damage import DamageError
from gpsim.recordings.readers.source import Source

_PAIR = struct.Struct("<II")
_TIMES = np.dtype([("seconds", "<u4"), ("nanoseconds", "<u4"), ("offset", "<u4")])


def read_index(source: Source, start: int) -> Catalogue:
    """Streams with counts and time ranges; `start` is the bag header's offset. DamageError where it is not sound."""
    head = read_record(source, start)
    if head.op != BAG_HEADER:
        raise DamageError("the bag header is missing")
    position = number(head.fields, b"index_pos", 8)
    chunks = number(head.fields, b"chunk_count")
    if position == 0:
        raise DamageError("the bag was never closed, so it has no index (rosbag reindex would make one)")
    if position > source.size:
        raise DamageError(f"the index should be at byte {position}, the file ends at {source.size}")
    if head.fields.get(b"encryptor"):
        raise DamageError("the bag is encrypted")
    found = Catalogue()
    for _ in range(number(head.fields, b"conn_count")):
        record = _expect(source, position, CONNECTION)
        stream = stream_of(source, record)
        found.streams[stream.id] = stream
        position = record.end
    for _ in range(chunks):
        record = _expect(source, position, CHUNK_INFO)
        _read_chunk_info(source, record, found)
        position = record.end
    unknown = sorted(set(found.tallies) - set(found.streams))
    if unknown:
        raise DamageError(f"the index counts messages of connection {unknown[0]}, which it does not list")
    return found


def _expect(source: Source, position: int, op: int) -> Record:
    record = read_record(source, position)
    if record.op != op:
        raise DamageError(
            f"the index holds a record of kind {record.op} where {op} belongs, at byte {position}"
        )
    return record


def _read_chunk_info(source: Source, record: Record, found: Catalogue) -> None:
    count = number(record.fields, b"count")
    data = read_data(source, record)
    if len(data) != 8 * count:
        raise DamageError(f"a chunk info at byte {record.start} declares {count} connections")
    counts: dict[int, int] = {}
    for connection, messages in _PAIR.iter_unpack(data):
        counts[connection] = counts.get(connection, 0) + messages
    ranges = _message_times(source, number(record.fields, b"chunk_pos", 8), count)
    whole = (time(record.fields, b"start_time"), time(record.fields, b"end_time")) if count else (0, 0)
    found.chunks[number(record.fields, b"chunk_pos", 8)] = frozenset(counts)
    for connection, messages in counts.items():
        if messages:
            found.tally(connection).add(messages, *ranges.get(connection, whole))


def _message_times(source: Source, chunk: int, count: int) -> dict[int, tuple[int, int]]:
    """First and last receive time [ns] of each connection in a chunk; empty where the records are not sound."""
    ranges: dict[int, tuple[int, int]] = {}
    try:
        position = read_record(source, chunk).end
        for _ in range(count):
            record = _expect(source, position, INDEX)
            data = np.frombuffer(
                read_data(source, record)[: 12 * number(record.fields, b"count")], dtype=_TIMES
            )
            stamps = data["seconds"].astype(np.int64) * 10**9 + data["nanoseconds"]
            if len(stamps):
                ranges[number(record.fields, b"conn")] = (int(stamps.min()), int(stamps.max()))
            position = record.end
    except (DamageError, ValueError):
        return {}
    return ranges
