"""Logs of a few kilobytes that stand for gigabytes or for hours: one line, soon, in little memory."""

import sqlite3
import struct
import zlib

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
import scipy.io
from attacking import gpsim as gpsim  # a fixture, and where bags are
from backports import zstd
from bags import EPOCH, drive, write_bag
from mcap_writer import MAGIC, Chunks, record, text, write_mcap
from mutations import read_all

from gpsim import limits
from gpsim.errors import UsageError
from gpsim.recordings import open_log
from gpsim.recordings.files import read_frame
from gpsim.recordings.readers import container

SCHEMA = record(
    3, struct.pack("<H", 1) + text("std_msgs/msg/Float32") + text("ros2msg") + text("float32 data\n")
)
CHANNEL = record(4, struct.pack("<HH", 1, 1) + text("/p") + text("cdr") + struct.pack("<I", 0))
MESSAGE = record(5, struct.pack("<HIQQ", 1, 0, 1, 1) + b"\0\1\0\0" + struct.pack("<f", 1.0))
EVERY = (False, True)  # strictly and for salvage


def mcap(path, *records):
    end = record(2, struct.pack("<QQI", 0, 0, 0)) + MAGIC
    path.write_bytes(MAGIC + record(1, text("ros2") + text("")) + b"".join(records) + end)
    return path


def chunk(raw):
    packed = zstd.compress(raw)
    head = struct.pack("<QQQI", 0, 1, len(raw), 0) + text("zstd")
    return record(6, head + struct.pack("<Q", len(packed)) + packed)


def refused(path, salvage=False):
    with pytest.raises(UsageError) as caught:
        read_all(path, salvage)
    assert "\n" not in str(caught.value)
    return str(caught.value)


