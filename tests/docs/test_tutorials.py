"""Every tutorial is run: its shell blocks, in order, in a folder that holds nothing but data/.

On a smoke budget each command gets a few words more, which make it small; in full (slow) they are run as they stand, and
what the page promises is held against what came out.
"""

import json
import os
import re
import shlex
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from budgets import TINY

ROOT = Path(__file__).resolve().parents[2]
TUTORIAL = ROOT / "docs" / "tutorial"
PAGES = (
    "first_diagnosis",
    "cartpole",
    "limo",
    "own_effect",
)  # up to a minute each: .ci/run runs them, `make test` does not
QUICK = "diagnose.curves.most=0"
FEW = "'diagnose.families.only=[coulomb_friction,actuator_delay]'"
SMALL = {  # what a command of the beginning on the left gets on a smoke budget
    "gpsim diagnose data/": f"diagnose.episodes=2 {FEW} {QUICK}",
    "gpsim diagnose runs/": f"'diagnose.families.only=[minimum_turning_radius,actuator_lag]' {QUICK}",
    "gpsim diagnose --score": "",
    "gpsim effects check": "--quick",
    "gpsim effects": "",
    "gpsim diagnose band": f"'diagnose.families.only=[viscous_friction]' {QUICK}",
    "gpsim import": "",
    "gpsim export": "",
    "gpsim collect experiment=limo": "budget=smoke",
    "gpsim train-gp-policy experiment=limo": "budget=smoke policy.total_steps=480",
    "gpsim": f"{shlex.join(TINY)} {QUICK}",
}
DEADLINE = 3000  # s, of one command: a hang is no answer


def blocks(name):
    """The lines of a tutorial's shell blocks."""
    text = (TUTORIAL / f"{name}.md").read_text(encoding="utf-8")
    return [
        line
        for block in re.findall(r"^```sh\n(.*?)^```$", text, flags=re.M | re.S)
        for line in block.splitlines()
    ]


def small(line):
    """The same command on a smoke budget."""
    words = next((words for start, words in SMALL.items() if line.startswith(start)), "")
    return f"{line} {words}".rstrip()


def run(name, folder, change=lambda line: line):
    """Run a tutorial in `folder`; what each of its commands printed."""
    shutil.copytree(ROOT / "data", folder / "data")
    environment = os.environ | {
        "PATH": f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}",
        "COLUMNS": "100",
    }
    said = {}
    for line in blocks(name):
        done = subprocess.run(
            change(line),
            shell=True,
            cwd=folder,
            env=environment,
            capture_output=True,
            text=True,
            timeout=DEADLINE,
            check=False,
        )
        assert done.returncode == 0, f"{line}\n{done.stdout}{done.stderr}"
        said[line] = done.stdout
    return said


@pytest.mark.parametrize("name", PAGES)
def test_a_tutorial_has_commands_and_what_it_names_is_there(name):
    lines = blocks(name)
    assert len(lines) >= 5
    assert all(
        small(line) != line
        or line.startswith(
            ("head", "cat", "sed", "gpsim effects", "gpsim import", "gpsim export", "gpsim diagnose --score")
        )
        for line in lines
    )
    for path in re.findall(r"\bdata/[\w.]+", "\n".join(lines)):
        assert (ROOT / path).exists()


@pytest.mark.slow
@pytest.mark.parametrize("name", PAGES)
def test_a_tutorial_runs_on_a_smoke_budget(name, tmp_path):
    run(name, tmp_path, small)


NOTEBOOK = TUTORIAL / "from_log_to_picture.ipynb"


def cells():
    """The code of the notebook, cell by cell."""
    return ["".join(c["source"]) for c in read(NOTEBOOK)["cells"] if c["cell_type"] == "code"]


def test_the_notebook_is_small_and_keeps_no_outputs():
    assert NOTEBOOK.stat().st_size < 5000
    assert read(NOTEBOOK)["nbformat"] == 4
    code = [c for c in read(NOTEBOOK)["cells"] if c["cell_type"] == "code"]
    assert all(c["outputs"] == [] and c["execution_count"] is None for c in code)
    for cell in cells():
        compile(cell, NOTEBOOK.name, "exec")


@pytest.mark.slow
def test_the_notebook_goes_from_a_log_to_a_picture(monkeypatch):
    monkeypatch.chdir(TUTORIAL)
    names = {}
    for cell in cells():
        exec(cell, names)
    assert names["found"].verdict == "named"
    force = names["table"].query("family == 'coulomb_friction' and parameter == 'force'").iloc[0]
    assert force.low < 2.5 < force.high
    assert force.place == "x"
    assert names["picture"].png.startswith(b"\x89PNG")
    assert "Coulomb friction on x" in names["found"]._repr_html_()


def read(path):
    return json.loads(path.read_text(encoding="utf-8"))


def claimed(path):
    """What a diagnosis claims: (family, on) -> parameters."""
    return {(e["family"], e["on"]): e["parameters"] for e in read(path)["effects"] if e["role"] == "headline"}


@pytest.mark.slow
def test_the_first_diagnosis_finds_what_the_rig_was_made_with(tmp_path):
    said = run("first_diagnosis", tmp_path)
    assert read(tmp_path / "runs/found/diagnosis.json")["verdict"] == "named"
    found = claimed(tmp_path / "runs/found/diagnosis.json")
    assert set(found) == {("coulomb_friction", "x"), ("actuator_delay", "force")}
    assert found["actuator_delay", "force"]["delay"]["value"] == pytest.approx(0.03, rel=0.02)
    assert "2.5" in next(text for line, text in said.items() if line.startswith("gpsim diagnose data/"))
    assert (tmp_path / "runs/deploy/policy.onnx").exists()
    shown = next(text for line, text in said.items() if line.startswith("head"))
    assert "\n    ".join(shown.splitlines()) in (TUTORIAL / "first_diagnosis.md").read_text(encoding="utf-8")


@pytest.mark.slow
def test_the_effect_of_ones_own_is_named_with_its_sizes(tmp_path):
    said = run("own_effect", tmp_path)
    assert "yes, named: rubber_band on q" in next(text for line, text in said.items() if "check" in line)
    found = claimed(tmp_path / "found/diagnosis.json")
    assert set(found) == {("rubber_band", "q")}
    assert found["rubber_band", "q"]["weight"]["value"] == pytest.approx(1.0, rel=0.05)
    assert ("rubber_band", "q") not in claimed(tmp_path / "without/diagnosis.json")


@pytest.mark.slow
def test_the_cartpole_loop_ends_with_a_policy_that_lasts(tmp_path):
    run("cartpole", tmp_path)
    found = claimed(next((tmp_path / "runs/cartpole/diagnose").glob("v*/diagnosis.json")))
    assert set(found) == {("coulomb_friction", "x")}
    assert found["coulomb_friction", "x"]["coefficient"]["value"] == pytest.approx(0.9, rel=0.01)
    returns = read(tmp_path / "runs/cartpole/report/v0001/summary.json")["returns"]
    assert returns["Effects"]["mean"] > returns["Source"]["mean"] + 100


@pytest.mark.slow
def test_the_limos_bag_leads_to_its_turning_radius_and_a_policy(tmp_path):
    run("limo", tmp_path)
    found = claimed(tmp_path / "runs/found/diagnosis.json")
    assert found["minimum_turning_radius", "vehicle"]["radius"]["value"] == pytest.approx(0.462, rel=0.02)
    assert (tmp_path / "runs/deploy/drive_to_goal.py").exists()
