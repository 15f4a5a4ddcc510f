"""`gpsim import` as it is typed: what goes to stdout, what aside, and what is said at once."""

import re

import numpy as np
import pandas as pd
import pytest
import typer
import yaml
from gpsim.cli.import_ import import_command
from scipy.io import savemat
from typer.testing import CliRunner

from gpsim.errors import UsageError
from gpsim.recordings import read_recording


def run(*words):
    app = typer.Typer()
    app.command()(import_command)
    return CliRunner().invoke(app, [str(word) for word in words])


def refused(*words):
    error = run(*words).exception
    assert isinstance(error, UsageError), error
    assert "\n" not in str(error)
    return str(error)


def car(path):
    """A planar car as a stranger logs it: milliseconds, degrees, names of its own."""
    t = np.arange(0.0, 10.0, 0.02)
    turn = 0.5 * np.sin(0.7 * t)
    yaw = 0.02 * np.cumsum(turn)
    x, y = 0.02 * np.cumsum(np.cos(yaw)), 0.02 * np.cumsum(np.sin(yaw))
    columns = {"time_ms": 1e3 * t, "x_m": x, "y_m": y, "heading_deg": np.degrees(yaw)}
    columns |= {"speed_cmd": np.ones_like(t), "yawrate_cmd_deg": np.degrees(turn)}
    if path.suffix == ".mat":
        savemat(path, columns)
    else:
        pd.DataFrame(columns).to_csv(path, index=False)
    return t, np.stack([x, y, yaw], axis=1), turn


@pytest.mark.parametrize("name", ["odd.csv", "car.mat"])
def test_what_inspect_writes_of_a_table_imports_it(name, tmp_path):
    t, states, turn = car(tmp_path / name)
    mine, out = tmp_path / "m.yaml", tmp_path / "out"
    shown = run("--inspect", tmp_path / name, "--write-mapping", mine)
    assert (shown.exit_code, shown.stdout) == (0, "")
    assert "looks like: unicycle" in shown.stderr
    for column, role in {
        "time_ms": "time [0.001 s]",
        "heading_deg": "state yaw [rad]",
        "yawrate_cmd_deg": "action w_cmd [rad/s]",
    }.items():
        assert re.search(rf"^{column} .*{re.escape(role)}", shown.stderr, re.MULTILINE)
    assert max(map(len, shown.stderr.splitlines()[:-1])) < 100
    assert "fill in" not in shown.stderr
    done = run(tmp_path / name, "--mapping", mine, "--out", out)
    assert done.exit_code == 0, done.output
    recording = read_recording(out)
    np.testing.assert_allclose(recording.episodes[0].states, states, atol=1e-9)
    np.testing.assert_allclose(recording.episodes[0].actions[:, 1], turn[:-1], atol=1e-9)
    np.testing.assert_allclose(np.diff(recording.episodes[0].t), np.diff(t))


def test_a_table_of_nothing_known_keeps_its_units_and_roles_and_asks_for_the_rest(tmp_path):
    t = 0.02 * np.arange(50)
    columns = {"time_ms": 1e3 * t, "arm_deg": np.sin(t), "motor_rpm": t, "level": t, "pump_cmd": t}
    pd.DataFrame(columns).to_csv(tmp_path / "a.csv", index=False)
    mine = tmp_path / "m.yaml"
    shown = run("--inspect", tmp_path / "a.csv", "--write-mapping", mine)
    assert "fill in every '?', then: gpsim import" in shown.stderr
    raw = yaml.safe_load(mine.read_text())
    assert (raw["system"], raw["time"]) == ("?", {"field": "time_ms", "scale": 1e-3})
    assert raw["state"]["arm_deg"] == {"field": "arm_deg", "unit": "rad", "scale": np.pi / 180}
    assert raw["state"]["motor_rpm"] == {"field": "motor_rpm", "unit": "rad/s", "scale": np.pi / 30}
    assert set(raw["state"]) == {"arm_deg", "motor_rpm", "level"}
    assert raw["action"] == {"pump_cmd": {"field": "pump_cmd", "unit": "?"}}
    said = refused(tmp_path / "a.csv", "--mapping", mine, "--out", tmp_path / "out")
    assert "m.yaml: still '?' at system, state.level.unit, action.pump_cmd.unit" in said


def test_a_proposal_is_written_into_a_new_file_only(cartpole_log, tmp_path):
    mine = tmp_path / "m.yaml"
    shown = run("--inspect", cartpole_log)
    assert "numeric fields" in shown.stderr
    assert "numeric fields" not in shown.stdout
    assert run("--inspect", cartpole_log, "--write-mapping", mine).exit_code == 0
    assert mine.read_text() == shown.stdout
    raw = yaml.safe_load(mine.read_text())
    assert (raw["system"], raw["time"]) == ("cartpole", {"field": "t"})
    before = mine.read_bytes()
    assert "exists already" in refused("--inspect", cartpole_log, "--write-mapping", mine)
    assert mine.read_bytes() == before
    assert "cannot write here" in refused(
        "--inspect", cartpole_log, "--write-mapping", cartpole_log / "m.yaml"
    )
    assert "its folder does not exist" in refused(
        "--inspect", cartpole_log, "--write-mapping", tmp_path / "no" / "m.yaml"
    )
    assert "needs --inspect" in refused(cartpole_log, "--write-mapping", tmp_path / "n.yaml")


def test_a_table_without_a_known_time_column_asks_for_it(tmp_path):
    frame = pd.DataFrame({"when": [0.0, 0.1], "x": [1.0, 2.0], "episode": ["a", "a"]})
    frame.to_csv(tmp_path / "a.csv", index=False)
    raw = yaml.safe_load(run("--inspect", tmp_path / "a.csv").stdout)
    assert raw["time"] == {"field": "?"}
    assert raw["episodes"] == {"by": "column", "field": "episode"}


def test_mappings_that_fit_are_named(tmp_path):
    columns = ["time", "position", "positionD", "angle", "angleD", "Q"]
    pd.DataFrame([range(6), range(1, 7)], columns=columns).to_csv(tmp_path / "a.csv", index=False)
    shown = run("--inspect", tmp_path / "a.csv").stderr
    assert "--mapping physical_cartpole is built in" in shown
    assert "simple_pendulum" not in shown
    pd.DataFrame([range(5)], columns=columns[:5]).to_csv(tmp_path / "b.csv", index=False)
    assert "is built in" not in run("--inspect", tmp_path / "b.csv").stderr


def test_of_a_folder_only_the_first_log_has_to_be_sound(cartpole_log, tmp_path):
    (tmp_path / "z.csv").write_text("t,t\n1,2\n")
    shown = run("--inspect", tmp_path)
    assert shown.exit_code == 0, shown.exception
    assert "and 1 more log(s)" in shown.stderr


@pytest.mark.parametrize("words", [[], ["--out", "OUT"]])
def test_without_a_mapping_the_way_to_one_is_told(cartpole_log, tmp_path, words):
    error = run(cartpole_log, *(tmp_path / "out" if word == "OUT" else word for word in words)).exception
    said = "\n".join(error.table)
    for part in ("--write-mapping mapping.yaml", "gpsim import --inspect", "--simulator cartpole --out"):
        assert part in said
    assert "--out DIR missing" in refused(cartpole_log, "system=cartpole")
    assert "takes no settings (rate=5)" in refused("--inspect", cartpole_log, "rate=5")
