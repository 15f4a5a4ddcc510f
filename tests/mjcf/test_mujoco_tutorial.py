"""docs/tutorial/mujoco.md and drone.md: their blocks are run in their order."""

import json
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
PAGE, DRONE = (
    (ROOT / "docs" / "tutorial" / name).read_text(encoding="utf-8") for name in ("mujoco.md", "drone.md")
)
DIAGNOSE = "gpsim diagnose data/arm.csv"
QUICK = (
    "diagnose.episodes=2 'diagnose.families.only=[coulomb_friction on elbow]' diagnose.curves.most=0 "
    "diagnose.closed_step.fitted=16 diagnose.closed_step.searched=8"
)
LESS = {"learn(6_000)": "learn(60)", "learning_starts=500": "learning_starts=20"}


def played(folder, quick, page=PAGE):
    """Run a page in a folder that holds data/ alone; what each block printed."""
    shutil.copytree(ROOT / "data", folder / "data")
    path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    environment = os.environ | {"PATH": path, "COLUMNS": "100", "OMP_NUM_THREADS": "1"}
    said, python = [], []
    for kind, block in re.findall(r"^```(sh|python)\n(.*?)^```", page, flags=re.MULTILINE | re.DOTALL):
        if kind == "python":
            python.append(block)
            continue
        for line in block.splitlines():
            words = f"{line} {QUICK}" if quick and line.startswith(DIAGNOSE) else line
            said.append(ran(words, folder, environment, shell=True))
    text = "\n".join(python)
    for was, now in LESS.items() if quick else ():
        assert was in text
        text = text.replace(was, now)
    said.append(ran([sys.executable, "-W", "ignore", "-c", text], folder, environment))
    return said


def ran(words, folder, environment, shell=False):
    done = subprocess.run(
        words, shell=shell, cwd=folder, env=environment, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, f"{words}\n{done.stdout}{done.stderr}"
    return done.stdout


def patch(folder):
    content = json.loads((folder / "runs" / "model" / "patch.json").read_text())
    return {(e["family"], e["on"]): e["where"] for e in content["effects"]}


@pytest.mark.slow
def test_the_page_runs_on_a_smoke_budget(tmp_path):
    said = played(tmp_path, quick=True)
    assert said[0].splitlines()[1] in PAGE  # the log is shown as it is
    assert ("coulomb_friction", "elbow") in patch(tmp_path)
    assert "after 3 s: shoulder" in said[-1]


@pytest.mark.slow
def test_in_full_it_finds_what_the_arm_was_made_with_and_the_policy_holds_it_out(tmp_path):
    said = played(tmp_path, quick=False)
    assert patch(tmp_path)["coulomb_friction", "elbow"] == "attribute"
    assert patch(tmp_path)["actuator_dead_zone", "m1"] == "wrapper"
    for words in ("Verdict  named", "Coulomb friction on elbow", "actuator dead zone on m1"):
        assert any(words in text for text in said)
    shoulder, elbow = map(float, re.findall(r"(-?\d\.\d\d) rad", said[-1]))
    assert abs(shoulder - 0.4) < 0.25
    assert abs(elbow) < 0.25


@pytest.mark.slow
def test_the_drone_is_found_as_it_was_made_and_sinks_as_it_did(tmp_path):
    said = played(tmp_path, quick=False, page=DRONE)
    assert said[0].splitlines()[1] in DRONE
    content = json.loads((tmp_path / "runs" / "drone" / "diagnosis.json").read_text())
    found = {(e["family"], e["on"]): next(iter(e["parameters"].values())) for e in content["effects"]}
    true = {("parameter_offset", "frame.mass"): 1.125, ("constant_force", "base.x"): 0.4}
    true |= {("viscous_friction", "base.surge"): 0.25, ("viscous_friction", "base.sway"): 0.35}
    true |= {("actuator_lag", f"thrust{i}"): 0.04 for i in range(1, 5)}
    assert set(found) == set(true)
    for claim, value in true.items():
        assert found[claim]["low"] <= value <= found[claim]["high"], claim
    (sunk,) = map(float, re.findall(r"after 1 s: (-?\d\.\d\d) m", said[-1]))
    assert -1.0 < sunk < -0.7
