"""One topic that cannot be read is listed with its reason; only who asks for it is refused."""

import sqlite3
from io import BytesIO

import numpy as np
import pytest
from bags import EPOCH, KINDS, Messages, called, drive, write_bag
from mcap.reader import make_reader

from gpsim.errors import UsageError
from gpsim.recordings import open_log
from gpsim.stages.import_log import read_logs
from gpsim.stages.raw_logs import inspect_source

DESCRIPTIONS = "/mocap_node/optitrack_config/parameter_descriptions"
STRANGE = "/bad"


def describing(*names):
    parameters = [{"name": name, "level": 3 + i} for i, name in enumerate(("command_port", "data_port"))]
    groups = [{"name": name, "parameters": parameters, "id": i} for i, name in enumerate(names)]
    return Messages("dynamic_reconfigure/msg/ConfigDescription", [(EPOCH + 200_000_000, {"groups": groups})])


@pytest.mark.parametrize("kind", KINDS)
def test_named_lists_inside_of_named_lists_are_told_by_their_numbers(tmp_path, kind):
    """A dynamic_reconfigure topic used to end the inspection of a whole bag of an F1TENTH car."""
    bag = write_bag(tmp_path / called(kind), kind, {**drive(1.0), DESCRIPTIONS: describing("Default")})
    found = inspect_source(bag)
    assert not found.faults
    assert "/pose" in found.paces
    fields = next(topic for topic in found.topics if topic.name == DESCRIPTIONS).fields
    assert "groups[name=Default].parameters.1.level" in fields
    series = open_log(bag).series({DESCRIPTIONS: fields})[DESCRIPTIONS]
    assert series.fields["groups[name=Default].parameters.1.level"].tolist() == [4.0]


def spoiled(path, old, new):
    data = path.read_bytes()
    assert old in data
    assert len(old) == len(new)
    path.write_bytes(data.replace(old, new))
    return path


def small(folder, kind, rows=40):
    messages = [(EPOCH + i * 10**7, {"data": float(i)}) for i in range(rows)]
    other = [(when, {"axes": [0.5], "buttons": [1]}) for when, _ in messages]
    topics = {
        "/good": Messages("std_msgs/msg/Float64", messages),
        STRANGE: Messages("sensor_msgs/msg/Joy", other),
    }
    return write_bag(folder / called(kind), kind, topics, chunk=200)


@pytest.mark.parametrize(
    ("kind", "old", "new", "why"),
    [
        ("ros1", b"topic=/bad", b"topic=/b\nd", "its name holds a line break"),
        ("ros1", b"topic=/bad", b"topic=/b\xffd", "its name is no text"),
        ("ros1", b"type=sensor_msgs/Joy", b"type=sensor_msgs.Joy", "is not a message type"),
        ("ros1", b"float32[] axes", b"float32[] ax\xffs", "is not text"),
        ("ros1", b"float32[] axes", b"gloat32[] axes", "lacks"),
        ("mcap-unchecked", b"/bad", b"/b\nd", "its name holds a line break"),
        ("mcap-unchecked", b"float32[] axes", b"float32[] ax\xffs", "is not text"),
        ("mcap-unchecked", b"sensor_msgs/msg/Joy", b"sensor_msgs msg Joy", "is not a message type name"),
    ],
)
def test_a_topic_that_cannot_be_laid_out_harms_no_other(tmp_path, kind, old, new, why):
    bag = spoiled(small(tmp_path, kind), old, new)
    log = open_log(bag)
    good, bad = sorted(log.topics(), key=lambda topic: topic.name != "/good")
    assert (good.fault, good.count) == ("", 40)
    assert why in bad.fault
    assert log.series({"/good": ["data"]})["/good"].fields["data"].tolist() == [float(i) for i in range(40)]
    found = inspect_source(bag)
    assert list(found.paces) == ["/good"]
    assert list(found.faults) == [bad.name]
    with pytest.raises(UsageError, match=r"copy the file again") as caught:
        log.series({bad.name: ["axes.0"]})
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("what", ["type", "serialization_format", "name"])
def test_a_row_of_sqlite_that_describes_no_topic_harms_no_other(tmp_path, what):
    topics = {"/good": Messages("std_msgs/msg/Float64", [(EPOCH + i, {"data": 1.0}) for i in range(3)])}
    bag = write_bag(tmp_path / "a", "sqlite3", {**topics, STRANGE: topics["/good"]})
    (file,) = bag.glob("*.db3")
    with sqlite3.connect(file) as base:
        base.execute(f"UPDATE topics SET {what} = x'ff0a' WHERE name = '{STRANGE}'")
    for path in (bag, file):
        found = inspect_source(path)
        assert "/good" in found.paces
        assert "/good" not in found.faults
        assert found.faults
        assert open_log(path).series({"/good": ["data"]})["/good"].read == 3


