import pytest
from by_hand import HandLog

from gpsim.errors import UsageError
from gpsim.recordings.raw import find_logs


def opener(path):
    return HandLog({})


def test_files_come_sorted_with_numbers_in_numeric_order(tmp_path):
    for number in (132, 33, 1056, 0):
        (tmp_path / f"Experiment-{number}.csv").write_text("t\n")
    (tmp_path / "notes.md").write_text("no log")
    names = [log.name for log in find_logs([tmp_path], "files", "*", opener)]
    assert names == [f"Experiment-{n}.csv" for n in (0, 33, 132, 1056)]


def test_a_folder_is_a_log_of_topics(tmp_path):
    for name in ("b/pose.csv", "b/cmd.csv", "a/pose.csv"):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text("t\n")
    logs = find_logs([tmp_path], "folder", "*", opener)
    assert [log.name for log in logs] == ["a", "b"]
    assert set(logs[1].log.files) == {"pose", "cmd"}


def test_two_files_of_one_topic_are_refused_until_one_is_chosen(tmp_path):
    for name in ("pose.csv", "pose.parquet", "cmd.csv"):
        (tmp_path / name).write_text("t\n")
    with pytest.raises(
        UsageError, match=r"pose\.csv and pose\.parquet would both be the topic 'pose'.*files="
    ):
        find_logs([tmp_path], "folder", "*", opener)
    (log,) = find_logs([tmp_path], "folder", "*.csv", opener)
    assert set(log.log.files) == {"pose", "cmd"}


def test_a_ros2_folder_is_one_log(tmp_path):
    bag = tmp_path / "drive"
    bag.mkdir()
    (bag / "metadata.yaml").write_text("")
    (bag / "drive_0.db3").write_text("")
    assert [log.name for log in find_logs([tmp_path], "files", "*", opener)] == ["drive"]
    assert [log.name for log in find_logs([bag], "files", "*", opener)] == ["drive"]


def test_the_same_name_from_two_places_is_told_apart(tmp_path):
    for folder in ("a", "b"):
        (tmp_path / folder).mkdir()
        (tmp_path / folder / "log.csv").write_text("t\n")
    names = [log.name for log in find_logs([tmp_path / "a", tmp_path / "b"], "files", "*", opener)]
    assert names == ["1: log.csv", "2: log.csv"]


def test_missing_and_empty_places_are_refused(tmp_path):
    with pytest.raises(UsageError, match="does not exist"):
        find_logs([tmp_path / "none"], "files", "*", opener)
    with pytest.raises(UsageError, match=r"no log files named \*.bag"):
        find_logs([tmp_path], "files", "*.bag", opener)
