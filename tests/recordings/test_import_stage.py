from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from by_hand import cartpole_table

from gpsim.artifacts import read_artifact, read_warnings
from gpsim.errors import UsageError
from gpsim.recordings import find_logs, read_recording
from gpsim.recordings.export import DriveLog, Topics, write_ros2_bag
from gpsim.stages.import_log import import_log, read_logs, remembering, source_digests

WRITTEN = [
    "recording.parquet",
    "recording.yaml",
    "import_report.txt",
    "figures/channels.png",
    "manifest.json",
]


def test_a_bare_csv_needs_only_the_system(cartpole_log, tmp_path):
    made = import_log([cartpole_log], tmp_path / "out", words=["system=cartpole"])
    recording = read_recording(tmp_path / "out")
    assert recording.system == "cartpole"
    assert recording.transition_count == 199
    assert recording.velocities == "measured"
    assert np.array_equal(recording.episodes[0].states[:, 0], pd.read_csv(cartpole_log)["x"])
    assert np.array_equal(recording.episodes[0].actions[:, 0], pd.read_csv(cartpole_log)["force"][:-1])
    assert read_artifact(tmp_path / "out").stage == "import"
    names = {p.relative_to(tmp_path / "out").as_posix() for p in made.artifact.path.rglob("*") if p.is_file()}
    assert set(WRITTEN) <= names
    assert "read = kept + dropped" in (tmp_path / "out" / "import_report.txt").read_text()


def test_the_same_log_gives_the_same_bytes(cartpole_log, tmp_path):
    for name in ("a", "b"):
        import_log([cartpole_log], tmp_path / name, words=["system=cartpole"])
    for file in WRITTEN:
        assert (tmp_path / "a" / file).read_bytes() == (tmp_path / "b" / file).read_bytes()


def test_a_column_of_words_is_no_channel(cartpole_log, tmp_path):
    pd.read_csv(cartpole_log).assign(mode="run").to_csv(cartpole_log, index=False)
    with pytest.raises(UsageError, match="column 'mode' holds text, which only episodes.by=column can use"):
        import_log([cartpole_log], tmp_path / "out", words=["system=cartpole", "state.x.field=mode"])


def test_nothing_is_overwritten_and_nothing_half_written(cartpole_log, tmp_path, monkeypatch):
    (tmp_path / "out").mkdir()
    with pytest.raises(UsageError, match="exists already"):
        import_log([cartpole_log], tmp_path / "out", words=["system=cartpole"])

    def fail(recording, path):
        (path if path.suffix else path / "recording.yaml").write_text("half")
        raise RuntimeError("the disk is gone")

    with monkeypatch.context() as patched:
        patched.setattr("gpsim.stages.import_log.write_recording", fail)
        with pytest.raises(RuntimeError):
            import_log([cartpole_log], tmp_path / "half", words=["system=cartpole"])
    assert sorted(p.name for p in tmp_path.iterdir()) == ["log.csv", "out"]
    monkeypatch.setattr("gpsim.reports.import_figure.draw_channels", fail)
    import_log([cartpole_log], tmp_path / "plain", words=["system=cartpole"])
    assert read_warnings(tmp_path / "plain") == [
        "figures/channels.png is left out: RuntimeError: the disk is gone"
    ]
    assert not list((tmp_path / "plain" / "figures").iterdir())
    assert read_artifact(tmp_path / "plain").stage == "import"


@pytest.mark.parametrize(
    ("words", "text"),
    [
        ([], "no --mapping; `gpsim import --inspect` .*my_system.py:ClassName.*or use system=NAME"),
        (["system=cartpol"], "no simulator 'cartpol'; there are: cartpole"),
        (["system=cartpole", "rat=3"], "did you mean 'rate'"),
        (["system=cartpole", "velocities.methd=savgol"], "did you mean 'method'"),
        (["system=cartpole", "clock.stamps=sent"], "not one of auto, header, receive"),
        (["system=cartpole", "state.x.field=lost"], "lost"),
        (["system=cartpole", "a.b.=3"], "."),
        (["system=cartpole", "rate=[1"], "."),
    ],
)
def test_wrong_settings_end_in_one_line(cartpole_log, tmp_path, words, text):
    with pytest.raises(UsageError, match=text) as caught:
        import_log([cartpole_log], tmp_path / "out", words=words)
    assert "\n" not in str(caught.value)
    assert not (tmp_path / "out").exists()


