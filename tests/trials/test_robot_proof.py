"""A proof of robots: what is published, what is refused, what counts as right; a tiny one from beginning to end."""

import json
from types import SimpleNamespace

import pytest
from gpsim.cli.main import app
from typer.testing import CliRunner

from gpsim.mjcf import in_its_columns, load_mjcf
from gpsim.recordings import read_recording
from gpsim.reports.prove_sheets import goals_sheet
from gpsim.trials.blinding import publish_hashes, trial_name, write_trial
from gpsim.trials.fits import Rival
from gpsim.trials.robots.models import files_of
from gpsim.trials.scoring import score
from gpsim.trials.summary import summarise
from gpsim.trials.worlds import FROM

from .test_scoring import WORLD

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


def _answer(stratum="single", effects=(("actuator_gain", "elbow_cmd", {"gain": 1.2}),)):
    content = {
        "stratum": stratum,
        "robot": "acrobot.xml",
        "effects": [
            {"family": f, "on": on, "parameters": k, "region": {}, "since": None, "outside": False}
            for f, on, k in effects
        ],
    }
    return SimpleNamespace(content=content, claims=[(f, on) for f, on, _ in effects])


def _said(family="actuator_gain", on="elbow_cmd", name="gain", value=1.21, since=None):
    width = 0.05
    told = {name: {"value": value, "low": value - width, "high": value + width}}
    return {"family": family, "on": on, "parameters": told, "region": {}, "since": since}


def _report(*effects, verdict="named", alternatives=()):
    return {
        "verdict": verdict,
        "effects": list(effects),
        "alternatives": [{"effects": list(a)} for a in alternatives],
    }


def test_the_true_name_is_right_another_only_if_it_is_an_equivalent_and_a_gate_never():
    other = _said("actuator_bias", name="bias", value=0.1)
    claims = (("actuator_bias", "elbow_cmd"),)
    good = score(_answer(), _report(_said()), [])
    assert good["right"]
    assert good["parameters"][0]["covered"]
    assert good["parameters"][0]["relative_error"] == pytest.approx(0.01 / 1.2)
    assert not score(_answer(), _report(other), [])["right"]
    assert score(_answer(), _report(other), [Rival(claims, 2.0, False)])["right"]
    assert not score(_answer(), _report(other), [Rival(claims, 4.0, False)])["right"]
    assert not score(_answer(), _report(other), [Rival(claims, 1.0, True)])["right"]
    assert not score(_answer(), _report(_said(since=12.0)), [])["right"]
    assert not score(_answer(), _report(_said(), other), [])["right"]


def test_figures_of_robots_stand_by_themselves_and_have_goals():
    world = WORLD | {"system": "arm", "velocities": None, "trial": NAME}
    quiet, alarm = (
        score(_answer("none", ()), r, [])
        for r in (_report(verdict="none"), _report(_said(), verdict="named"))
    )
    failed = score(_answer(), None, [])
    scores = [{**s, **world} for s in (score(_answer(), _report(_said()), []), failed, quiet, alarm)]
    found = summarise(scores)
    robots = found["mjcf"]
    assert (robots["single_right"], robots["false_alarms"], robots["failed"]) == (0.5, 0.5, 1)
    assert robots["coverage_90"] == 1.0
    assert found["all"]["n"] == 0
    assert found["goals"]["mjcf.single_right"]["wanted"] == ">= 0.95"
    assert found["goals"]["mjcf.false_alarms"]["got"] == 0.5
    assert robots["strata"]["robot"]["arm"]["n"] == 4
    labels = [[cell.text for cell in cells] for cells in goals_sheet(found).rows]
    assert {words[0].split(":")[0] for words in labels} == {"robots"}, "nothing was asked of other worlds"
    assert labels[0][-1] == "1/2"


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