@pytest.fixture
def small(monkeypatch):
    """Limits a hundredth of what they are, so that the tests are short."""
    monkeypatch.setattr(container, "CHUNKS_BYTES", limits.CHUNKS_BYTES // 100)
    monkeypatch.setattr(container, "MESSAGES", limits.MESSAGES // 100)
    monkeypatch.setattr(container, "EMPTY", limits.EMPTY // 100)


@pytest.mark.parametrize("salvage", EVERY)
@pytest.mark.parametrize(
    ("records", "said"),
    [
        ([chunk(bytes(1 << 20))] * 4, "expand to more than"),
        ([chunk(b"")] * 200, "empty chunks and records"),
        ([record(0x0C, b"")] * 200, "empty chunks and records"),
        ([SCHEMA, CHANNEL, chunk(MESSAGE * 40_000)], "messages; if it is valid"),
        ([chunk(SCHEMA + CHANNEL * 40_000)], "records; if it is valid"),
        ([chunk(record(0x0C, b"") * 40_000)], "records; if it is valid"),
    ],
    ids=["zeros", "empty chunks", "empty records", "messages", "channels", "records"],
)
def test_an_mcap_that_makes_more_than_it_is_worth(tmp_path, small, monkeypatch, records, said, salvage):
    if records[0] == chunk(bytes(1 << 20)):
        monkeypatch.setattr(container, "CHUNKS_BYTES", 1 << 20)
    told = refused(mcap(tmp_path / "bomb.mcap", *records), salvage)
    assert said in told
    assert "GPSIM_LIMITS=" in told


def test_a_sound_bag_is_within_small_limits_even(tmp_path, small):
    for kind, name in (("mcap-zstd", "a.mcap"), ("ros1-bz2", "a.bag"), ("sqlite3-message", "folder")):
        log = open_log(write_bag(tmp_path / name, kind, drive(1.0)))
        assert log.series({"/pose": ["pose.position.x"]})["/pose"].read == 50


def test_a_user_grants_more(tmp_path, small, monkeypatch):
    bomb = mcap(tmp_path / "big.mcap", SCHEMA, CHANNEL, chunk(MESSAGE * 20_000))
    assert "messages; if it is valid" in refused(bomb)
    monkeypatch.setenv(limits.VARIABLE, "4")
    assert open_log(bomb).series({"/p": ["data"]})["/p"].read == 20_000


def test_messages_that_swell_one_by_one(tmp_path, monkeypatch):
    folder = write_bag(tmp_path / "bag", "sqlite3-message", drive(0.5))
    [storage] = folder.glob("*.db3")
    with sqlite3.connect(storage) as base:
        base.execute("UPDATE messages SET data = ?", (zstd.compress(bytes(1 << 20)),))
    monkeypatch.setattr(container, "CHUNKS_BYTES", 1 << 20)
    assert "bytes of messages" in refused(folder)
    assert container.MAX_MESSAGE == 64 << 20


def test_a_storage_file_that_swells(tmp_path, monkeypatch):
    folder = write_bag(tmp_path / "bag", "sqlite3-file", drive(0.2))
    [storage] = folder.glob("*.zstd")
    storage.write_bytes(zstd.compress(bytes(8 << 20)))
    monkeypatch.setattr(container, "CHUNKS_BYTES", 1 << 20)
    told = refused(folder)
    assert "makes more than" in told
    assert "GPSIM_LIMITS=" in told


@pytest.mark.parametrize("stamp", [-(2**63), -1, 2**63 - 1])
def test_stamps_that_no_clock_shows(tmp_path, gpsim, stamp):
    folder = write_bag(tmp_path / "bag", "sqlite3", drive(1.0))
    [storage] = folder.glob("*.db3")
    with sqlite3.connect(storage) as base:
        base.execute("UPDATE messages SET timestamp = ? WHERE id % 7 = 0", (stamp,))
    said = gpsim("import", "--inspect", storage)
    assert said.code == 2
    assert f"a message's time is '{stamp}'" in said.err
    assert gpsim("import", "--inspect", "--salvage", storage).code == 0


@pytest.mark.parametrize("stamp", [2**64 - 1, 2**62])
def test_stamps_of_an_index_that_no_clock_shows(tmp_path, stamp):
    rows = [(EPOCH, "/p", MESSAGE[-8:]), (stamp, "/q", MESSAGE[-8:])]
    kind = "std_msgs/msg/Float32"
    made = write_mcap({"/p": kind, "/q": kind}, {kind: "float32 data\n"}, rows, Chunks())
    (tmp_path / "late.mcap").write_bytes(made)
    assert f"a message's time is {stamp} ns" in refused(tmp_path / "late.mcap")
    found = open_log(tmp_path / "late.mcap", salvage=True).series({"/p": ["data"], "/q": ["data"]})
    assert [series.read for series in found.values()] == [1, 0]


def test_more_topics_than_any_robot_has(tmp_path):
    channels = [
        record(4, struct.pack("<HH", i + 1, 1) + text(f"/p{i}") + text("cdr") + struct.pack("<I", 0))
        for i in range(2001)
    ]
    assert "it has 2001 topics, the limit is 2000" in refused(mcap(tmp_path / "many.mcap", SCHEMA, *channels))


def constant(path, rows, columns=4):
    table = pa.table({name: np.zeros(rows) for name in ["t", *(f"c{i}" for i in range(columns - 1))]})
    pq.write_table(table, path, compression="zstd", row_group_size=1_000_000)
    return path


def test_a_parquet_that_always_says_the_same(tmp_path, gpsim):
    """16 columns of 4 million zeros: 512 MB in memory, a few kilobytes on the disk."""
    path = constant(tmp_path / "recording.parquet", 4_000_000, 16)
    assert path.stat().st_size < 1 << 20
    assert "its values take 512000000 bytes or more" in refused(path)
    with pytest.raises(UsageError, match="its values take 512000000 bytes or more"):
        read_frame(path)
    said = gpsim("diagnose", path, "--simulator", "cartpole", "--out", tmp_path / "out")
    assert said.code == 2
    assert "GPSIM_LIMITS=" in said.err


def test_a_parquet_of_lists_counts_what_is_in_them(tmp_path):
    lists = pa.ListArray.from_arrays(
        pa.array([0, 40_000_000], pa.int32()), pa.array(np.zeros(40_000_000, np.int8))
    )
    pq.write_table(pa.table({"t": [0.0], "x": lists}), tmp_path / "lists.parquet")
    assert "its values take 3200000" in refused(tmp_path / "lists.parquet")


def test_a_long_text_that_is_there_many_times_is_held_once(tmp_path):
    """It would take 2 GB otherwise, where each row has its own."""
    words = pa.DictionaryArray.from_arrays(
        pa.array(np.arange(20_000, dtype=np.int32) % 2), pa.array(["a" * 100_000, "b"])
    )
    plain = pa.table({"episode": words, "t": np.arange(20_000.0)})
    pq.write_table(plain, tmp_path / "words.parquet")
    frame = read_frame(tmp_path / "words.parquet")
    assert frame["episode"].iloc[0] is frame["episode"].iloc[2]
    series = open_log(tmp_path / "words.parquet").series({"words": ["episode", "t"]})["words"]
    assert series.fields["episode"][:3].tolist() == [0.0, 1.0, 0.0]


def test_more_columns_than_anything_measures(tmp_path, gpsim):
    names = [f"{i:x}" for i in range(10_001)]
    (tmp_path / "wide.csv").write_text(",".join(names) + "\n" + ",".join(["0"] * len(names)) + "\n")
    assert "it has 10001 columns, the limit is 10000" in refused(tmp_path / "wide.csv")
    (tmp_path / "wider.csv").write_text("a," * 1_000_000 + "\n")
    assert "longer than 262144 bytes" in refused(tmp_path / "wider.csv")
    with pytest.raises(UsageError, match="longer than 262144 bytes"):
        read_frame(tmp_path / "wider.csv")


def test_a_line_without_an_end(tmp_path):
    with (tmp_path / "line.csv").open("wb") as file:
        file.write(b"t,x\n0,")
        file.seek(1 << 31)
        file.write(b"1")
    assert "longer than 262144 bytes" in refused(tmp_path / "line.csv")


def matlab(path, body):
    packed = zlib.compress(body)
    head = b"MATLAB 5.0 MAT-file".ljust(124) + b"\x00\x01IM"
    path.write_bytes(head + struct.pack("<II", 15, len(packed)) + packed)
    return path


def element(kind, data):
    return struct.pack("<II", kind, len(data)) + data + bytes(-len(data) % 8)


def variable(kind, dims, *rest):
    parts = (
        element(6, struct.pack("<II", kind, 0))
        + element(5, struct.pack(f"<{len(dims)}i", *dims))
        + element(1, b"x")
    )
    return element(14, parts + b"".join(rest))


@pytest.mark.parametrize(
    "body",
    [
        variable(6, (20_000, 20_000), element(2, b"\1")),
        variable(1, (1, 2_000_000_000)),
        variable(1, (1, 30_000_000)),
        variable(2, (1, 2_000_000_000), element(5, struct.pack("<i", 32)), element(1, b"")),
        variable(1, (1, 1), variable(6, (1 << 16, 1 << 16))),
    ],
    ids=["numbers", "cells", "fewer cells", "structs without fields", "in a cell"],
)
def test_a_matlab_file_that_declares_more_than_it_holds(tmp_path, body):
    said = refused(matlab(tmp_path / "a.mat", body))
    assert "more than 268435456 bytes" in said or "cells or structs" in said


def test_matlab_files_as_people_save_them_are_read(tmp_path):
    content = {
        "log": {"t": np.arange(50.0), "run": {"x": np.ones(50)}},
        "names": np.array(["a", "bc"], dtype=object),
        "empty": np.zeros((0, 3)),
        "small": np.arange(50, dtype=np.int8),
    }
    for squeeze in (False, True):
        scipy.io.savemat(tmp_path / "a.mat", content, do_compression=squeeze)
        [topic, *_] = open_log(tmp_path / "a.mat").topics()
        assert set(topic.fields) >= {"log.t", "log.run.x", "small"}
