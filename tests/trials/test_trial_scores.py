"""Scores are never stale, what is dear to find out is kept, and no trial stops another; diagnoses are made up here."""

import errno
import json
import os
import shutil

import pytest
from gpsim.cli.main import app
from typer.testing import CliRunner

from gpsim.errors import UsageError
from gpsim.launchers import Local
from gpsim.stages import prove
from gpsim.trials import blinding, sindy
from gpsim.trials import fits as kept
from gpsim.trials.blinding import (
    diagnose_blind,
    publish_hashes,
    published,
    read_report,
    reveal,
    trial_name,
    write_trial,
)
from gpsim.trials.fits import Rival
from gpsim.trials.scoring import score_trial

SEED, NUMBERS = 5, (10, 2)
NAME, OTHER = "0010", "0002"  # a slider whose actuator has a bias, and another world
TWIN = Rival((("constant_force", "q"),), 0.5, False)


def effect(family, on):
    return {"family": family, "on": on, "probability": 0.99, "region": {}, "since": None, "parameters": {}}


def said(*effects):
    """The diagnosis that names these effects."""
    return {
        "verdict": "named" if effects else "none",
        "effects": list(effects),
        "alternatives": [],
        "location": {"channels": {"q_acc": 0.9}, "region": {}, "since": None},
        "fit": {"held_out": [], "one_step": {}},
    }


def say(out, name, report):
    (out / "diagnoses" / name / "diagnosis" / "diagnosis.json").write_text(json.dumps(report))


MADE_UP = f"""
from pathlib import Path
Path("diagnosis").mkdir()
Path("diagnosis", "diagnosis.json").write_text({json.dumps(said(effect("constant_force", "q")))!r})
"""  # what runs in place of a diagnosis


def instead(monkeypatch, *lines):
    """Diagnoses are made up from now on, and these lines run after them."""
    monkeypatch.setattr(blinding, "COMMAND", "\n".join((MADE_UP, "import os, sys", *lines)))


@pytest.fixture(scope="module")
def concealed(tmp_path_factory):
    out = tmp_path_factory.mktemp("proof")
    digests = {trial_name(n): write_trial(out, SEED, n) for n in NUMBERS}
    publish_hashes(out, digests)
    return out


@pytest.fixture
def proof(concealed, tmp_path, monkeypatch):
    out = tmp_path / "proof"
    shutil.copytree(concealed, out)
    instead(monkeypatch)
    for name in (NAME, OTHER):
        diagnose_blind(out, name)
    return out


@pytest.fixture
def fits(monkeypatch):
    """The rule for equivalents, made up; the list counts how often it was asked."""
    asked = []
    monkeypatch.setattr(kept, "rivals", lambda *given: asked.append(given) or [TWIN])
    monkeypatch.setattr(sindy, "installed", lambda: False)
    return asked


def run_here(work, numbers, launcher, progress):
    return [(number, work(number)) for number in numbers]


def test_a_score_is_made_anew_while_its_equivalents_are_kept(proof, fits):
    private = proof / "private"
    assert score_trial(proof, private, NAME)["right"]
    kept = json.loads((proof / "equivalents" / f"{NAME}.json").read_text())
    assert kept["rivals"] == [{"claims": [["constant_force", "q"]], "nats_lost": 0.5, "richer": False, "equivalent": True}]  # fmt: skip
    say(proof, NAME, said(effect("spring", "q")))
    assert not score_trial(proof, private, NAME)["right"]
    assert not json.loads((proof / "scores" / f"{NAME}.json").read_text())["right"]
    assert len(fits) == 1


@pytest.mark.parametrize("changed", ["version", "answer_sha256", "recording"])
def test_equivalents_of_something_else_are_found_anew(proof, fits, changed):
    path = proof / "equivalents" / f"{NAME}.json"
    score_trial(proof, proof / "private", NAME)
    path.write_text(json.dumps(json.loads(path.read_text()) | {changed: None}))
    score_trial(proof, proof / "private", NAME)
    path.unlink()
    score_trial(proof, proof / "private", NAME)
    assert len(fits) == 3


