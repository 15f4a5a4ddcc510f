import numpy as np
import pandas as pd
import pytest

from gpsim.channels import Channels
from gpsim.errors import UsageError
from gpsim.recordings import Episode, Recording, open_log, write_recording
from gpsim.simulators import make_simulator
from gpsim.stages.export import export_recording


def simulated_recording(system="cartpole", clock="episode"):
    """Two episodes that the base simulator itself made: its predictions must be what was measured."""
    simulator = make_simulator("cartpole")
    parameters = simulator.defaults()
    rng = np.random.default_rng(0)
    episodes = []
    for number in range(2):
        actions = rng.normal(size=(20, 1))
        states = [np.array([[0.0, 0.0, 0.05, 0.0]])]
        for action in actions:
            states.append(simulator.step(states[-1], action[None], parameters, np.array([0.02]), "euler"))
        t = 0.02 * np.arange(21) + (5.0 * number if clock == "session" else 0.0)
        episodes.append(Episode(str(number), t, np.concatenate(states), actions))
    return Recording(
        system,
        simulator.state,
        simulator.action,
        tuple(episodes),
        0.02,
        parameters,
        "euler",
        "measured",
        clock,
    )


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "recording").mkdir()
    write_recording(simulated_recording(), tmp_path / "recording")
    return tmp_path / "recording"


@pytest.mark.parametrize("form", ["csv", "parquet"])
def test_the_table_holds_measured_beside_simulated(folder, tmp_path, form):
    export_recording(folder, form, tmp_path / f"out.{form}")
    table = pd.read_csv(tmp_path / "out.csv") if form == "csv" else pd.read_parquet(tmp_path / "out.parquet")
    assert len(table) == 42
    assert table["simulated.theta"].isna().sum() == 2
    known = table["simulated.theta"].notna()
    assert np.allclose(table["simulated.theta"][known], table["theta"][known], atol=1e-12)
    assert np.allclose(table["open_loop.x"], table["x"], atol=1e-9)
    assert (np.diff(table["time"]) > 0).all()


def test_the_mcap_is_read_back_by_our_own_reader(folder, tmp_path):
    export_recording(folder, "mcap", tmp_path / "out.mcap")
    log = open_log(tmp_path / "out.mcap")
    topics = {topic.name: topic for topic in log.topics()}
    assert topics["/measured/x"].count == 42
    assert topics["/command/force"].count == 40
    assert topics["/simulated/theta"].count == 40
    series = log.series({"/measured/theta": ["data"], "/simulated/theta": ["data"]})
    expected = np.concatenate([e.states[:, 2] for e in simulated_recording().episodes])
    assert np.array_equal(series["/measured/theta"].fields["data"], expected)
    assert sorted(p.name for p in tmp_path.iterdir()) == ["out.mcap", "recording"]


def test_a_pose_becomes_a_pose_message(tmp_path):
    t = np.arange(5) * 0.1
    states = np.stack([t, 2 * t, 0.5 * t], axis=1)
    channels = Channels.of({"x": "m", "y": "m", "yaw": "rad"}, wraps=["yaw"])
    recording = Recording(
        "robot", channels, Channels.of({}), (Episode("0", t, states, np.zeros((4, 0))),), 0.1
    )
    (tmp_path / "r").mkdir()
    write_recording(recording, tmp_path / "r")
    notes = export_recording(tmp_path / "r", "mcap", tmp_path / "out.mcap")
    assert "no simulator 'robot'" in notes[1]
    pose = open_log(tmp_path / "out.mcap").series(
        {"/measured/pose": ["pose.position.y", "pose.orientation.z"]}
    )
    assert np.array_equal(pose["/measured/pose"].fields["pose.position.y"], states[:, 1])
    assert np.allclose(pose["/measured/pose"].fields["pose.orientation.z"], np.sin(states[:, 2] / 2))


def test_exports_are_refused_in_one_line(folder, tmp_path):
    for form, out, text in (
        ("xml", tmp_path / "a", "not one of mcap, csv, parquet"),
        ("csv", tmp_path / "no" / "a.csv", "no such folder"),
        ("csv", folder, "exists already"),
    ):
        with pytest.raises(UsageError, match=text):
            export_recording(folder, form, out)
    with pytest.raises(UsageError, match=r"no recording\.yaml"):
        export_recording(tmp_path, "csv", tmp_path / "a.csv")
