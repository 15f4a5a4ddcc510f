"""`gpsim diagnose` of a bare table with a site's columns, and `gpsim export model` of what it found."""

import json
from importlib.resources import files

import jsonschema
import mujoco
import numpy as np
import pandas as pd
import pytest
from cli_calls import called
from mjcf_models import PENDULUM, written

from gpsim.diagnosis import Diagnosis
from gpsim.stages.diagnose import read_corrected

SEEN = PENDULUM.replace("</body>", '<site name="tip" pos="0 0 -.8"/></body>')
STEP, FINE = 0.02, 0.001


def swung():
    """A pendulum whose marker sits 4 mm lower than the model says, seen 20 ms late by a motion capture."""
    model = mujoco.MjModel.from_xml_string(SEEN.replace("-.8", "-.804"))
    data, rng, rows = mujoco.MjData(model), np.random.default_rng(0), []
    data.qpos[0] = 0.5
    mujoco.mj_forward(model, data)
    late = np.array(data.site("tip").xpos)
    for k in range(500):
        command = 2.0 * np.sin(1.3 * k * STEP) + 1.5 * np.sin(4.1 * k * STEP)
        rows.append([k * STEP, data.qpos[0], command, *late])
        mujoco.mj_kinematics(model, data)
        late, data.ctrl[0] = np.array(data.site("tip").xpos), command
        for _ in range(round(STEP / FINE)):
            mujoco.mj_step(model, data)
    table = pd.DataFrame(rows, columns=["t", "theta", "torque", "tip.x", "tip.y", "tip.z"])
    table["theta"] += 2e-4 * rng.normal(size=len(table))
    table[["tip.x", "tip.y", "tip.z"]] += 5e-4 * rng.normal(size=(len(table), 3))
    table.loc[rng.random(len(table)) < 0.1, ["tip.x", "tip.y", "tip.z"]] = np.nan
    return table


@pytest.mark.slow
def test_a_log_with_a_site_says_what_of_the_geometry_is_off(tmp_path, monkeypatch, capfd):
    robot = written(tmp_path, SEEN)
    swung().to_csv(tmp_path / "log.csv", index=False)
    monkeypatch.chdir(tmp_path)
    words = ("diagnose", "log.csv", "--simulator", robot, "--out", "found", "--cores", "1")
    code, said, _ = called(monkeypatch, capfd, *words)
    assert code == 0
    assert "Geometry the place of tip along z is off by -0.004" in said
    content = json.loads((tmp_path / "found/diagnosis.json").read_text())
    schema = json.loads((files("gpsim.diagnosis") / "schema.json").read_text(encoding="utf-8"))
    jsonschema.validate(content, schema, jsonschema.Draft202012Validator)
    robots = [f for f in content["kinematics"]["found"] if f["model"]]
    assert [f["place"] for f in robots] == [{"kind": "site place", "on": "tip", "axis": "z"}]
    assert robots[0]["size"]["low"] < robots[0]["size"]["value"] < robots[0]["size"]["high"] < -0.0035
    (late,) = [f for f in content["kinematics"]["found"] if f["place"]["kind"] == "delay"]
    assert late["size"]["value"] == pytest.approx(0.02, abs=1e-3)
    assert Diagnosis.from_dict(content).to_dict() == content
    page = (tmp_path / "found/report.html").read_text(encoding="utf-8")
    assert "<h2>Geometry</h2>" in page
    assert "the delay of motion capture" in page
    (moved,) = read_corrected(tmp_path / "found").simulator.geometry
    assert moved.value == robots[0]["size"]["value"]
    assert called(monkeypatch, capfd, "export", "model", "found", "--out", "fixed.xml")[0] == 0
    told = mujoco.MjModel.from_xml_path(str(tmp_path / "fixed.xml")).site("tip").pos[2]
    assert told == pytest.approx(-0.8 + moved.value, abs=1e-12)
    assert "<!-- the place of tip along z is off by -0.004" in (tmp_path / "fixed.xml").read_text()
