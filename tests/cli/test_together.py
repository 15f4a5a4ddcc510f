"""`gpsim diagnose REC1 REC2`: recordings of one machine, judged together."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from test_json import read

from gpsim.artifacts import read_artifact
from gpsim.channels import Channels
from gpsim.recordings import Episode, Recording, write_recording
from gpsim.runs import parents, read_catalogue

ASKED = "diagnose.families.only=[viscous_friction]"


def slid(damping, seed, **changes):
    """A slider of 2 kg that is pushed at random, with viscous friction."""
    rng, dt = np.random.default_rng(seed), 0.02
    force = np.repeat(rng.uniform(-6.0, 6.0, 100), 6)
    states = np.zeros((len(force) + 1, 2))
    for k, push in enumerate(force):
        state = states[k]
        for _ in range(10):
            state = state + dt / 10 * np.array([state[1], (push - damping * state[1]) / 2.0])
        states[k + 1] = state
    states += rng.normal(size=states.shape) * [0.001, 0.01]
    episode = Episode("0", dt * np.arange(len(states)), states, force[:, None])
    channels = Channels.of({"q": "m", "q_dot": "m/s"}), Channels.of({"force": "N"})
    made = Recording("slider", *channels, (episode,), dt, {"mass": 2.0}, noise={"q": 0.001, "q_dot": 0.01})
    return replace(made, **changes)


@pytest.fixture
def days(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for name, recording in (
        ("monday", slid(1.0, 1)),
        ("friday", slid(1.3, 2)),
        ("slow", slid(1.0, 3, dt=0.05)),
    ):
        Path("logs", name).mkdir(parents=True)
        write_recording(recording, Path("logs", name))
    return Path("logs")


def test_they_make_one_artifact_that_rests_on_all(gpsim, days):
    words = ("diagnose", days / "monday", days / "friday", ASKED)
    code, out, err = gpsim(*words, "--json")
    assert code == 0, err
    content = read(out)
    assert content["made"]
    assert "viscous friction on q grew by" in err
    artifact = read_artifact(Path(content["paths"]["folder"]), "diagnose")
    assert [one["name"] for one in artifact.manifest["config"]["recordings"]] == ["monday", "friday"]
    assert "recording" not in artifact.manifest["config"]
    told = json.loads((artifact.path / "timings.json").read_text())["recordings"]
    assert {name: Path(path).name for name, path in told.items()} == {"monday": "monday", "friday": "friday"}
    (entry,) = read_catalogue(Path("runs")).entries
    assert [need.role for need in entry.needs] == ["recording monday", "recording friday"]
    assert parents(read_catalogue(Path("runs")), entry) == []  # given by folders that are no artifacts
    code, out, _ = gpsim(*words, "--json")
    assert (code, read(out)["made"]) == (0, False)
    code, out, _ = gpsim("diagnose", days / "friday", days / "monday", ASKED, "--dry-run", "--json")
    assert (code, read(out)["standing"]["state"]) == (0, "to make")  # the last one counts as today
    write_recording(slid(1.3, 4), days / "friday")
    code, out, _ = gpsim(*words, "--dry-run", "--json")
    assert (code, read(out)["standing"]["state"]) == (0, "to make")


def test_what_does_not_go_together_is_one_line(gpsim, days):
    code, _, err = gpsim("diagnose", days / "monday", days / "slow", "--dry-run")
    assert (code, err.count("\n")) == (2, 1)
    assert "monday has a step of 0.02 s, slow of 0.05 s" in err
    assert "--each" in err
    code, _, err = gpsim("diagnose", days / "monday", days / "friday", "--score", "found")
    assert (code, err.count("\n")) == (2, 1)
    assert "--score goes with one RECORDING at a time" in err
    code, _, err = gpsim("diagnose", days)
    assert (code, err.count("\n")) == (2, 1)
    assert "holds 3 recordings, friday first: name one, name several for a common account" in err
