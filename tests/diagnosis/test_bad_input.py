"""What a person may hand over by mistake: one line each, and nothing is read past it in silence."""

import json
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import yaml
from gpsim.cli.configuration import resolve
from gpsim.cli.main import app
from typer.testing import CliRunner

from gpsim.errors import UsageError
from gpsim.recordings import read_recording, write_recording
from gpsim.stages.diagnose import Task, open_recording, stage_for
from gpsim.stages.stage import Request

from .own_systems import SLIDER
from .worlds import World, record


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    out = tmp_path / "log"
    out.mkdir()
    write_recording(record(World("slider"), episodes=2, steps=60), out, "csv")
    return out


def said(action) -> str:
    with pytest.raises(UsageError) as caught:
        action()
    assert "\n" not in str(caught.value)
    return str(caught.value)


@pytest.mark.parametrize(
    ("key", "value", "message"),
    [
        ("state", ["q", "q_dot"], "expected channels with units"),
        ("noise", 0.01, "noise: expected names with numbers"),
        ("noise", {"qq": 0.01}, "noise: 'qq' is not one of q, q_dot, force"),
        ("held_out", {"part": 0.2}, "held_out: unknown key 'part'"),
        ("held_out", {"share": 1.0}, "held_out.share: expected a number in [0, 1), got 1"),
        ("parameters", {"mass": "heavy"}, "parameters.mass: expected a finite number"),
        ("dt", "fast", "dt: expected a finite number"),
        ("velocities", "differentiate", "'differentiate' is not one of"),
        ("clock", "wall", "'wall' is not one of session, episode"),
        ("wraps", "q", "wraps: expected a list of channels"),
        ("wraps", ["yaw"], "wraps: 'yaw' is not one of q, q_dot"),
    ],
)
def test_a_wrong_recording_yaml_is_one_line(folder, key, value, message):
    meta = yaml.safe_load((folder / "recording.yaml").read_text())
    (folder / "recording.yaml").write_text(yaml.safe_dump(meta | {key: value}))
    assert message in said(lambda: read_recording(folder))


def test_a_dt_that_is_not_the_clocks_is_refused(folder, tmp_path):
    """Before anything is diagnosed: windows, gaps and delays are counted in it."""
    meta = yaml.safe_load((folder / "recording.yaml").read_text())
    (folder / "recording.yaml").write_text(yaml.safe_dump(meta | {"dt": 0.05}))
    result = CliRunner().invoke(app, ["diagnose", str(folder), "--out", str(tmp_path / "out")])
    assert isinstance(result.exception, UsageError)
    assert "says dt 0.05 s, but the median step of its t is 0.02 s: write dt: 0.02" in str(result.exception)
    assert not (tmp_path / "out").exists()


def test_blank_entries_of_recording_yaml_are_absent_ones(folder):
    meta = yaml.safe_load((folder / "recording.yaml").read_text())
    blank = dict.fromkeys(("wraps", "noise", "held_out", "provenance", "parameters"))
    (folder / "recording.yaml").write_text(yaml.safe_dump(meta | blank))
    assert read_recording(folder).noise == {}


@pytest.mark.parametrize("bare", [False, True])
def test_rows_without_an_episode_are_not_dropped(folder, tmp_path, bare):
    frame = pd.read_csv(folder / "recording.csv")
    frame["episode"] = frame["episode"].astype(object)
    frame.loc[5:, "episode"] = None
    path = tmp_path / "log.csv" if bare else folder / "recording.csv"
    frame.to_csv(path, index=False)
    task = Task(path if bare else folder, "slider")
    assert "row 5: no episode" in said(lambda: open_recording(task))


def test_bare_tables_that_say_nothing(folder, tmp_path):
    frame = pd.read_csv(folder / "recording.csv")
    empty, dated = tmp_path / "empty.csv", tmp_path / "dated.parquet"
    frame.iloc[:0].to_csv(empty, index=False)
    assert "too short" in said(lambda: open_recording(Task(empty, "slider")))
    frame.assign(t=pd.to_datetime(frame["t"], unit="s")).to_parquet(dated)
    assert "column(s) t hold dates" in said(lambda: open_recording(Task(dated, "slider")))


@pytest.mark.usefixtures("own_files")
def test_a_bare_table_may_lack_what_a_system_guesses(folder, tmp_path):
    (tmp_path / "mine.py").write_text(SLIDER)
    frame = pd.read_csv(folder / "recording.csv").drop(columns="q_dot")
    frame.to_csv(tmp_path / "log.csv", index=False)
    recording, _ = open_recording(Task(tmp_path / "log.csv", f"{tmp_path / 'mine.py'}:Slider"))
    assert recording.state.names == ("q",)
    assert recording.action.names == ("force",)


def test_settings_beside_a_recording_count_or_are_refused(folder):
    assert len(open_recording(Task(folder, None, episodes=1))[0].episodes) == 1
    for word, remedy in (("simulator=slider", "--simulator NAME"), ("recording=x", "RECORDING alone")):
        result = CliRunner().invoke(app, ["diagnose", str(folder), word])
        assert remedy in str(result.exception)
    result = CliRunner().invoke(app, ["diagnose", str(folder), "diagnose.episodes=3"])
    assert "expected 1 to 2" in str(result.exception)


@pytest.mark.usefixtures("own_files")
def test_an_edited_system_is_diagnosed_anew(folder, tmp_path):
    """The file that recording.yaml names counts as much as one on the command line."""
    mine = tmp_path / "mine.py"
    mine.write_text(SLIDER)
    meta = yaml.safe_load((folder / "recording.yaml").read_text())
    (folder / "recording.yaml").write_text(yaml.safe_dump(meta | {"system": f"{mine}:Slider"}))
    stage = stage_for(Task(folder, None))
    request = Request(resolve([], None))
    before = stage.recipe(request).key
    assert stage.recipe(request).key == before
    mine.write_text(SLIDER.replace("2.0", "2.5"))
    assert stage.recipe(request).key != before
    assert json.dumps(stage.recipe(request).config)
    assert np.isfinite(open_recording(Task(folder, None))[1].defaults()["mass"])