def test_pysindy_installed_later_is_asked_then(proof, fits, monkeypatch):
    monkeypatch.setattr(sindy, "applies", lambda content: True)
    assert score_trial(proof, proof / "private", NAME)["sindy"] is None
    monkeypatch.setattr(sindy, "installed", lambda: True)
    monkeypatch.setattr(sindy, "name", lambda recording: (("constant_force", "q"),))
    found = score_trial(proof, proof / "private", NAME)
    assert found["sindy"] == {"said": [["constant_force", "q"]], "right": True}
    monkeypatch.setattr(sindy, "installed", lambda: False)
    assert score_trial(proof, proof / "private", NAME)["sindy"] == found["sindy"]
    assert len(fits) == 1


def test_a_recording_that_was_exchanged_after_its_diagnosis_is_refused(proof):
    with (proof / "public" / NAME / "recording.csv").open("a") as stream:
        stream.write("\n")
    with pytest.raises(UsageError, match="not the diagnosed recording"):
        reveal(proof, proof / "private", NAME)


def test_the_hash_on_record_is_the_one_that_stood_there_before_the_diagnosis(
    concealed, tmp_path, monkeypatch
):
    out = tmp_path / "proof"
    shutil.copytree(concealed, out)
    before = published(out)[NAME]

    path = str(out / "public" / "answers.sha256")
    instead(
        monkeypatch, f"Path({path!r}).write_text(Path({path!r}).read_text().replace({before!r}, '0' * 64))"
    )
    assert diagnose_blind(out, NAME)["answer_sha256"] == before


def test_a_published_hash_is_never_replaced(proof):
    before = published(proof)
    with pytest.raises(UsageError, match=f"another answer to trial {NAME} was published"):
        publish_hashes(proof, {NAME: "0" * 64})
    assert published(proof) == before


def test_recordings_that_somebody_else_concealed_are_not_drawn_anew(proof):
    """Whoever was handed public/ alone and asks for a whole proof must not lose it."""
    shutil.rmtree(proof / "private")
    before = {p: p.read_bytes() for p in (proof / "public").rglob("*") if p.is_file()}
    result = CliRunner().invoke(app, ["prove", "--out", str(proof), "--trials", "2"])
    assert isinstance(result.exception, UsageError)
    assert "gpsim prove diagnose --out" in str(result.exception)
    assert {p: p.read_bytes() for p in (proof / "public").rglob("*") if p.is_file()} == before


@pytest.mark.parametrize(("code", "words"), [(1, "error: the disk is full"), (-9, "killed by signal 9")])
def test_a_diagnosis_that_failed_after_it_was_written_is_none(concealed, tmp_path, monkeypatch, code, words):
    out = tmp_path / "proof"
    shutil.copytree(concealed, out)
    ends = f"sys.exit({code})" if code > 0 else f"os.kill(os.getpid(), {-code})"
    instead(monkeypatch, "print('error: the disk is full', file=sys.stderr, flush=True)", ends)
    outcome = diagnose_blind(out, NAME)
    assert outcome["error"] == words
    assert read_report(out, NAME) is None


def test_a_recording_without_a_published_hash_is_not_diagnosed(proof):
    shutil.copytree(proof / "public" / NAME, proof / "public" / "0099")
    with pytest.raises(UsageError, match="no hash of the answer to trial 0099"):
        diagnose_blind(proof, "0099")
    assert not (proof / "diagnoses" / "0099").exists()


