"""A diagnosis from Python: the command line's answer, shown, written down, read again and scored."""

import json
import subprocess
import sys

import numpy as np
import pytest
from api.conftest import FEW, UNITS, pushed
from cli_calls import called
from pages import check_fragment

import gpsim
from gpsim.artifacts import read_artifact
from gpsim.errors import UsageError
from gpsim.reports.account_lines import COLUMNS, LINES


def command(*words):
    call = [sys.executable, "-m", "gpsim", *words]
    return subprocess.run(call, capture_output=True, text=True, check=False)


def test_it_names_what_is_missing_and_tells_its_progress(made):
    effect = made.diagnosis.effects[0]
    assert made.diagnosis.verdict == "named"
    assert (effect.family, effect.on) == ("viscous_friction", "q")
    damping = effect.parameters["damping"]
    assert damping.low < 1.0 < damping.high
    assert damping.unit == "N s/m"
    assert [done for done, total, note in made.said] == sorted(done for done, _, _ in made.said)
    assert made.said[-1] == (100, 100, "done")
    assert repr(made.diagnosis) == "<Diagnosis of slider: named, viscous_friction on q>"


def test_printed_it_is_the_terminals_account(made):
    lines = str(made.diagnosis).splitlines()
    assert lines[0].startswith("Verdict  named: viscous friction on q explains")
    assert len(lines) <= LINES
    assert max(map(len, lines)) <= COLUMNS
    assert lines[-1].strip() == "python: gpsim.Diagnosis.load('DIR').corrected()"


def test_in_a_notebook_it_is_a_piece_of_html_with_its_pictures(made):
    piece = check_fragment(made.diagnosis._repr_html_())
    assert "viscous friction on q" in piece.text
    assert piece.tags >= {"div", "style", "table", "img"}
    sources = [a["src"] for tag, a in piece.elements if tag == "img"]
    assert len(sources) == 2
    assert all(source.startswith("data:image/png;base64,") for source in sources)


def test_its_effects_are_a_table(made):
    table = made.diagnosis.to_frame()
    assert list(table) == ["role", "family", "place", "parameter", "unit", "value", "low", "high", "share"]
    (row,) = table[table.role == "headline"].itertuples()
    effect = made.diagnosis.effects[0]
    assert (row.family, row.place, row.parameter, row.unit) == ("viscous_friction", "q", "damping", "N s/m")
    assert (row.value, row.low, row.high) == tuple(
        vars(effect.parameters["damping"])[k] for k in ("value", "low", "high")
    )
    assert row.share == effect.importance.share > 0.9


def test_of_several_recordings_the_table_says_whose_a_value_is():
    logs = {"monday": pushed(600), "friday": pushed(600, seed=1, damping=2.0)}
    recordings = {name: gpsim.recording_from_frame(log, UNITS, "slider") for name, log in logs.items()}
    several = gpsim.diagnose(recordings, families={"only": ["viscous_friction"]})
    table = several.to_frame()
    assert list(table)[-1] == "recording"
    assert set(table.recording) <= {"", *(one.name for one in several.result.recordings)}
    assert {"monday", "friday"} & set(table.recording)
    for effect in several.effects:
        said = table[(table.family == effect.family) & (table.place == effect.place)]
        for recording, values in (effect.own or {"": effect.parameters}).items():
            mine = said[said.recording == recording]
            assert dict(zip(mine.parameter, mine.value, strict=True)) == {
                n: e.value for n, e in values.items()
            }


def test_pictures_by_name(made):
    assert "held_out_rollout" in made.diagnosis.plots
    picture = made.diagnosis.plot()
    assert picture._repr_png_() == picture.png
    assert picture.png.startswith(b"\x89PNG")
    with pytest.raises(UsageError, match="no picture 'rollout'; there are: held_out_rollout, "):
        made.diagnosis.plot("rollout")


@pytest.mark.slow
def test_what_is_saved_is_what_the_command_line_writes_and_reads(made, here, monkeypatch, capfd):
    """The same recording by the command line: byte for byte the same result, and both open what the other wrote."""
    words = ["--simulator", "slider", "--out", "by_command", "--cores", "1", "-q"]
    said = command("diagnose", "slider.csv", *words, f"diagnose.families.only=[{','.join(FEW)}]")
    assert said.returncode == 0, said.stderr
    by_command, by_python = here / "by_command", here / "found"
    files = {p.relative_to(by_command).as_posix() for p in by_command.rglob("*") if p.is_file()}
    assert files == {p.relative_to(by_python).as_posix() for p in by_python.rglob("*") if p.is_file()}
    for name in sorted(files - {"manifest.json", "timings.json"}):
        assert (by_command / name).read_bytes() == (by_python / name).read_bytes(), name
    configs = [read_artifact(p, "diagnose").manifest["config"] for p in (by_command, by_python)]
    assert [c.pop("recording") for c in configs][1].keys() == {"content"}
    assert configs[0] == configs[1]
    assert str(gpsim.Diagnosis.load("by_command").plot().png[:4]) == str(made.diagnosis.plot().png[:4])
    words = ["diagnose", "slider.csv", "--score", "found", "--out", "scored", "--cores", "1", "-q"]
    assert called(monkeypatch, capfd, *words)[0] == 0
    told = json.loads((here / "scored" / "score.json").read_text())
    assert told == made.diagnosis.score("slider.csv").to_dict()


