"""MCAP files by the format's own library, with what rosbags' writer lacks: lz4, checksums, no chunks, no summary."""

from __future__ import annotations

import struct
from dataclasses import dataclass
from io import BytesIO

from mcap.writer import CompressionType, IndexType, Writer

MAGIC = b"\x89MCAP0\r\n"


@dataclass(frozen=True)
class Chunks:
    """size None: messages lie outside chunks. Checksums are of every chunk and of the summary."""

    compression: str = "none"
    size: int | None = 4096
    summary: bool = True


def text(value):
    raw = value.encode()
    return struct.pack("<I", len(raw)) + raw


def record(op, body):
    return struct.pack("<BQ", op, len(body)) + body


def write_mcap(
    types,
    definitions,
    rows,
    options,
):
    """A whole file. types: topic to type; definitions: type to text; rows: (time [ns], topic, CDR bytes)."""
    out, told = BytesIO(), options.summary
    writer = Writer(
        out,
        chunk_size=options.size or 0,
        compression=CompressionType[options.compression.upper()],
        index_types=IndexType.ALL if told else IndexType.NONE,
        repeat_channels=told,
        repeat_schemas=told,
        use_chunking=options.size is not None,
        use_statistics=told,
        use_summary_offsets=told,
    )
    writer.start("ros2", "gpsim tests")
    schemas = {
        name: writer.register_schema(name, "ros2msg", definitions[name].encode())
        for name in dict.fromkeys(types.values())
    }
    channels = {topic: writer.register_channel(topic, "cdr", schemas[name]) for topic, name in types.items()}
    for stamp, topic, data in rows:
        writer.add_message(channels[topic], stamp, data, stamp)
    writer.finish()
    return out.getvalue()
