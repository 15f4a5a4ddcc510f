"""MCAP files by the format's own library, with what rosbags' writer lacks: lz4, checksums, no chunks, no summary."""

import struct
from dataclasses import dataclass
from io import BytesIO

from mcap.writer import CompressionType, IndexType, Writer

MAGIC = b"\x89MCAP0\r\n"


@dataclass(frozen=True)
class Chunks:
    """size None: messages lie outside chunks. checked: every chunk and the summary have a checksum."""

    compression: str = "none"
    size: int | None = 4096
    summary: bool = True
    checked: bool = True


def text(value):
    return struct.pack("<I", len(value.encode())) + value.encode()


def record(op, body):
    return struct.pack("<BQ", op, len(body)) + body


def write_mcap(types, definitions, rows, options):
    """A whole file. types: topic to type; definitions: type to text; rows: (time [ns], topic, CDR bytes)."""
    out, told = BytesIO(), options.summary
    told_of = ("repeat_channels", "repeat_schemas", "use_statistics", "use_summary_offsets")
    writer = Writer(
        out,
        chunk_size=options.size or 0,
        compression=CompressionType[options.compression.upper()],
        index_types=IndexType.ALL if told else IndexType.NONE,
        use_chunking=options.size is not None,
        enable_crcs=options.checked,
        **dict.fromkeys(told_of, told),
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
