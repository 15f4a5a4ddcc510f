"""`--json`: one object on stdout that its schema describes, of every command, whether it ends well or not."""

import json
import subprocess
import sys
from pathlib import Path

import jsonschema
import pytest
from budgets import TINY
from cli_calls import ANSWER, SCHEMA
from gpsim.cli.main import app

from gpsim.stages import prove
from gpsim.trials import blinding

STAGES = (
    "train-source", "collect", "build-residuals", "fit-gp", "diagnose", "train-gp-policy", "certify", "evaluate",
)  # fmt: skip


def read(out):
    """The object, which is all that was written, and is what the schema says."""
    assert out.count("\n") == 1, out
    content = json.loads(out)
    ANSWER.validate(content)
    return content


def leaves(app, path=()):
    """Every command that does something, as it is typed."""
    found = [(*path, command.name) for command in app.registered_commands]
    for group in app.registered_groups:
        inner = group.typer_instance
        found += leaves(inner, (*path, group.name))
        if inner.registered_callback is not None and inner.info.invoke_without_command is True:
            found.append((*path, group.name))
    return found


def test_the_schema_is_one_and_knows_every_command():
    jsonschema.Draft202012Validator.check_schema(SCHEMA)
    known = SCHEMA["then"]["properties"]["command"]["enum"]
    assert sorted(known) == sorted(" ".join(path) for path in leaves(app))


def test_the_schema_refuses_what_it_does_not_know():
    good = {"schema": "gpsim.cli/1", "command": "export policy", "exit_code": 0, "warnings": [], "notes": []}
    good["paths"] = {"policy": "/a", "export": "/b"}
    ANSWER.validate(good)
    changes = {"paths": {}, "more": 1, "command": "export", "schema": "gpsim.cli/2", "exit_code": 2}
    for change in ({key: value} for key, value in changes.items()):
        with pytest.raises(jsonschema.ValidationError):
            ANSWER.validate({**good, **change})


def test_the_loop_says_where_everything_lies_and_its_progress_aside(loop):
    _, out, err = loop
    content = read(out)
    assert content["command"] == "run full-loop"
    assert {job["made"] for job in content["jobs"]} == {True}
    assert all(Path(job["folder"], "manifest.json").is_file() for job in content["jobs"])
    assert all(Path(path).exists() for path in content["paths"].values())
    compared = {row["policy"] for row in content["figures"]["table"]}
    assert compared >= {"Source", "GP-Sample", "Effects", "Target"}
    assert any("outside the range" in line for line in content["warnings"])
    assert "made certify" in err
    assert "Return on the target" in err  # the tables, for whoever looks on


@pytest.mark.parametrize("stage", [*STAGES, "report"])
def test_every_stage_of_the_loop(loop, stage, gpsim, monkeypatch):
    monkeypatch.chdir(loop[0])
    code, out, err = gpsim(stage, *TINY, "--json")
    assert code == 0, err
    content = read(out)
    assert content["command"] == stage
    assert Path(content["paths"]["folder"]).parent.name == stage
    assert content.get("made") in (False, None if stage == "report" else False)
    figures = content.get("figures", {})
    if stage == "diagnose":
        whole = json.loads(Path(content["paths"]["diagnosis"]).read_text())
        assert content["verdict"] == whole["verdict"] == "named"
        assert content["explained"] == whole["explained"]["rollout"]
        assert content["effects"][0]["parameters"] == whole["effects"][0]["parameters"]
        assert content["fit"]["one_step"]["x_acc"]["after"] == whole["fit"]["one_step"]["x_acc"]["after"]
        assert content["fit"]["rollout"]["x"]["unit"] == "m"
    if stage == "evaluate":
        [row] = [r for r in figures["table"] if (r["policy"], r["starts"]) == ("Source", "all")]
        table = json.loads(Path(content["paths"]["evaluation"]).read_text())["returns_all"]
        assert row["mean"] == table["Source"]["mean"]
        assert row["episodes"] == 12
    if stage == "collect":
        found = [figures[key] for key in ("system", "episodes", "dt", "gaps")]
        assert found == ["cartpole", 6, 0.02, 0]
    if stage == "fit-gp":
        assert content["warnings"]
        assert not any("warning" in note for note in content["notes"])


