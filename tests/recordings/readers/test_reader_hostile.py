"""Files that are not what their name says, or that are made to harm: one clear line, soon, in little memory."""

import bz2
import os
import struct

import numpy as np
import pytest
from bags import EPOCH, drive, write_bag
from mcap_writer import record, text
from mutations import refused

from gpsim.errors import UsageError
from gpsim.recordings.readers import KINDS as SUFFIXES
from gpsim.recordings.readers import open_log


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_what_is_no_log_at_all(tmp_path, suffix):
    empty, words, noise, folder = (
        tmp_path / f"{name}{suffix}" for name in ("empty", "words", "noise", "folder")
    )
    empty.touch()
    words.write_text("this is a letter, not a log")
    noise.write_bytes(np.random.default_rng(0).bytes(5000))
    folder.mkdir()
    assert "empty" in refused(empty)
    refused(noise)
    refused(folder)
    if suffix not in (".csv", ".tsv", ".txt"):
        refused(words)
    assert "does not exist" in refused(tmp_path / f"nowhere{suffix}")


@pytest.mark.parametrize("suffix", [".bag", ".db3", ".mcap", ".csv"])
def test_links_pipes_and_rights(tmp_path, suffix):
    dangling, loop, pipe, endless = (
        tmp_path / f"{name}{suffix}" for name in ("dangling", "loop", "pipe", "endless")
    )
    dangling.symlink_to(tmp_path / "nothing")
    loop.symlink_to(loop)
    os.mkfifo(pipe)
    endless.symlink_to("/dev/zero")
    for path in (dangling, loop, pipe, endless):
        refused(path)
    real = write_bag(tmp_path / "real.bag", "ros1", drive(0.2))
    (tmp_path / "link.bag").symlink_to(real)
    assert open_log(tmp_path / "link.bag").topics()


def ros1_bag(path, chunks, declared=None):
    """A ROS 1 bag of raw chunks (compression, declared size, bytes), without index."""

    def rec(fields, data, size=None):
        head = b"".join(
            struct.pack("<I", len(k) + 1 + len(v)) + k.encode() + b"=" + v for k, v in fields.items()
        )
        return (
            struct.pack("<I", len(head))
            + head
            + struct.pack("<I", len(data) if size is None else size)
            + data
        )

    number = struct.pack("<I", 0)
    out = b"#ROSBAG V2.0\n" + rec(
        {"op": b"\x03", "index_pos": bytes(8), "conn_count": number, "chunk_count": number}, b" " * 4027
    )
    for method, size, data in chunks:
        fields = {"compression": method.encode(), "op": b"\x05", "size": struct.pack("<I", size)}
        out += rec(fields, data, declared)
    path.write_bytes(out)
    return path


def test_a_chunk_that_swells_to_gigabytes(tmp_path):
    bomb = bz2.compress(bytes(32 << 20))
    for size in (300 << 20, 2**32 - 1, 4096):
        path = ros1_bag(tmp_path / f"bomb{size}.bag", [("bz2", size, bomb)])
        assert "index" in refused(path)
        assert open_log(path, salvage=True).topics() == ()


def test_lengths_of_gigabytes_in_a_small_file(tmp_path):
    path = ros1_bag(tmp_path / "long.bag", [("none", 2**32 - 1, b"abc")], declared=2**32 - 1)
    refused(path)
    (tmp_path / "head.bag").write_bytes(b"#ROSBAG V2.0\n" + b"\xff" * 64)
    assert "byte" in refused(tmp_path / "head.bag") or "index" in refused(tmp_path / "head.bag")
    (tmp_path / "long.mcap").write_bytes(b"\x89MCAP0\r\n" + struct.pack("<BQ", 1, 2**63) + b"x" * 50)
    refused(tmp_path / "long.mcap")


def mcap_with(path, *records):
    end = record(2, struct.pack("<QQI", 0, 0, 0)) + b"\x89MCAP0\r\n"
    path.write_bytes(b"\x89MCAP0\r\n" + record(1, text("ros2") + text("")) + b"".join(records) + end)
    return path


def test_an_encoding_that_is_not_read(tmp_path):
    schema = record(
        3, struct.pack("<H", 1) + text("pb.Type") + text("protobuf") + struct.pack("<I", 2) + b"\xff\xfe"
    )
    channel = record(4, struct.pack("<HH", 1, 1) + text("/p") + text("protobuf") + struct.pack("<I", 0))
    message = record(5, struct.pack("<HIQQ", 1, 0, EPOCH, EPOCH) + b"\x08\x01")
    path = mcap_with(tmp_path / "proto.mcap", schema, channel, message)
    [topic] = open_log(path).topics()
    assert (topic.count, topic.fields) == (1, ())
    with pytest.raises(UsageError, match="encoded as 'protobuf'"):
        open_log(path).series({"/p": ["x"]})
