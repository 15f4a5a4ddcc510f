"""A proof of robots: what is published, what is refused, what counts as right; a tiny one from beginning to end."""

import json

import pytest
from gpsim.cli.main import app
from typer.testing import CliRunner

from gpsim.mjcf import in_its_columns, load_mjcf
from gpsim.recordings import read_recording
from gpsim.trials.blinding import publish_hashes, trial_name, write_trial
from gpsim.trials.robots.models import files_of
from gpsim.trials.worlds import FROM

pytest.importorskip("mujoco")
pytest.importorskip("dm_control")
NUMBER = FROM["robots"] + 1
NAME = trial_name(NUMBER)


@pytest.fixture(scope="module")
def concealed(tmp_path_factory):
    """An acrobot whose elbow's sensor is late."""
    out = tmp_path_factory.mktemp("proof")
    digest = write_trial(out, 7, NUMBER)
    publish_hashes(out, {NAME: digest})
    return out


def test_the_public_half_is_what_a_diagnosis_takes_and_the_model_is_unchanged(concealed):
    public = concealed / "public" / NAME
    recording = read_recording(public)
    assert (recording.system, recording.model) == ("mjcf", "acrobot.xml")
    for name, text in files_of("dm_acrobot").items():
        assert (public / name).read_text() == text
    simulator = load_mjcf(str(public / recording.model))
    assert in_its_columns(recording, simulator).transition_count == recording.transition_count
    answer = json.loads((concealed / "private" / NAME / "answer.json").read_text())
    assert answer["effects"][0]["family"] == "sensor_delay"
    assert answer["robot"] == recording.model
    for word in ("sensor_delay", "delay"):
        assert word not in (public / "recording.yaml").read_text()


@pytest.mark.slow
def test_a_tiny_proof_of_robots_from_beginning_to_end(tmp_path):
    words = ["prove", "--system", "mjcf", "--seed", "7", "--out", str(tmp_path / "proof"), "--jobs", "2"]
    result = CliRunner().invoke(app, [*words, "--trials", "2"])
    assert result.exit_code == 0, result.output
    content = json.loads((tmp_path / "proof" / "prove.json").read_text())
    assert content["mjcf"]["n"] == 2
    assert content["failed"] == []
    assert content["mjcf"]["alarms"] == 0
    assert "Robots" in (tmp_path / "proof" / "report.html").read_text()
    assert "robots by their MuJoCo models" in (tmp_path / "proof" / "record.md").read_text()