def test_a_diagnosis_is_judged_on_another_recording(loop, gpsim, monkeypatch, tmp_path):
    monkeypatch.chdir(loop[0])
    diagnosis = Path("runs/cartpole/diagnose/v0001")
    words = ("--score", diagnosis, "--out", tmp_path / "s", "--json", "-q", "--cores", "1")
    code, out, err = gpsim("diagnose", "runs/cartpole/collect/v0001", *words)
    assert code == 0, err
    content = read(out)
    assert content["score"]["one_step"]["x_acc"]["after"] < content["score"]["one_step"]["x_acc"]["before"]
    assert Path(content["paths"]["diagnosis"]).samefile(diagnosis)
    assert err == ""  # --quiet leaves out the account for people, too


def test_a_log_comes_in_and_goes_out(cartpole_table, gpsim, tmp_path):
    code, out, err = gpsim("import", "--inspect", cartpole_table, "--json")
    assert code == 0
    inspected = read(out)
    assert [topic["fields"][:2] for topic in inspected["logs"][0]["topics"]] == [["t", "x"]]
    assert "system:" in inspected["mapping"]
    assert "numeric fields" in err

    code, out, err = gpsim("import", cartpole_table, "system=cartpole", "--out", tmp_path / "rec", "--json")
    assert code == 0, err
    content = read(out)
    figures = content["figures"]
    assert (figures["transitions"], figures["episodes"], figures["dt"], figures["gaps"]) == (59, 1, 0.02, 0)
    assert figures["action"] == {"force": "N"}
    assert Path(content["paths"]["import_report"]).is_file()
    assert "read = kept + dropped" in err

    code, out, _ = gpsim(
        "export", "recording", tmp_path / "rec", "--format", "csv", "--out", tmp_path / "e.csv", "--json"
    )
    assert code == 0
    assert Path(read(out)["paths"]["export"]) == tmp_path / "e.csv"


ANSWERED = [
    ("export policy runs/cartpole/train-source/v0001 --out {}/onnx", "export"),
    (
        "export diagnosis runs/cartpole/diagnose/v0001 --mcap --recording runs/cartpole/collect/v0001 --out {}/d",
        "export",
    ),
    ("collect experiment=limo --plan {}/plan.csv", "plan"),
    ("runs list", "runs"),
    ("runs show fit-gp/v1", "runs"),
    ("runs diff fit-gp/v1 collect/v1", "runs"),
    ("runs rm evaluate/v1 --with-dependents --dry-run", "runs"),
    ("runs gc --dry-run", "runs"),
]


@pytest.mark.parametrize(("words", "made"), ANSWERED)
def test_what_is_named_is_there(words, made, loop, gpsim, monkeypatch, tmp_path):
    monkeypatch.chdir(loop[0])
    code, out, err = gpsim(*words.format(tmp_path).split(), "--json")
    assert code == 0, err
    content = read(out)
    assert Path(content["paths"][made]).exists()
    assert content.get("removed", False) is False


@pytest.mark.parametrize("command", ["collect", "evaluate", "diagnose", "report", "run full-loop"])
def test_the_configuration_is_shown(command, gpsim):
    code, out, _ = gpsim(*command.split(), "gp.n_train=77", "--show-config", "--json")
    assert code == 0
    content = read(out)
    assert content["config"]["gp"]["n_train"] == 77
    assert content["paths"] == {}


def test_every_step_of_a_proof(gpsim, monkeypatch, tmp_path):
    """Of a diagnosis that fails at once: what it finds is of no interest here."""
    monkeypatch.setattr(blinding, "COMMAND", "raise SystemExit(2)")
    monkeypatch.setattr(prove, "run_trials", lambda job, numbers, *_: [(n, job(n)) for n in numbers])
    proof = ["--out", tmp_path / "proof"]
    code, out, err = gpsim("prove", "conceal", *proof, "--seed", 9, "--trials", 1, "--jobs", 1, "--json")
    assert code == 0, err
    assert read(out)["worlds"] == 1
    code, out, err = gpsim("prove", "answers", tmp_path / "proof", "--json")
    assert code == 0, err
    assert len(read(out)["answers"]) == 1
    code, out, err = gpsim("prove", "diagnose", *proof, "--jobs", 1, "--json")
    assert code == 0, err
    assert read(out)["diagnoses"] == 1
    code, out, err = gpsim("prove", "reveal", *proof, "--jobs", 1, "--json")
    assert code == 0, err
    content = read(out)
    assert content["summary"]["seed"] == 9
    assert content["summary"]["failed"] == ["0001"]
    assert Path(content["paths"]["summary"]).is_file()
    code, out, err = gpsim("--json", "prove", *proof, "--seed", 9, "--trials", 1, "--jobs", 1)
    assert code == 0, err
    assert read(out)["summary"] == content["summary"]


