"""ROS 2 bag folders and databases that lie about what they are."""

import sqlite3

import pytest
import yaml
from bags import EPOCH, Messages, drive, write_bag
from mutations import refused

from gpsim.recordings.readers import open_log


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