def test_a_trial_that_cannot_be_scored_is_wrong_and_stops_no_other(proof, fits, monkeypatch):
    monkeypatch.setattr(prove, "run_trials", run_here)
    say(proof, NAME, {"verdict": "named"})
    content = prove.reveal(proof, None, Local(1), lambda *_: None)
    assert content["all"]["n"] == 2
    assert content["not_scored"] == [NAME]
    assert NAME in content["misses"]
    told = {miss["trial"]: miss for miss in json.loads((proof / "prove.json").read_text())["every_miss"]}
    assert set(told) == set(content["misses"])
    assert told[NAME]["error"].startswith("not scored: KeyError")
    score = json.loads((proof / "scores" / f"{NAME}.json").read_text())
    assert not score["right"]
    assert score["error"].startswith("not scored: KeyError")
    for name in ("report.html", "record.md"):
        assert "not scored: KeyError" in (proof / name).read_text()


def test_what_was_not_diagnosed_and_by_which_commit_the_rest_was_is_said(proof, fits, monkeypatch):
    monkeypatch.setattr(prove, "run_trials", run_here)
    shutil.rmtree(proof / "diagnoses" / OTHER)
    path = proof / "diagnoses" / NAME / "outcome.json"
    path.write_text(json.dumps(json.loads(path.read_text()) | {"git_commit": "abc"}))
    result = CliRunner().invoke(app, ["prove", "reveal", "--out", str(proof)])
    assert result.exit_code == 0, result.output
    content = json.loads((proof / "prove.json").read_text())
    assert content["undiagnosed"] == [OTHER]
    assert content["diagnosed_under"] == ["abc"]
    assert "1 of 2 published trials were not diagnosed" in " ".join(result.output.split())
    for name in ("report.html", "record.md"):
        text = (proof / name).read_text()
        assert OTHER in text
        assert "abc" in text


def full_disk(*_):
    raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))


def test_a_file_in_place_of_the_proofs_folder_is_one_line(tmp_path):
    out = tmp_path / "proof"
    out.write_text("a file where a folder should be")
    result = CliRunner().invoke(app, ["prove", "conceal", "--out", str(out), "--trials", "1", "--jobs", "1"])
    assert isinstance(result.exception, UsageError)
    assert str(result.exception) == f"{out}: cannot write here (Not a directory); choose another --out"


@pytest.mark.parametrize("written", ["prove.json", "equivalents"])
def test_a_full_disk_is_one_line_and_nobodys_wrong_answer(proof, fits, monkeypatch, written):
    monkeypatch.setattr(prove, "run_trials", run_here)
    with monkeypatch.context() as during:
        during.setattr(prove if written == "prove.json" else kept, "write_json", full_disk)
        with pytest.raises(UsageError, match="proof: no space left on the device"):
            prove.reveal(proof, None, Local(1), lambda *_: None)
    assert not list(proof.glob("*prove.json*"))
    assert prove.reveal(proof, None, Local(1), lambda *_: None)["not_scored"] == []


@pytest.mark.parametrize("words", ["error: runs: no space left on the device; free space and run again", "Traceback:\nOSError: [Errno 28] No space left on device: 'x'"])  # fmt: skip
def test_a_diagnosis_for_which_the_disk_had_no_space_is_made_again(concealed, tmp_path, monkeypatch, words):
    out = tmp_path / "proof"
    shutil.copytree(concealed, out)
    instead(monkeypatch, f"sys.exit({words!r})")
    with pytest.raises(UsageError, match="no space left"):
        diagnose_blind(out, NAME)
    assert not (out / "diagnoses").exists()
    instead(monkeypatch)
    assert diagnose_blind(out, NAME)["exit"] == 0


def test_where_no_disk_has_room_to_diagnose_in_it_is_said(concealed, tmp_path, monkeypatch):
    out = tmp_path / "proof"
    shutil.copytree(concealed, out)

    def nowhere():
        raise FileNotFoundError(errno.ENOENT, "No usable temporary directory found in ['/tmp']")

    monkeypatch.setattr(blinding.tempfile, "gettempdir", nowhere)
    with pytest.raises(UsageError, match=r"\['/tmp'\]: free space there, or name a folder with TMPDIR"):
        diagnose_blind(out, NAME)