@pytest.mark.parametrize(
    ("words", "command", "message"),
    [
        ("diagnose nowhere --json", "diagnose", "nowhere: no such recording"),
        ("--json run full-loop gp.restarts=-1", "run full-loop", "gp: restarts must be at least 0"),
        ("export policy x --json", "export", "missing option '--out'"),
        ("fit-gp --json --bogus", "", "no such option: --bogus"),
        ("nonsense --json", "", "no such command 'nonsense'"),
    ],
)
def test_bad_input_is_an_object_too(words, command, message, gpsim):
    code, out, err = gpsim(*words.split())
    assert code == 2
    content = read(out)
    assert (content["exit_code"], content["error"]["kind"], content["command"]) == (2, "bad_input", command)
    assert message in content["error"]["message"]
    assert message.split(": ")[-1] in err


@pytest.mark.parametrize("words", ["diagnose --json --help", "--version --json", "--json --help"])
def test_help_and_version_are_for_people(words, gpsim):
    code, out, _ = gpsim(*words.split())
    assert code == 0
    assert "gpsim" in out
    assert "gpsim.cli/1" not in out


def test_a_fault_of_the_program_is_an_object_and_a_traceback(monkeypatch, capfd):
    from gpsim.cli import main as module

    monkeypatch.setattr("gpsim.cli.options.split_words", lambda words: 1 // 0)
    monkeypatch.setattr(sys, "argv", ["gpsim", "diagnose", "x", "--json"])
    with pytest.raises(ZeroDivisionError):
        module.main()
    content = read(capfd.readouterr().out)
    assert (content["exit_code"], content["error"]["kind"]) == (1, "internal")
    assert "ZeroDivisionError" in content["error"]["message"]


def test_an_interruption_is_an_object_too(gpsim, monkeypatch):
    def interrupted(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr("gpsim.stages.diagnose.open_recording", interrupted)
    code, out, err = gpsim("diagnose", "x", "--json")
    assert code == 130
    assert read(out)["error"]["kind"] == "interrupted"
    assert "interrupted" in err


def test_what_others_print_does_not_disturb_the_object(tmp_path):
    """A user's simulator may print, in this process and in those it starts."""
    code = (
        "import os, sys\n"
        "from gpsim.cli import main as module\n"
        "def loud(words):\n"
        "    print('from Python'); os.write(1, b'from below\\n')\n"
        "    raise module.UsageError('enough')\n"
        "sys.modules['gpsim.cli.options'].split_words = loud\n"
        "sys.argv = ['gpsim', 'diagnose', 'x', '--json']\n"
        "module.main()\n"
    )
    ended = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, cwd=tmp_path, check=False
    )
    assert ended.returncode == 2
    assert read(ended.stdout)["error"]["message"] == "enough"
    assert ended.stderr.splitlines() == ["from Python", "from below", "error: enough"]


@pytest.mark.parametrize("command", ["fit-gp", "diagnose", "report"])
def test_a_dry_run_says_how_it_stands(command, loop, gpsim, monkeypatch):
    monkeypatch.chdir(loop[0])
    code, out, err = gpsim(command, *TINY, "--dry-run", "--json")
    assert code == 0, err
    assert read(out)["standing"]["state"] == "there"


def test_the_status_of_a_loop(loop, gpsim, monkeypatch):
    monkeypatch.chdir(loop[0])
    code, out, err = gpsim("status", *TINY, "gp.n_train=17", "--json")
    assert code == 0, err
    standings = {s["stage"]: s for s in read(out)["status"]["standings"]}
    assert standings["collect"]["state"] == "there"
    assert standings["fit-gp"]["state"] == "to make"
    code, again, _ = gpsim("run", "full-loop", *TINY, "gp.n_train=17", "--dry-run", "--json")
    assert read(again)["status"] == read(out)["status"]