def test_loaded_it_is_the_same(made, here):
    loaded = gpsim.Diagnosis.load("found")
    assert loaded.result.to_dict() == made.diagnosis.result.to_dict()
    assert str(loaded).splitlines()[:-1] == str(made.diagnosis).splitlines()[:-1]
    assert str(loaded).splitlines()[-1].strip() == "python: gpsim.Diagnosis.load('found').corrected()"
    assert set(loaded.plots) == set(made.diagnosis.plots)
    assert loaded.simulator.name == "slider"
    start, pushes = [0.0, 1.0], np.full((20, 1), 0.3)
    expected = made.diagnosis.corrected().rollout(start, pushes)
    np.testing.assert_array_equal(loaded.corrected().rollout(start, pushes), expected)
    again = loaded.save("again")
    assert gpsim.Diagnosis.load(again).result == loaded.result


def test_nothing_is_overwritten_and_damage_is_seen(made, here):
    with pytest.raises(UsageError, match="found: exists already; a diagnosis is never overwritten"):
        made.diagnosis.save("found")
    with pytest.raises(UsageError, match="exists already"):
        gpsim.Diagnosis.load("found").save(here)
    (here / "a file").write_text("")
    with pytest.raises(UsageError, match="a file"):
        made.diagnosis.save("a file/below")
    (here / "found" / "diagnosis.json").write_text("{}")
    with pytest.raises(UsageError, match=r"diagnosis.json: changed after it was written"):
        gpsim.Diagnosis.load("found")
    with pytest.raises(UsageError, match="not an artifact"):
        gpsim.Diagnosis.load("nothing")
    assert sorted(p.name for p in here.iterdir()) == ["a file", "found", "slider.csv"]


def test_a_failure_while_it_is_written_leaves_nothing(made, here, monkeypatch):
    monkeypatch.setattr(
        "gpsim.api.found.write_diagnosis", lambda folder, *_: (folder / "half").touch() or 1 / 0
    )
    with pytest.raises(ZeroDivisionError):
        made.diagnosis.save("half_done")
    assert sorted(p.name for p in here.iterdir()) == ["found", "slider.csv"]


def test_a_folder_of_another_simulator(here):
    with pytest.raises(UsageError, match="found: diagnoses the simulator slider, got pendulum"):
        gpsim.Diagnosis.load("found", "pendulum")


def test_a_score_on_a_recording_that_it_does_not_know(made):
    other = gpsim.recording_from_frame(pushed(seed=3), UNITS, "slider")
    errors = made.diagnosis.score(other).rollout["q"]
    assert errors.after < 0.05 * errors.before
    assert errors.unit == "m"


@pytest.mark.parametrize(
    ("named", "said"),
    [
        ({"settings": {"lwas": {}}}, "diagnose: no step 'lwas' (did you mean 'laws'?)"),
        ({"known": {"fixed": {}}}, "diagnose.known: no setting 'fixed'"),
        ({"known": {"fix": {"weight": 1.0}}}, "'weight'"),
        ({"families": {"only": "spring"}}, "diagnose.families.only: expected a list"),
        ({"families": {"only": ["sprung"]}}, "'sprung'"),
        ({"seed": -1}, "seed: expected a whole number of at least 0, got -1"),
        ({"cores": 0}, "cores: expected a whole number of at least 1, got 0"),
        (
            {"simulator": "pendulum"},
            "the recording's state is (q [m], q_dot [m/s]), simulator pendulum needs",
        ),
        ({"simulator": "slidder"}, "unknown simulator 'slidder'"),
    ],
)
def test_what_is_refused_before_anything_is_fitted(made, named, said):
    with pytest.raises(UsageError) as caught:
        gpsim.diagnose(made.recording, **named)
    assert said in str(caught.value)
    assert "\n" not in str(caught.value)


def test_what_is_no_recording():
    with pytest.raises(UsageError, match="expected a recording, got dict: make one by read_recording"):
        gpsim.diagnose({"q": [0.0]}, "slider")
