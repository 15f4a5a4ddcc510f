"""Tutorials are walked as they stand: every command works at once, and the account is what they say.

On a smoke budget, which .ci/run spends, each command of some pages gets a few words more, which make it small.
"""

import json
import os
import re
import shlex
import shutil
import signal
import subprocess
import sys
import time
from functools import partial
from pathlib import Path

import pytest
from budgets import TINY

ROOT = Path(__file__).resolve().parents[2]
TUTORIAL = ROOT / "docs" / "tutorial"
NOTEBOOK = TUTORIAL / "from_log_to_picture.ipynb"
MADE = "runs/*/*/v*/manifest.json"
LONGEST = 200  # letters of a message: two lines of a terminal
DEADLINE = 3000  # s, of one command: a hang is no answer
CAR = {
    ("actuator_delay", "v_cmd"): 0.12,
    ("actuator_delay", "w_cmd"): 0.12,
    ("actuator_gain", "v_cmd"): 0.9,
    ("actuator_bias", "w_cmd"): 0.03,
}
MOTOR = {("actuator_dead_band", "voltage"): 0.6, ("coulomb_friction", "angle"): 0.012}
ARM = {("payload", "fore"): 0.4, ("coulomb_friction", "shoulder"): 0.6, ("coulomb_friction", "elbow"): 0.35}
QUICK = "diagnose.curves.most=0"
SMALL = {  # what a command of the beginning on the left gets on a smoke budget
    "gpsim diagnose data/": f"diagnose.episodes=2 'diagnose.families.only=[coulomb_friction,actuator_delay]' {QUICK}",
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


def shell(line, folder, **more):
    """A line in Bash, by a user whose home is the folder; its process."""
    path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    own = {"PATH": path, "COLUMNS": "100", "OMP_NUM_THREADS": "1", "HOME": str(folder)}
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
    words = [
        "bash",
        "-c",
        f"{line}\nexit $?",
    ]  # with a line after it, Bash stays there as the command's parent
    return subprocess.Popen(words, cwd=folder, env=os.environ | own, **pipes, **more)


def walked(name, folder, change=str):
    """Run every block of a page where there is nothing but data/ and docs/examples; what each line printed."""
    for part in ("data", "docs/examples"):
        shutil.copytree(ROOT / part, folder / part)
    page, said = (TUTORIAL / f"{name}.md").read_text(encoding="utf-8"), {}
    for block in re.findall(r"^```sh\n(.*?)^```", page, flags=re.MULTILINE | re.DOTALL):
        for line in block.splitlines():
            process = shell(change(line), folder)
            said[line], notes = process.communicate(timeout=DEADLINE)
            assert process.returncode == 0, f"{line}\n{said[line]}{notes}"
            assert "Traceback" not in notes
            assert max(map(len, notes.splitlines()), default=0) <= LONGEST, notes
    return said


def small(line):
    """The same command on a smoke budget."""
    words = next((words for start, words in SMALL.items() if line.startswith(start)), "")
    return f"{line} {words}".rstrip()


def read(path):
    return json.loads(path.read_text(encoding="utf-8"))


def claimed(folder):
    """What an account claims: (family, on) -> parameters, each with its value."""
    effects = [
        effect for effect in read(folder / "diagnosis.json")["effects"] if effect["role"] == "headline"
    ]
    return {(e["family"], e["on"]): {n: p["value"] for n, p in e["parameters"].items()} for e in effects}


def check(folder, truth):
    """The account names just these effects, with the first size of each."""
    assert read(folder / "diagnosis.json")["verdict"] == "named"
    found = {place: next(iter(sizes.values())) for place, sizes in claimed(folder).items()}
    assert found == pytest.approx(truth, rel=0.03)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["first_diagnosis", "cartpole", "limo", "own_effect"])
def test_a_tutorial_runs_on_a_smoke_budget(name, tmp_path):
    walked(name, tmp_path, small)


@pytest.mark.slow
def test_a_cars_bag_and_the_same_as_a_table_and_as_a_matlab_file(tmp_path):
    walked("car", tmp_path)
    for name in ("car", "odd", "mat"):
        check(tmp_path / "runs" / name, CAR)


