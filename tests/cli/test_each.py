"""`gpsim diagnose --each`: which recordings are meant, and one object over all of them."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from made_diagnoses import made_diagnosis, made_effect
from test_json import read

from gpsim.artifacts import Recipe
from gpsim.errors import UsageError
from gpsim.files import write_json
from gpsim.findings import Estimate
from gpsim.reports.wording import worded
from gpsim.stages import fleet

SIZES = {"r1": 2.0, "r2": 2.1, "r3": 3.5}


def swing(path, amplitude=0.4):
    t = 0.01 * np.arange(300)
    angle, rate = amplitude * np.cos(4.0 * t), -4.0 * amplitude * np.sin(4.0 * t)
    columns = {"time": t, "theta": angle, "theta_dot": rate, "torque": 0.2 * np.sin(7.0 * t)}
    path.parent.mkdir(parents=True, exist_ok=True)
    pd.DataFrame(columns).to_csv(path, index=False)


def found_in(name):
    size = {"stiffness": Estimate(SIZES[name], SIZES[name] - 0.05, SIZES[name] + 0.05, "N/m")}
    return made_diagnosis(verdict="named", effects=(made_effect(parameters=size, role="headline"),))


@pytest.fixture
def instant(monkeypatch):
    """Diagnoses that nobody waits for; what is not in SIZES cannot be diagnosed. Returns what each was about."""
    seen = {}

    def run(jobs, launcher, told, keep_going):
        made, errors = {}, {}
        for job in jobs:
            name = Path(job.label).stem
            seen[job.label] = job.made_by.args[0]
            if name not in SIZES:
                errors[job.label] = "nothing moves in it"
                told.failed(job.label, errors[job.label])
                continue
            recipe = Recipe("diagnose", {"simulator": "pendulum", "of": name}, {}, {})

            def write(folder, name=name):
                write_json(folder / "diagnosis.json", worded(found_in(name)).to_dict())
                return {}

            made[job.label] = job.request.store.publish(recipe, write)
            told.made(job.label, made[job.label], False)
        return made, errors

    monkeypatch.setattr("gpsim.stages.fleet.run_jobs", run)
    return seen


@pytest.fixture
def logs(tmp_path, monkeypatch):
    """A folder with a raw log of each of three robots."""
    monkeypatch.chdir(tmp_path)
    for name in SIZES:
        swing(tmp_path / f"logs/{name}.csv", 0.1 * SIZES[name])
    return Path("logs")


def test_a_folder_of_raw_logs_is_a_fleet(gpsim, instant, logs):
    code, out, err = gpsim("diagnose", logs, "--each", "--simulator", "pendulum", "torque=torque", "--json")
    assert code == 0, err
    content = read(out)
    assert [robot["verdict"] for robot in content["robots"]] == ["named"] * 3
    assert [(d["robot"], d["effect"]) for d in content["differences"]] == [("r3.csv", "spring on q")]
    assert content["said"] == "1 of 3 robots differs: r3.csv"
    assert all(Path(path).exists() for path in content["paths"].values())
    assert all((task.recording / "recording.yaml").is_file() for task in instant.values())
    assert "Fleet    1 of 3 robots differs" in err


def test_what_fails_is_told_and_the_others_are_there(gpsim, instant, logs):
    swing(logs / "still.csv")
    (logs / "torn.csv").write_text("time,theta\n")
    code, out, err = gpsim("diagnose", logs, "--each", "--simulator", "pendulum", "--json")
    assert code == 2, err
    content = read(out)
    assert content["error"]["message"].startswith("2 of 5 recordings could not be diagnosed")
    assert "still.csv: nothing moves in it" in content["warnings"]
    assert [line for line in content["warnings"] if line.startswith("torn.csv: ")]
    page = Path(content["paths"]["report"]).read_text()
    assert "nothing moves in it" in page
    assert "torn.csv" not in instant


def test_words_that_count_for_none(gpsim, logs):
    Path("kept").mkdir()
    Path("kept/recording.yaml").write_text("system: slider\n")
    code, _, err = gpsim("diagnose", "kept", "--each", "gp.n_train=3")
    assert code == 2
    assert "gp.n_train=3: not used with a RECORDING" in err.splitlines()[-1]
    code, _, err = gpsim("diagnose", "--each")
    assert (code, err) == (2, "error: diagnose: --each needs RECORDINGs, or folders of them\n")


def test_which_recordings_a_word_means(logs):
    names = fleet.recordings_in([logs], None)
    assert list(names) == ["r1.csv", "r2.csv", "r3.csv"]
    assert list(fleet.recordings_in([logs / "r1.csv", logs / "r3.csv"], None)) == ["r1.csv", "r3.csv"]
    swing(Path("more/a.csv"))
    swing(Path("more/b.csv"))
    assert list(fleet.recordings_in([logs, Path("more")], None)) == [
        "logs",
        "more",
    ]  # each a log of several files
    for name in ("one", "two"):
        Path("kept", name).mkdir(parents=True)
        Path("kept", name, "recording.yaml").touch()
    Path("kept/notes.csv").touch()
    assert list(fleet.recordings_in([Path("kept")], None)) == ["one", "two"]
    with pytest.raises(UsageError, match="named twice"):
        fleet.recordings_in([logs / "r1.csv", logs / "../logs/r1.csv"], None)
    Path("empty").mkdir()
    with pytest.raises(UsageError, match="no recordings in it"):
        fleet.recordings_in([Path("empty")], None)


def test_a_sweep_says_what_it_made(gpsim, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    words = (
        "sweep",
        "--of",
        "collect",
        "budget=smoke",
        "collect.policy=random",
        "collect.episodes=3",
        "seed=0,1",
    )
    code, out, err = gpsim(*words, "--dry-run", "--json")
    assert code == 0, err
    assert read(out) | {"paths": {}} == read(out)
    assert (read(out)["points"], read(out)["jobs"]) == (2, 2)
    code, out, err = gpsim(*words, "--jobs", "1", "--json")
    assert code == 0, err
    content = read(out)
    assert content["swept"] == ["seed"]
    assert pd.read_csv(content["paths"]["table"])["seed"].tolist() == [0, 1]
    assert all(Path(path).exists() for path in content["paths"].values())
