"""`gpsim import` as it is typed: what goes to stdout, what aside, and what is said at once."""

import pandas as pd
import pytest
import typer
import yaml
from gpsim.cli.import_ import import_command
from typer.testing import CliRunner

from gpsim.errors import UsageError


def run(*words):
    app = typer.Typer()
    app.command()(import_command)
    return CliRunner().invoke(app, [str(word) for word in words])


def refused(*words):
    error = run(*words).exception
    assert isinstance(error, UsageError), error
    assert "\n" not in str(error)
    return str(error)


def test_what_inspect_prints_is_a_mapping_once_the_open_questions_are_answered(cartpole_log, tmp_path):
    shown = run("--inspect", cartpole_log)
    assert shown.exit_code == 0
    assert "numeric fields" in shown.stderr
    assert "numeric fields" not in shown.stdout
    mine = tmp_path / "m.yaml"
    mine.write_text(shown.stdout)
    said = refused(cartpole_log, "--mapping", mine, "--out", tmp_path / "out")
    assert "m.yaml: still '?' at system, state.x.unit" in said
    mine.write_text(shown.stdout.replace("'?'", "V"))
    done = run(cartpole_log, "--mapping", mine, "--out", tmp_path / "out")
    assert done.exit_code == 0, done.output
    assert "m.yaml: no commands: its action is empty" in done.stderr
    assert "no commands" not in run(cartpole_log, "system=cartpole", "--out", tmp_path / "b").stderr


def test_a_proposal_is_written_into_a_new_file_only(cartpole_log, tmp_path):
    mine = tmp_path / "m.yaml"
    shown = run("--inspect", cartpole_log, "--write-mapping", mine)
    assert shown.exit_code == 0
    assert shown.stdout == ""
    assert "fill in every '?'" in shown.stderr
    raw = yaml.safe_load(mine.read_text())
    assert (raw["system"], raw["time"]) == ("?", {"field": "t"})
    before = mine.read_bytes()
    assert "exists already" in refused("--inspect", cartpole_log, "--write-mapping", mine)
    assert mine.read_bytes() == before
    assert "cannot write here" in refused(
        "--inspect", cartpole_log, "--write-mapping", cartpole_log / "m.yaml"
    )
    assert "no such folder" in refused(
        "--inspect", cartpole_log, "--write-mapping", tmp_path / "no" / "m.yaml"
    )
    assert "goes with --inspect" in refused(cartpole_log, "--write-mapping", tmp_path / "n.yaml")


def test_a_table_without_a_known_time_column_asks_for_it(tmp_path):
    frame = pd.DataFrame({"vicon time": [0.0, 0.1], "x": [1.0, 2.0], "episode": ["a", "a"]})
    frame.to_csv(tmp_path / "a.csv", index=False)
    raw = yaml.safe_load(run("--inspect", tmp_path / "a.csv").stdout)
    assert raw["time"] == {"field": "?"}
    assert raw["episodes"] == {"by": "column", "field": "episode"}
    assert set(raw["state"]) == {"vicon time", "x"}


def test_mappings_that_fit_are_named(tmp_path):
    columns = ["time", "position", "positionD", "angle", "angleD", "Q"]
    pd.DataFrame([range(6), range(1, 7)], columns=columns).to_csv(tmp_path / "a.csv", index=False)
    shown = run("--inspect", tmp_path / "a.csv").stderr
    assert "--mapping physical_cartpole comes with gpsim" in shown
    assert "simple_pendulum" not in shown
    pd.DataFrame([range(5)], columns=columns[:5]).to_csv(tmp_path / "b.csv", index=False)
    assert "comes with gpsim" not in run("--inspect", tmp_path / "b.csv").stderr


def test_of_a_folder_only_the_first_log_has_to_be_sound(cartpole_log, tmp_path):
    (tmp_path / "z.csv").write_text("t,t\n1,2\n")
    shown = run("--inspect", tmp_path)
    assert shown.exit_code == 0, shown.exception
    assert "and 1 more log(s)" in shown.stderr


@pytest.mark.parametrize("words", [[], ["--out", "OUT"]])
def test_without_a_mapping_the_way_to_one_is_told(cartpole_log, tmp_path, words):
    said = refused(cartpole_log, *(tmp_path / "out" if word == "OUT" else word for word in words))
    for part in ("--mapping", "gpsim import --inspect", "FILE.py:ClassName", "--simulator cartpole --out"):
        assert part in said
    assert "--out DIR missing" in refused(cartpole_log, "system=cartpole")
    assert "takes no settings (rate=5)" in refused("--inspect", cartpole_log, "rate=5")


def test_a_word_longer_than_a_file_name_is_one_line(cartpole_log, tmp_path):
    word = f"state.x.field={'y' * 400}"
    assert "no numeric column 'yyyy" in refused(
        cartpole_log, "system=cartpole", word, "--out", tmp_path / "o"
    )