@pytest.mark.slow
def test_a_motor_of_ones_own(tmp_path):
    said = walked("motor", tmp_path)
    check(tmp_path / "runs" / "motor", MOTOR)
    assert '"runs"' in said["gpsim --json runs list"]


@pytest.mark.slow
def test_an_arm_with_servos_is_corrected_and_then_lacks_nothing(tmp_path):
    said = walked("servo_arm", tmp_path)
    check(tmp_path / "runs" / "arm", ARM)
    assert read(tmp_path / "runs" / "arm_later" / "diagnosis.json")["verdict"] == "none"
    assert "payload on fore" in "".join(said.values())


@pytest.mark.slow
def test_everyday_commands_an_interruption_and_the_tab_key(tmp_path):
    default = partial(signal.signal, signal.SIGINT, signal.SIG_DFL)  # a shell's background jobs ignore it
    process = shell(
        "exec gpsim run full-loop budget=smoke", tmp_path, start_new_session=True, preexec_fn=default
    )
    while not list(tmp_path.glob(MADE)) and process.poll() is None:
        time.sleep(0.05)
    os.killpg(process.pid, signal.SIGINT)
    _, notes = process.communicate(timeout=DEADLINE)
    assert process.returncode == 130
    assert notes.splitlines()[-1].startswith("interrupted: finished artifacts are complete")
    made = {path: path.stat().st_mtime_ns for path in tmp_path.glob(MADE)}
    said = walked("everyday", tmp_path)
    assert made == {path: path.stat().st_mtime_ns for path in made}  # the same command went on from there
    assert "coulomb_friction" in said["gpsim effects list"]
    assert read(tmp_path / "runs.json")["exit_code"] == 0
    for line, word in (("gpsim diagn", "diagnose"), ("gpsim diagnose --simulator pend", "pendulum")):
        asked = f"COMP_WORDS=({line}); COMP_CWORD={line.count(' ')}; _gpsim_completion gpsim"
        printed, notes = shell(f'. ~/.bashrc; {asked}; echo "${{COMPREPLY[@]}}"', tmp_path).communicate()
        assert printed.split() == [word], notes


@pytest.mark.slow
def test_the_first_diagnosis_finds_what_the_rig_was_made_with(tmp_path):
    said = walked("first_diagnosis", tmp_path)
    check(tmp_path / "runs/found", {("coulomb_friction", "x"): 2.5, ("actuator_delay", "force"): 0.03})
    assert (tmp_path / "runs/deploy/policy.onnx").exists()
    shown = said["head -3 data/cart.csv"]
    assert "\n    ".join(shown.splitlines()) in (TUTORIAL / "first_diagnosis.md").read_text(encoding="utf-8")


@pytest.mark.slow
def test_the_effect_of_ones_own_is_named_with_its_sizes(tmp_path):
    said = walked("own_effect", tmp_path)
    assert "yes, named: rubber_band on q" in "".join(said.values())
    assert claimed(tmp_path / "found").keys() == {("rubber_band", "q")}
    assert claimed(tmp_path / "found")["rubber_band", "q"]["weight"] == pytest.approx(1.0, rel=0.05)
    assert ("rubber_band", "q") not in claimed(tmp_path / "without")


@pytest.mark.slow
def test_the_cartpole_loop_ends_with_a_policy_that_lasts(tmp_path):
    walked("cartpole", tmp_path)
    found = claimed(next((tmp_path / "runs/cartpole/diagnose").glob("v*/diagnosis.json")).parent)
    assert found.keys() == {("coulomb_friction", "x")}
    assert found["coulomb_friction", "x"]["coefficient"] == pytest.approx(0.9, rel=0.01)
    returns = read(tmp_path / "runs/cartpole/report/v0001/summary.json")["returns"]
    assert returns["Effects"]["mean"] > returns["Source"]["mean"] + 100


@pytest.mark.slow
def test_the_limos_bag_leads_to_its_turning_radius_and_a_policy(tmp_path):
    walked("limo", tmp_path)
    radius = claimed(tmp_path / "runs/found")["minimum_turning_radius", "vehicle"]["radius"]
    assert radius == pytest.approx(0.462, rel=0.02)
    assert (tmp_path / "runs/deploy/drive_to_goal.py").exists()


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
