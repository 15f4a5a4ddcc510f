"""gpsim diagnose: files of the contract, a plant that steps, and one line for every bad input."""

import errno
import json
import re
from pathlib import Path

import numpy as np
import pytest
import yaml
from gpsim.cli.main import app
from jsonschema import Draft202012Validator
from typer.testing import CliRunner

from gpsim.diagnosis import Diagnosis, schema
from gpsim.errors import UsageError
from gpsim.recordings import write_recording
from gpsim.stages.diagnose import read_corrected, read_diagnosis

from .worlds import World, record

pytestmark = pytest.mark.pictures

ROOT = Path(__file__).parent.parent.parent


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    path = tmp_path_factory.mktemp("recording")
    world = World("slider", filters=[lambda u, t, h, m: 0.5 * u])
    write_recording(record(world, seed=1, episodes=5, steps=105), path, "csv")
    return path


@pytest.fixture(scope="module")
def diagnosed(folder, tmp_path_factory):
    out = tmp_path_factory.mktemp("out") / "diagnosis"
    result = CliRunner().invoke(
        app, ["diagnose", str(folder), "--simulator", "slider", "--out", str(out), "--explain"]
    )
    assert result.exit_code == 0, result.output
    return out, result.output


def test_it_prints_the_account_its_parts_in_order(diagnosed):
    out, said = diagnosed
    account, ranked = said[said.index("Verdict  ") :].split("Every hypothesis", 1)  # behind what stderr says
    heads = [line.split()[0] for line in account.splitlines() if line[:1].strip()]
    assert heads == ["Verdict", "Where", "What", "Left", "Fit", "Next"]
    assert account.startswith(("Verdict  ambiguous: ", "Verdict  named: "))  # a mass as well as a gain
    assert f"gpsim.Diagnosis.load({str(out)!r}).corrected()" in account or "'DIR'" in account
    assert "nats" not in account
    assert "nats behind the chosen one" in ranked
    assert len(account.splitlines()) <= 25
    assert max(map(len, account.splitlines())) <= 100


def test_it_is_exported_without_a_word_about_where_its_recording_lies(diagnosed):
    out, _ = diagnosed
    result = CliRunner().invoke(app, ["export", "diagnosis", str(out), "--mcap"])
    assert result.exit_code == 0, result.output
    assert f"export: {out}.mcap" in result.output
    assert "/real beside /base, /corrected" in result.output


def test_the_ranking_begins_with_the_answer_and_holds_all_that_was_fitted(diagnosed):
    out, said = diagnosed
    report = json.loads((out / "diagnosis.json").read_text())
    best = report["ranking"][0]
    options = [report["effects"], *(a["effects"] for a in report["alternatives"])]
    assert best["effects"] in [[[e["family"], e["on"]] for e in option] for option in options]
    assert best["windows"] == "all"
    assert best["nats_behind"] == 0.0
    for windows in ("all", "search"):
        behind = [entry["nats_behind"] for entry in report["ranking"] if entry["windows"] == windows]
        assert behind == sorted(behind)
    ranked, decided = said.split("Every hypothesis", 1)[1].split("Every decision", 1)
    assert re.findall("chosen  |refused|given up|not ruled|costs more|fits worse", ranked)[0] == "chosen  "
    assert sum(line.startswith("  ") for line in ranked.splitlines()) == len(report["ranking"])
    trace = [json.loads(line) for line in (out / "trace.jsonl").read_text().splitlines()]
    assert {"rung 1"} <= {decision["step"] for decision in trace}
    for decision in trace:
        assert decision["rule"] in decided


def test_the_files_keep_the_contract(diagnosed):
    out, _ = diagnosed
    report = json.loads((out / "diagnosis.json").read_text())
    assert report["schema"] == "gpsim.diagnosis/2"
    assert set(report) >= {"verdict", "location", "effects", "alternatives", "tell_apart", "fit", "remainder"}
    assert report["fit"]["held_out"] == ["4"]
    for effect in report["effects"] + [e for other in report["alternatives"] for e in other["effects"]]:
        assert set(effect) >= {
            "family", "on", "site", "parameters", "region", "since", "since_episode",
            "probability", "evidence_gain", "explains", "sentence",
        }  # fmt: skip
        assert effect["evidence_gain"] > 0
        for parameter in effect["parameters"].values():
            assert set(parameter) >= {"value", "low", "high", "unit"}
            assert parameter["low"] <= parameter["value"] <= parameter["high"]
    assert set(report["location"]) >= {"channels", "region", "since", "depends_on"}
    assert set(report["location"]["channels"]) == {"q_acc"}
    assert 0.0 <= report["location"]["channels"]["q_acc"] <= 1.0
    assert report["location"]["depends_on"] == ["force"]
    assert set(report["fit"]) >= {"held_out", "one_step", "rollout"}
    rollout = report["fit"]["rollout"]
    assert set(rollout) == {"horizon_s", "q", "q_dot"}
    assert rollout["horizon_s"] == pytest.approx(1.0)
    kinds = {"before", "tuned", "gp", "after", "after_gp", "noise_floor"}
    for unit, row in (
        ("m/s^2", report["fit"]["one_step"]["q_acc"]),
        ("m", rollout["q"]),
        ("m/s", rollout["q_dot"]),
    ):
        assert set(row) >= kinds | {"unit"}
        assert row["unit"] == unit
        assert all(row[kind] >= 0 for kind in kinds)
    assert rollout["q"]["after"] < 0.2 * rollout["q"]["before"]
    assert set(report["remainder"]) >= {"structured", "depends_on", "p_value"}
    assert report["remainder"]["structured"] is False
    assert report["remainder"]["depends_on"] == []
    assert 0.0 <= report["remainder"]["p_value"] <= 1.0
    errors = report["fit"]["one_step"]["q_acc"]
    assert errors["after"] < errors["before"]
    assert errors["after"] < 1.3 * errors["noise_floor"]
    assert {p.name for p in (out / "figures").iterdir()} == {
        "decomposition.png",
        "held_out_rollout.png",
        "residual_inputs.png",
        "residual_time.png",
        "traces.png",
    }
    assert f"Verdict: {report['verdict']}" in (out / "report.html").read_text()


