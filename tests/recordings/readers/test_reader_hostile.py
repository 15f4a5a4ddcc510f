"""Files that are not what their name says, or that are made to harm: one clear line, soon, in little memory."""

import bz2
import sqlite3
import struct

import numpy as np
import pytest
import yaml
from bags import EPOCH, Messages, drive, write_bag
from mcap_writer import Chunks, record, text, write_mcap
from mutations import Outcomes, deadline, refused, watch

from gpsim.errors import UsageError
from gpsim.recordings import open_log
from gpsim.recordings.readers import KINDS as SUFFIXES


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


def with_definition(path, name, definition, data=bytes(64)):
    rows = [(EPOCH + i, "/x", b"\x00\x01\x00\x00" + data) for i in range(3)]
    path.write_bytes(write_mcap({"/x": name}, {name: definition}, rows, Chunks()))
    return path


SEPARATOR = "=" * 80
NESTED = "\n".join(
    [
        f"a/T1[1000] x\n{SEPARATOR}",
        *(f"MSG: a/T{i}\na/T{i + 1}[1000] x\n{SEPARATOR}" for i in range(1, 9)),
        "MSG: a/T9\nuint8 y",
    ]
)
DEEP = "\n".join(
    [
        f"a/T1 x\n{SEPARATOR}",
        *(f"MSG: a/T{i}\na/T{i + 1} x\n{SEPARATOR}" for i in range(1, 200)),
        "MSG: a/T200\nuint8 y",
    ]
)


@pytest.mark.parametrize(
    ("definition", "says"),
    [
        ("string[900000000] x", "expands to"),
        (NESTED, "expands to"),
        (DEEP, "nested"),
        ("a/X x", "contains itself"),
        (f"a/E[] x\n{SEPARATOR}\nMSG: a/E\n", "too many fields for its bytes"),
        ("uint8 x\nuint16 x\n", "conflicting"),
        ("float64 x\n" * 60_000, "bytes long|longer than"),
        ("uint8[ x", "cannot be parsed"),
        ("b/Unknown x", "lacks b/msg/Unknown"),
        ("string x\nuint8 y", "not a a/msg/X"),
    ],
)
def test_definitions_made_to_harm(tmp_path, definition, says):
    path = with_definition(tmp_path / "x.mcap", "a/msg/X", definition, b"\xff" * 64)
    with deadline(20.0):
        try:
            [topic] = open_log(path).topics()
            field = (*topic.fields, "x")[0]
            with pytest.raises(UsageError, match=says):
                open_log(path).series({"/x": [field]})
        except UsageError as error:
            assert says.split("|")[1] in str(error)  # the file may be refused as a whole
    outcomes = Outcomes()
    watch(path, "definition", outcomes)
    assert not outcomes.faults


def test_a_definition_cannot_run_code(tmp_path):
    ran = tmp_path / "ran"
    code = f"a/msg/X:\n  import pathlib; pathlib.Path({str(ran)!r}).touch()\nclass b/msg/Y"
    for name in (code, "a/msg/X'''", "__import__('os')/msg/X"):
        path = with_definition(tmp_path / "x.mcap", name, "uint8 x")
        outcomes = Outcomes()
        watch(path, "code", outcomes)
        assert not outcomes.faults
    assert not ran.exists()


def test_definitions_that_take_long_to_parse(tmp_path):
    for blank in ("\n" * 200_000, " # x\n" * 50_000, "\t\n" * 100_000):
        path = with_definition(tmp_path / "x.mcap", "a/msg/X", blank + "uint8 y", b"\x07")
        with deadline(5.0):
            assert open_log(path).series({"/x": ["y"]})["/x"].fields["y"].tolist() == [7.0] * 3


def metadata(folder, change):
    path = write_bag(
        folder / "bag", "sqlite3", {"/u": Messages("std_msgs/msg/Float32", [(EPOCH, {"data": 1.0})])}
    )
    table = yaml.safe_load((path / "metadata.yaml").read_text())
    change(table["rosbag2_bagfile_information"])
    (path / "metadata.yaml").write_text(yaml.safe_dump(table))
    return path


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (lambda t: t.update(relative_file_paths=["../../etc/passwd"]), "outside the bag's folder"),
        (lambda t: t.update(relative_file_paths=["/etc/passwd"]), "outside the bag's folder"),
        (lambda t: t.update(relative_file_paths=["other.db3"]), "does not exist"),
        (lambda t: t.update(relative_file_paths="bag.db3"), "relative_file_paths"),
        (lambda t: t.pop("relative_file_paths"), "relative_file_paths"),
        (lambda t: t.pop("topics_with_message_count"), "topics_with_message_count"),
        (lambda t: t.update(topics_with_message_count=[3]), "topics_with_message_count"),
        (lambda t: t.update(version=99), "version is 99"),
        (lambda t: t.update(compression_mode="file", compression_format="gzip"), "compression file in gzip"),
        (
            lambda t: t["topics_with_message_count"][0].update(message_count=7),
            "announces 7 messages, 1 are there",
        ),
    ],
)
def test_metadata_that_lies(tmp_path, change, says):
    assert says in refused(metadata(tmp_path, change))


def test_metadata_that_swells(tmp_path):
    path = metadata(tmp_path, lambda _: None)
    lines = ["a0: &a0 [x, x, x, x, x, x, x, x, x, x]"]
    lines += [f"a{i}: &a{i} [{', '.join([f'*a{i - 1}'] * 10)}]" for i in range(1, 12)]
    (path / "metadata.yaml").write_text("\n".join(lines))
    refused(path)
    (path / "metadata.yaml").write_text("[" * 1000)
    refused(path)
    (path / "metadata.yaml").unlink()
    assert "no metadata.yaml" in refused(path)
    assert open_log(path, salvage=True).series({"/u": ["data"]})["/u"].fields["data"].tolist() == [1.0]


def test_a_database_that_is_no_bag_or_a_trap(tmp_path):
    views = (
        "CREATE VIEW topics AS SELECT 1 AS id, '/u' AS name, 'std_msgs/msg/Float32' AS type, 'cdr' AS serialization_format",
        "CREATE VIEW messages AS WITH RECURSIVE c(id) AS (SELECT 1 UNION ALL SELECT id + 1 FROM c) "
        "SELECT id, 1 AS topic_id, id AS timestamp, zeroblob(1000000) AS data FROM c",
    )
    for name, statements in (("other", ("CREATE TABLE x(y)",)), ("views", views)):
        base = sqlite3.connect(tmp_path / f"{name}.db3")
        for statement in statements:
            base.execute(statement)
        base.commit()
        base.close()
        assert "not a ROS 2 bag" in refused(tmp_path / f"{name}.db3")


def test_a_write_ahead_log_is_not_forgotten(tmp_path):
    path = write_bag(tmp_path / "bag", "sqlite3", drive(0.2))
    (path / "bag.db3-wal").write_bytes(b"x" * 100)
    assert "bag.db3-wal" in refused(path)


def test_an_unknown_ending_is_told_the_known_ones(tmp_path):
    (tmp_path / "log.xlsx").write_bytes(b"PK")
    assert ".mcap" in refused(tmp_path / "log.xlsx")