def limo_bag(folder, count=300):
    """A Limo on a circle: poses at 100 Hz, cmd_vel at 10 Hz without stamps."""
    t = 0.01 * np.arange(count)
    poses = np.stack([0.5 * np.sin(t), 0.5 * (1.0 - np.cos(t)), t], axis=1)
    write_ros2_bag(folder, DriveLog(t[::10], np.tile([0.5, 1.0], (count // 10, 1)), t, poses), Topics())
    return folder


def test_a_limo_bag_imports_by_the_ready_mapping(tmp_path):
    bag = limo_bag(tmp_path / "bag")
    made = import_log([bag], tmp_path / "out", "limo_optitrack")
    (episode,) = made.recording.episodes
    assert made.recording.dt == pytest.approx(0.1)
    assert episode.states[:, 0] == pytest.approx(0.5 * np.sin(episode.t), abs=1e-5)
    assert episode.states[:, 2] == pytest.approx(episode.t, abs=1e-5)
    assert (episode.actions == [0.5, 1.0]).all()
    clocks = {count.topic: count.clock for count in made.report.topics}
    assert clocks == {"/vrpn_client_node/limo/pose": "header", "/cmd_vel": "receive"}


def test_a_truncated_bag_is_refused_and_what_is_readable_is_salvaged_and_counted(tmp_path):
    bag = limo_bag(tmp_path / "bag")
    file = next(bag.glob("*.mcap"))
    whole, _, _ = read_logs([file], "limo_optitrack")
    broken = tmp_path / "broken.mcap"
    broken.write_bytes(file.read_bytes()[: int(0.6 * file.stat().st_size)])
    with pytest.raises(UsageError, match=r"broken\.mcap.*--salvage") as caught:
        import_log([broken], tmp_path / "out", "limo_optitrack")
    assert "\n" not in str(caught.value)
    made = import_log([broken], tmp_path / "out", "limo_optitrack", salvage=True)
    assert 0 < made.recording.transition_count < whole.transition_count
    for count in made.report.topics:
        assert count.read == count.kept + sum(count.dropped.values())
    assert any("broken.mcap" in line for line in made.report.warnings)


def test_what_lies_beside_the_logs_does_not_count(tmp_path):
    """The digests are of the files that are read, whatever else a folder holds."""
    logs = tmp_path / "logs"
    logs.mkdir()
    cartpole_table(logs / "a.csv")
    cartpole_table(logs / "b.csv")
    bag = logs / "drive"
    bag.mkdir()
    for name in ("metadata.yaml", "drive_0.db3", "drive_1.db3.zstd", "notes.md"):
        (bag / name).write_text(name)
    for name in (".DS_Store", "notes.txt"):
        (logs / name).write_text("x")
    storage = ["drive/drive_0.db3", "drive/drive_1.db3.zstd", "drive/metadata.yaml"]
    assert list(source_digests([logs])) == ["a.csv", "b.csv", *storage]
    assert list(source_digests([logs], None, ["files=b*"])) == ["b.csv"]
    assert list(source_digests([logs], "physical_cartpole")) == ["a.csv", "b.csv"]  # its files: "*.csv"
    assert list(source_digests([logs / "a.csv", bag])) == ["1/a.csv", *(f"2/{Path(n).name}" for n in storage)]
    words = ["layout=folder", "files=a*"]
    assert list(source_digests([logs], "physical_cartpole", words)) == ["a.csv"]
    with pytest.raises(UsageError, match="no such file or folder"):
        source_digests([tmp_path / "nowhere"])
    with pytest.raises(UsageError, match=r"no log files named \*\.bag"):
        source_digests([logs], "physical_cartpole", ["files='*.bag'"])


def test_files_come_sorted_with_numbers_in_numeric_order(tmp_path):
    for number in (132, 33, 1056, 0):
        (tmp_path / f"Experiment-{number}.csv").write_text("t\n")
    (tmp_path / "notes.md").write_text("no log")
    names = [log.name for log in find_logs([tmp_path], "files", "*", remembering([]))]
    assert names == [f"Experiment-{n}.csv" for n in (0, 33, 132, 1056)]


def test_a_folder_is_a_log_of_topics(tmp_path):
    for name in ("b/pose.csv", "b/cmd.csv", "a/pose.csv"):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text("t\n")
    logs = find_logs([tmp_path], "folder", "*", remembering([]))
    assert [log.name for log in logs] == ["a", "b"]
    assert set(logs[1].log.files) == {"pose", "cmd"}


def test_two_files_of_one_topic_are_refused_until_one_is_chosen(tmp_path):
    for name in ("pose.csv", "pose.parquet", "cmd.csv"):
        (tmp_path / name).write_text("t\n")
    with pytest.raises(
        UsageError, match=r"pose\.csv and pose\.parquet would both be the topic 'pose'.*files="
    ):
        find_logs([tmp_path], "folder", "*", remembering([]))
    (log,) = find_logs([tmp_path], "folder", "*.csv", remembering([]))
    assert set(log.log.files) == {"pose", "cmd"}
