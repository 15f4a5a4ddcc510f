"""The readers on real recordings; skipped where those are absent (data/README.md says how to get them)."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from gpsim.recordings.inspection import statistics
from gpsim.recordings.readers import open_log
from gpsim.recordings.soundness import find_silent_damage


@pytest.fixture(scope="module")
def bags(real: Path) -> Path:
    return real / "dart_jetracer" / "bags"


def test_a_ros1_bag_and_its_ros2_twin_are_the_same(bags: Path) -> None:
    """Values, header stamps and receive times, all to the last bit: the conversion kept nanoseconds."""
    one, two = open_log(bags / "4_sept_random_driving_slow.bag"), open_log(bags / "slow_ros2_sqlite3")
    assert one.epoch_ns == two.epoch_ns
    first, second = ({t.name: t for t in log.topics()} for log in (one, two))
    assert first.keys() == second.keys()
    wanted = {name: [f for f in topic.fields if "header.seq" not in f] for name, topic in first.items()}
    ones, twos = one.series(wanted), two.series(wanted)
    for name in wanted:
        a, b = ones[name], twos[name]
        assert (a.type, a.read) == (b.type, b.read)
        assert (first[name].count, first[name].start, first[name].end) == (
            second[name].count,
            second[name].start,
            second[name].end,
        )
        np.testing.assert_array_equal(a.receive, b.receive)
        assert (a.header is None) == (b.header is None)
        if a.header is not None and b.header is not None:
            np.testing.assert_array_equal(a.header, b.header)
        for field in wanted[name]:
            np.testing.assert_array_equal(a.fields[field], b.fields[field])


def test_motion_capture_came_at_100_hz(bags: Path) -> None:
    log = open_log(bags / "4_sept_random_driving_slow.bag")
    fields = [
        f"pose.pose.{part}" for part in ("position.x", "position.y", *(f"orientation.{a}" for a in "xyzw"))
    ]
    series = log.series({"/vicon/jetracer1": fields})["/vicon/jetracer1"]
    assert statistics(series.receive if series.header is None else series.header).rate == pytest.approx(
        100.0, rel=0.01
    )
    assert (series.read, series.dropped) == (6320, {})
    assert find_silent_damage(series) == ()


def test_transforms_repeat_the_poses(bags: Path) -> None:
    """The driver sends every pose twice, on its own topic and as a transform: an oracle for the selection."""
    path = "transforms[child_frame_id=jetracer1].transform.translation.x"
    log = open_log(bags / "4_sept_random_driving_slow.bag")
    series = log.series({"/tf": [path], "/vicon/jetracer1": ["pose.pose.position.x"]})
    tf, pose = series["/tf"], series["/vicon/jetracer1"]
    np.testing.assert_array_equal(tf.fields[path], pose.fields["pose.pose.position.x"])
    assert tf.header is not None
    assert pose.header is not None
    np.testing.assert_allclose(tf.header, pose.header, atol=1e-3)


def test_the_slide_is_a_table_of_24841_rows(real: Path) -> None:
    log = open_log(real / "emps" / "DATA_EMPS.mat")
    [topic] = log.topics()
    assert (topic.name, topic.count, set(topic.fields)) == ("DATA_EMPS", 24841, {"t", "qm", "qg", "vir"})
    t = log.series({"DATA_EMPS": ["t"]})["DATA_EMPS"].fields["t"]
    np.testing.assert_allclose(np.diff(t), 0.001, atol=1e-7)


def test_every_table_opens_whole(real: Path) -> None:
    paths = sorted(real.rglob("*.csv"))
    assert len(paths) > 50
    for path in paths:
        log = open_log(path)
        [topic] = log.topics()
        series = log.series({topic.name: topic.fields})[topic.name]
        assert series.read == topic.count > 0
        assert not series.dropped