@pytest.mark.parametrize("kind", ["ros1-lz4", "mcap-lz4"])
def test_a_damaged_chunk_concerns_the_topics_that_the_index_finds_in_it(tmp_path, kind):
    """A chunk with messages of one topic only is cut out of the middle of the file."""
    early = [(EPOCH + i * 10**7, {"data": float(i)}) for i in range(400)]
    late = [(EPOCH + 10**10 + i * 10**7, {"data": 2.0 * i}) for i in range(400)]
    topics = {
        "/early": Messages("std_msgs/msg/Float64", early),
        "/late": Messages("std_msgs/msg/Float64", late),
    }
    bag = write_bag(tmp_path / called(kind), kind, topics, chunk=2000)
    data = bytearray(bag.read_bytes())
    start = 3 * len(data) // 4  # in a chunk behind the messages of /early
    if kind.startswith("mcap"):
        start = make_reader(BytesIO(data)).get_summary().chunk_indexes[-3].chunk_start_offset + 100
    data[start : start + 40] = bytes(b ^ 0x5A for b in data[start : start + 40])
    bag.write_bytes(data)
    found = inspect_source(bag)
    assert list(found.paces) == ["/early"]
    assert list(found.faults) == ["/late"]
    assert "--salvage" in found.faults["/late"]
    assert open_log(bag).series({"/early": ["data"]})["/early"].read == 400
    assert 0 < open_log(bag, salvage=True).series({"/late": ["data"]})["/late"].read < 400


def test_a_broken_table_among_the_topics_of_a_folder(tmp_path):
    rows = "".join(f"{0.1 * i:.1f},{i}\n" for i in range(20))
    (tmp_path / "pose.csv").write_text(f"t,x\n{rows}")
    (tmp_path / "cmd.csv").write_text(f"t,u\n{rows}")
    (tmp_path / "other.csv").write_text("t,t\n1,2\n")
    (tmp_path / "m.yaml").write_text(
        "system: a\nlayout: folder\nrate: source\ntime: {field: t}\nstate: {x: {topic: pose, field: x, unit: m}}\n"
        "action: {u: {topic: cmd, field: u, unit: N}}\n"
    )
    recording, _, _ = read_logs([tmp_path], str(tmp_path / "m.yaml"), ["files=*.csv"])
    assert recording.transition_count > 10
    with pytest.raises(UsageError, match=r"other\.csv: several columns are called 't'"):
        read_logs([tmp_path], str(tmp_path / "m.yaml"), ["state.x.topic=other"])


FRAMES = """
system: frames
rate: 50
state:
  x: {topic: /tf, field: "transforms[child_frame_id=base_link].transform.translation.x", unit: m}
  turned: {topic: /tf, field: "transforms[child_frame_id=wheel].transform.translation.x", unit: rad}
action:
  v_cmd: {topic: /cmd_vel, field: linear.x, unit: m/s}
"""


@pytest.mark.parametrize("kind", ["ros1", "mcap"])
def test_two_frames_of_one_topic_are_two_tracks(tmp_path, kind):
    bag = write_bag(tmp_path / called(kind), kind, drive(seconds=4.0))
    (tmp_path / "mine.yaml").write_text(FRAMES)
    recording, report, _ = read_logs([bag], str(tmp_path / "mine.yaml"))
    (episode,) = recording.episodes
    x, turned = episode.states.T
    # message i holds the wheel at i, and every second one the base at cos(0.02 i)
    assert x == pytest.approx(np.cos(0.02 * turned), abs=1e-3)  # stamps jitter by 0.5 ms
    assert turned[-1] > 190.0
    counts = {count.part: count for count in report.topics if count.topic == "/tf"}
    assert {part: count.read for part, count in counts.items()} == {
        "transforms[child_frame_id=base_link]": 100,
        "transforms[child_frame_id=wheel]": 200,
    }
    for count in report.topics:
        assert count.read == count.kept + sum(count.dropped.values())
        assert "value missing" not in count.dropped