def test_the_file_is_what_the_schema_and_the_object_say(diagnosed):
    text = (diagnosed[0] / "diagnosis.json").read_text(encoding="utf-8")
    report, told = json.loads(text), schema()
    Draft202012Validator(told).validate(report)
    several = {
        "recordings",
        "own",
        "brought",
        "curve",
        "kinematics",
    }  # of several recordings, of one's own effects, of curves and of seen tools alone
    assert list(report) == [name for name in told["properties"] if name not in several]
    named = told["$defs"]["NamedEffect"]["properties"]
    assert list(report["effects"][0]) == [name for name in named if name not in several]
    assert json.dumps(Diagnosis.from_dict(report).to_dict(), indent=2) + "\n" == text
    assert read_diagnosis(diagnosed[0]) == Diagnosis.from_dict(report)


def test_white_noise_gets_no_gaussian_process(diagnosed):
    out, said = diagnosed
    report = json.loads((out / "diagnosis.json").read_text())
    assert report["remainder"]["gp"] == {"used": False, "beside": None, "why_not": "it has no structure"}
    for row in (report["fit"]["one_step"]["q_acc"], report["fit"]["rollout"]["q"]):
        assert row["after_gp"] == row["after"] != row["gp"]
    assert not list(out.glob("gp.*"))
    assert json.loads((out / "corrected.json").read_text())["gp"] is False
    below = (out / "report.html").read_text()
    assert "No Gaussian process on what is left: it has no structure." in below
    assert "a Gaussian process has learnt" not in said + below


def test_every_key_is_told_in_the_docs(diagnosed):
    out, _ = diagnosed
    report = json.loads((out / "diagnosis.json").read_text())
    told = (ROOT / "docs" / "reference" / "files.md").read_text(encoding="utf-8")
    part = report["fit"]["one_step"]["q_acc"]
    (effect,) = report["effects"]
    (parameter,) = effect["parameters"].values()
    of_effects = [*effect, *parameter, *report["ranking"][0]]
    for key in [*report, *report["location"], *report["fit"], *part, *report["remainder"], *of_effects]:
        assert re.search(rf"\b{key}\b", told), key


def test_the_corrected_simulator_steps_in_batches(diagnosed):
    out, _ = diagnosed
    rng = np.random.default_rng(0)
    for gp in (False, True):
        plant = read_corrected(out, gp)
        state, memory = np.zeros((3, 2)), plant.begin(3, rng)
        for _ in range(10):
            state = plant.step(state, np.full((3, 1), 4.0), memory, rng)
        np.testing.assert_allclose(state[:, 1], 0.2 * 4.0 * 0.5 / 2.0, rtol=0.02)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda meta: meta.update(state={"q": "m", "speed": "m/s"}), "speed"),
        (lambda meta: meta.update(state={"q": "mm", "q_dot": "m/s"}), "mm"),
        (lambda meta: meta.update(integrator="magic"), "magic"),
        (
            lambda meta: meta.update(parameters={"weight": 1.0}),
            "remove it from `parameters:` in recording.yaml",
        ),
        (lambda meta: meta.update(action={"push": "N"}), "push"),
        (
            lambda meta: meta.update(noise={"q": -0.1}),
            "noise.q: a standard deviation must be at least 0, got -0.1",
        ),
        (
            lambda meta: meta.update(held_out={"episodes_from": 1.5}),
            "held_out.episodes_from: expected a whole number, got 1.5",
        ),
        (
            lambda meta: meta.update(held_out={"episodes_from": 1, "time_from": 2.0}),
            "held_out: use only one of episodes_from, time_from and share",
        ),
    ],
)
def test_a_mismatch_is_one_line(folder, tmp_path, change, message):
    meta = yaml.safe_load((folder / "recording.yaml").read_text())
    change(meta)
    (tmp_path / "recording.yaml").write_text(yaml.safe_dump(meta))
    (tmp_path / "recording.csv").write_bytes((folder / "recording.csv").read_bytes())
    result = CliRunner().invoke(
        app, ["diagnose", str(tmp_path), "--simulator", "slider", "--out", str(tmp_path / "o")]
    )
    assert isinstance(result.exception, UsageError)
    assert message in str(result.exception)
    assert "\n" not in str(result.exception)


