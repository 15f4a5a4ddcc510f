import numpy as np
import pytest
from bags import EPOCH, KINDS, Messages, called, drive, serialise, typestore, write_bag
from rosbags.highlevel import AnyReader
from rosbags.rosbag1 import Writer

from gpsim.errors import UsageError
from gpsim.recordings import open_log

WANTED = {
    "/pose": ["pose.position.x", "pose.orientation.w"],
    "/pose_cov": ["pose.pose.position.y", "pose.covariance.35"],
    "/transform": ["transform.translation.x", "transform.rotation.z"],
    "/tf": ["transforms[child_frame_id=base_link].transform.translation.x"],
    "/odom": ["pose.pose.position.x", "twist.twist.linear.x"],
    "/cmd_vel": ["linear.x", "angular.z"],
    "/cmd_stamped": ["twist.angular.z"],
    "/ackermann": ["steering_angle", "speed"],
    "/ackermann_stamped": ["drive.speed"],
    "/throttle": ["data"],
    "/sensors": ["data.0", "data.2"],
    "/joy": ["axes.1", "buttons.2"],
    "/status": ["battery_voltage", "wheel_ticks.1", "from"],
}


def seconds(stamps):
    return np.array([stamp - EPOCH for stamp in stamps]) / 1e9


@pytest.fixture(scope="module", params=KINDS)
def bag(request, tmp_path_factory):
    name = called(request.param, "drive")
    return write_bag(tmp_path_factory.mktemp("bags") / name, request.param, drive(1.0))


def test_every_message_comes_back(bag):
    log, given = open_log(bag), drive(1.0)
    series = log.series(WANTED)
    assert log.epoch_ns == EPOCH
    for topic, messages in given.items():
        if topic != "/tf":
            np.testing.assert_array_equal(
                series[topic].receive, seconds([receive for receive, _ in messages.rows])
            )
        assert series[topic].read == len(messages.rows)
        assert not series[topic].dropped
    x = [values["pose"]["position"]["x"] for _, values in given["/pose"].rows]
    np.testing.assert_array_equal(series["/pose"].fields["pose.position.x"], x)
    speeds = [np.float32(values["drive"]["speed"]) for _, values in given["/ackermann_stamped"].rows]
    np.testing.assert_array_equal(series["/ackermann_stamped"].fields["drive.speed"], speeds)
    np.testing.assert_array_equal(series["/joy"].fields["buttons.2"], np.arange(len(speeds)))
    np.testing.assert_array_equal(series["/status"].fields["wheel_ticks.1"], -np.arange(len(speeds)))
    assert (series["/status"].fields["from"] == 1.0).all()
    assert (series["/pose_cov"].fields["pose.covariance.35"] == 35.0).all()


def test_topics_say_what_is_inside(bag):
    topics = {topic.name: topic for topic in open_log(bag).topics()}
    given = drive(1.0)
    assert list(topics) == sorted(given)
    for name, messages in given.items():
        stamps = seconds([receive for receive, _ in messages.rows])
        assert topics[name].type == messages.type
        assert (topics[name].count, topics[name].start, topics[name].end) == (
            len(stamps),
            stamps.min(),
            stamps.max(),
        )
    assert topics["/sensors"].fields[-3:] == ("data.0", "data.1", "data.2")
    assert "transforms[child_frame_id=wheel].transform.translation.x" in topics["/tf"].fields
    assert "pose.covariance.35" in topics["/pose_cov"].fields
    assert topics["/joy"].has_header
    assert not topics["/cmd_vel"].has_header


def test_rosbags_reads_the_same(bag):
    """An independent oracle: rosbags' own reader, message by message."""
    log = open_log(bag)
    with AnyReader([bag]) as reader:
        for topic, path in (("/odom", "pose.pose.position.x"), ("/cmd_vel", "angular.z")):
            wanted = [c for c in reader.connections if c.topic == topic]
            theirs = [(t, reader.deserialize(raw, c.msgtype)) for c, t, raw in reader.messages(wanted)]
            ours = log.series({topic: [path]})[topic]
            np.testing.assert_array_equal(ours.receive, seconds([t for t, _ in theirs]))
            get = [m.pose.pose.position.x if topic == "/odom" else m.angular.z for _, m in theirs]
            np.testing.assert_array_equal(ours.fields[path], get)


@pytest.mark.parametrize(
    ("topic", "path", "says"),
    [
        ("/nowhere", "x", "no topic '/nowhere'"),
        ("/pose", "pose.position.q", "no field 'q'; there are x, y, z"),
        ("/pose", "pose.position", "not a number"),
        ("/pose", "header.frame_id", "not a number"),
        ("/pose", "pose..x", "not a path"),
        ("/pose_cov", "pose.covariance.36", "outside an array of 36"),
        ("/tf", "transforms[child=base_link].transform.rotation.x", "no field 'child'"),
        ("/sensors", "data[a=b]", "only in an array of messages"),
    ],
)
def test_wrong_wishes_are_one_line_with_the_alternatives(tmp_path, topic, path, says):
    log = open_log(write_bag(tmp_path / "drive.bag", "ros1", drive(0.2)))
    with pytest.raises(UsageError) as caught:
        log.series({topic: [path]})
    assert says in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(("publishers", "at"), [(2, range(10)), (1, (5, 3, 9, 1))])
def test_publishers_of_one_topic_are_one_series_in_file_order(tmp_path, publishers, at):
    kind, stamps = "std_msgs/msg/Float32", [EPOCH + s for s in at]
    with Writer(tmp_path / "a.bag") as writer:
        several = [
            writer.add_connection("/u", kind, typestore=typestore(1), callerid=f"/node{i}")
            for i in range(publishers)
        ]
        for i, stamp in enumerate(stamps):
            writer.write(several[i % publishers], stamp, serialise(1, kind, {"data": float(i)}))
    series = open_log(tmp_path / "a.bag").series({"/u": ["data"]})["/u"]
    np.testing.assert_array_equal(series.fields["data"], np.arange(float(len(stamps))))
    np.testing.assert_array_equal(series.receive, seconds(stamps))


def test_an_old_sqlite3_bag_without_definitions_uses_a_distribution(tmp_path):
    import sqlite3

    bag = write_bag(
        tmp_path / "old", "sqlite3", {"/u": Messages("std_msgs/msg/Float32", [(EPOCH, {"data": 2.5})])}
    )
    base = sqlite3.connect(bag / "old.db3")
    base.execute("DELETE FROM message_definitions")
    base.commit()
    base.close()
    assert open_log(bag).series({"/u": ["data"]})["/u"].fields["data"].tolist() == [2.5]
