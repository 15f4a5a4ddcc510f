"""Blind: the diagnosis sees recordings and nothing else; an answer counts only if it is the published one."""

import json
import re
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from gpsim.cli.main import app
from typer.testing import CliRunner

from gpsim.errors import UsageError
from gpsim.files import file_digest
from gpsim.recordings import read_recording
from gpsim.recordings.files import write_recording
from gpsim.recordings.recording import Recording
from gpsim.trials.blinding import diagnose_blind, publish_hashes, read_report, reveal, write_trial

EPISODES, ROWS = 8, 131
SEED, NUMBER, NAME = 5, 10, "0010"  # a slider whose actuator has a bias


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    """Where the trial lies as it was written, and its digest."""
    out = tmp_path_factory.mktemp("written")
    return out, write_trial(out, SEED, NUMBER)


@pytest.fixture(scope="module")
def concealed(written, tmp_path_factory):
    out = tmp_path_factory.mktemp("short") / "proof"
    shutil.copytree(written[0], out)
    _shorten(out)
    publish_hashes(out, {NAME: file_digest(out / "private" / NAME / "answer.json")})
    return out


def _shorten(out: Path) -> None:
    """Keep what a test has the time for, eight short episodes, in both halves."""
    public, private = out / "public" / NAME, out / "private" / NAME
    whole = read_recording(public)
    episodes = tuple(
        replace(e, t=e.t[:ROWS], states=e.states[:ROWS], actions=e.actions[: ROWS - 1])
        for e in whole.episodes[:EPISODES]
    )
    short: Recording = replace(whole, episodes=episodes, held_out=None)
    write_recording(short, public, "csv")
    with np.load(private / "truth.npz") as truth:
        starts = np.cumsum(truth["rows"]) - truth["rows"]
        clean = np.concatenate([truth["clean"][s : s + ROWS] for s in starts[:EPISODES]])
        own = np.concatenate([truth["own"][truth["episode"] == e][: ROWS - 1] for e in range(EPISODES)])
    index = np.repeat(np.arange(EPISODES), ROWS - 1)
    np.savez(private / "truth.npz", clean=clean, rows=np.full(EPISODES, ROWS), own=own, episode=index)
    content = json.loads((private / "answer.json").read_text())
    content["truth_sha256"] = file_digest(private / "truth.npz")
    (private / "answer.json").write_text(json.dumps(content))


@pytest.fixture(scope="module")
def diagnosed(concealed, tmp_path_factory):
    """Diagnosed with the answers moved away, out of the diagnosis's reach."""
    away = tmp_path_factory.mktemp("away") / "private"
    shutil.move(concealed / "private", away)
    assert diagnose_blind(concealed, NAME)["exit"] == 0
    assert not (concealed / "private").exists()
    return concealed, away


def test_the_public_half_is_a_recording_and_nothing_else(written):
    out, _ = written
    answer = json.loads((out / "private" / NAME / "answer.json").read_text())
    folder = out / "public" / NAME
    assert sorted(p.name for p in folder.iterdir()) == ["recording.csv", "recording.yaml"]
    text = (folder / "recording.yaml").read_text()
    keys = set(re.findall(r"^(\w+):", text, re.MULTILINE))
    assert keys <= {"system", "parameters", "integrator", "dt", "state", "action", "velocities", "clock", "noise", "held_out"}  # fmt: skip
    for effect in answer["effects"]:
        assert effect["family"] not in text


def test_a_diagnosis_needs_no_answers_and_finds_the_effect(diagnosed):
    out, away = diagnosed
    report = read_report(out, NAME)
    truth = json.loads((away / NAME / "answer.json").read_text())["effects"][0]
    claims = [e["family"] for e in report["effects"]] + [
        e["family"] for a in report["alternatives"] for e in a["effects"]
    ]
    twins = {"actuator_bias": "constant_force", "constant_force": "actuator_bias"}  # of a slide or a pendulum
    assert {truth["family"], twins.get(truth["family"])} & set(claims)