@pytest.mark.parametrize(
    ("fault", "message"),
    [
        ("short", "too short to judge: 28 transitions make"),
        ("very short", "too short to judge: 2 transitions, 12 at the least; record more"),
        (
            "numbered rows",
            "530 episodes have one row: the column `episode` must name episodes, not count rows",
        ),
        ("constant", "nothing moves: q, q_dot never change from episode 0 to episode 4"),
        ("nan", "recording.csv: episode 0, row 6, channel q: nan is not finite"),
    ],
)
def test_bad_data_are_one_line(folder, tmp_path, fault, message):
    lines = (folder / "recording.csv").read_text().splitlines()
    if fault == "short":
        lines = lines[:30]
    elif fault == "very short":
        lines = lines[:4]
    elif fault == "numbered rows":
        lines = [lines[0], *(f"{i},{row.partition(',')[2]}" for i, row in enumerate(lines[1:]))]
    elif fault == "constant":
        lines = [
            lines[0],
            *(",".join([*row.split(",")[:2], "1.0", "0.0", row.split(",")[-1]]) for row in lines[1:]),
        ]
    else:
        lines[7] = lines[7].replace(lines[7].split(",")[2], "nan")
    (tmp_path / "recording.csv").write_text("\n".join(lines) + "\n")
    meta = yaml.safe_load((folder / "recording.yaml").read_text())
    del meta["held_out"]
    (tmp_path / "recording.yaml").write_text(yaml.safe_dump(meta))
    result = CliRunner().invoke(app, ["diagnose", str(tmp_path), "--out", str(tmp_path / "o")])
    assert isinstance(result.exception, UsageError)
    assert message in str(result.exception)
    assert "\n" not in str(result.exception)
    assert not (tmp_path / "o").exists()


def test_a_description_that_cannot_be_read_is_one_line(folder, tmp_path, monkeypatch):
    def refuse(*_, **__):
        raise PermissionError(errno.EACCES, "Permission denied", "recording.yaml")

    monkeypatch.setattr("gpsim.recordings.yaml_data.regular_bytes", refuse)
    result = CliRunner().invoke(app, ["diagnose", str(folder), "--out", str(tmp_path / "o")])
    assert isinstance(result.exception, UsageError)
    assert "recording.yaml: cannot be read (Permission denied)" in str(result.exception)


def test_a_bare_table_needs_a_simulator(folder, tmp_path):
    (tmp_path / "log.csv").write_bytes((folder / "recording.csv").read_bytes())
    result = CliRunner().invoke(app, ["diagnose", str(tmp_path / "log.csv"), "--out", str(tmp_path / "o")])
    assert isinstance(result.exception, UsageError)
    assert "--simulator" in " ".join(result.exception.table)


@pytest.mark.parametrize(
    ("word", "message"),
    [
        (
            "simulator=slider",
            "beside a RECORDING give --simulator NAME; parameters, integrator and dt come from",
        ),
        ("simulator.parameters.mass=0.5", "beside a RECORDING give --simulator NAME; parameters"),
        ("simulator.integrator=rk4", "beside a RECORDING give --simulator NAME; parameters"),
        ("++simulator.parameters.mass=0.5", "beside a RECORDING give --simulator NAME; parameters"),
        ("recording=elsewhere", "beside a RECORDING give the RECORDING alone"),
        ("collect.episodes=3", "not used with a RECORDING; valid settings: seed, diagnose.episodes"),
        ("~target", "not used with a RECORDING; valid settings"),
    ],
)
def test_a_setting_that_would_be_ignored_is_refused(folder, tmp_path, word, message):
    result = CliRunner().invoke(app, ["diagnose", str(folder), word, "--out", str(tmp_path / "o")])
    assert isinstance(result.exception, UsageError)
    assert str(result.exception).startswith(f"diagnose: {word}: {message}")
    assert not (tmp_path / "o").exists()


def test_settings_that_count_beside_a_recording_are_taken(folder):
    words = ["seed=3", "diagnose.episodes=2", "experiment=limo", "runs_dir=elsewhere"]
    result = CliRunner().invoke(app, ["diagnose", str(folder), *words, "--show-config"])
    assert result.exit_code == 0, result.output
    assert "seed: 3" in result.output