def test_an_answer_that_does_not_match_its_hash_is_refused(diagnosed, tmp_path):
    out, away = diagnosed
    reveal(out, away, NAME)
    private = tmp_path / "private"
    shutil.copytree(away, private)
    path = private / NAME / "answer.json"
    path.write_text(path.read_text().replace('"visible": true', '"visible": false'))
    with pytest.raises(UsageError, match="does not match the hash published"):
        reveal(out, private, NAME)
    # Changing the published hash afterwards does not help: the diagnosis wrote down which one stood there.
    other = tmp_path / "other"
    shutil.copytree(out, other)
    (other / "public" / "answers.sha256").write_text(f"{file_digest(path)}  {NAME}\n")
    with pytest.raises(UsageError, match="when it was diagnosed"):
        reveal(other, private, NAME)


def test_a_truth_that_was_exchanged_is_refused(diagnosed, tmp_path):
    out, away = diagnosed
    private = tmp_path / "private"
    shutil.copytree(away, private)
    with (private / NAME / "truth.npz").open("ab") as stream:
        stream.write(b"x")
    with pytest.raises(UsageError, match="truth.npz"):
        reveal(out, private, NAME)


@pytest.mark.slow
def test_the_proof_is_scored_with_the_equivalents_that_the_rule_finds(diagnosed, tmp_path):
    """A bias of a slider's actuator is a constant force; the rule finds that by itself."""
    diagnosed_out, away = diagnosed
    out = tmp_path / "proof"
    shutil.copytree(diagnosed_out, out)
    result = CliRunner().invoke(
        app, ["prove", "reveal", "--out", str(out), "--answers", str(away), "--jobs", "1"]
    )
    assert result.exit_code == 0, result.output
    content = json.loads((out / "prove.json").read_text())
    score = json.loads((out / "scores" / f"{NAME}.json").read_text())
    assert [["constant_force", "q"]] in score["equivalents"]
    assert [["viscous_friction", "q"]] not in score["equivalents"]
    assert content["all"]["single"]["n"] == 1
    assert content["all"]["single"]["right"] == int(score["right"])
    assert content["rivals"]["gp"]["n"] == 1
    page = (out / "report.html").read_text()
    assert "http:" not in page
    assert "https:" not in page
    assert score["right"] or f"diagnoses/{NAME}/diagnosis/report.html" in page
    record = (out / "record.md").read_text()
    assert f"| one effect: right | >= 0.97 | {'1.00' if score['right'] else '**0.00** !'} |" in record


MJCF = "prove conceal --system mjcf --out x"
REFUSED = {
    "prove": "",
    "prove --out x diagnose": "",
    "prove --seed 7 conceal --out x": "",
    "prove --no-long conceal --out x": "",
    "prove reveal --out nowhere": "",
    "prove diagnose --out nowhere": "no hashes",
    "prove answers nowhere": "",
    "prove conceal --out x --stratum odd": "no stratum 'odd'",
    "prove conceal --out x --stratum machines": "--machines 20",
    "prove conceal --out x --stratum whole": "--system mjcf --robots 20",
    "prove conceal --out x --robots 3": "--robots: such robots need --system mjcf",
    "prove conceal --out x --floating 3": "--floating: such robots need --system mjcf",
    "prove conceal --out x --trials 0": "no worlds",
    f"{MJCF} --rough 3": "cannot be combined with --rough",
    f"{MJCF} --machines 2": "--rough, --machines",
    f"{MJCF} --plan 2": "--plan and --no-long",
    f"{MJCF} --stratum triple": "no stratum 'triple' of --system mjcf",
}


@pytest.mark.parametrize("words", REFUSED)
def test_bad_input_is_one_line(words, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    result = CliRunner().invoke(app, words.split())
    assert isinstance(result.exception, UsageError)
    assert REFUSED[words] in str(result.exception)
    assert not list(tmp_path.iterdir())
