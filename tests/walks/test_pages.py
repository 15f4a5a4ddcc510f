"""Pages for a first day are walked as they stand: every command works at once, and the account is what they say."""

import json
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
CAR = {
    ("actuator_delay", "v_cmd"): 0.12,
    ("actuator_delay", "w_cmd"): 0.12,
    ("actuator_gain", "v_cmd"): 0.9,
    ("actuator_bias", "w_cmd"): 0.03,
}
MOTOR = {("actuator_dead_band", "voltage"): 0.6, ("coulomb_friction", "angle"): 0.012}
ARM = {("payload", "fore"): 0.4, ("coulomb_friction", "shoulder"): 0.6, ("coulomb_friction", "elbow"): 0.35}


def walked(name, folder):
    """Run every block of a page where there is nothing but data/ and docs/examples; all that was printed."""
    for part in ("data", "docs/examples"):
        shutil.copytree(ROOT / part, folder / part)
    path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    environment = os.environ | {"PATH": path, "COLUMNS": "100", "OMP_NUM_THREADS": "1"}
    page, said = (ROOT / "docs" / "tutorial" / f"{name}.md").read_text(encoding="utf-8"), ""
    for block in re.findall(r"^```sh\n(.*?)^```", page, flags=re.MULTILINE | re.DOTALL):
        for line in block.splitlines():
            done = subprocess.run(
                line, shell=True, cwd=folder, env=environment, capture_output=True, text=True, check=False
            )
            assert done.returncode == 0, f"{line}\n{done.stdout}{done.stderr}"
            said += done.stdout
    return said


def found(folder):
    """The first size of every effect that an account claims, by family and place; and its verdict."""
    told = json.loads((folder / "diagnosis.json").read_text(encoding="utf-8"))
    claims = [e for e in told["effects"] if e["role"] == "headline"]
    return told["verdict"], {
        (e["family"], e["on"]): next(iter(e["parameters"].values()))["value"] for e in claims
    }


def check(folder, truth):
    assert found(folder) == ("named", pytest.approx(truth, rel=0.03))


@pytest.mark.slow
def test_a_cars_bag_and_the_same_as_a_table_and_as_a_matlab_file(tmp_path):
    walked("car", tmp_path)
    for name in ("car", "odd", "mat"):
        check(tmp_path / "runs" / name, CAR)


@pytest.mark.slow
def test_a_motor_of_ones_own(tmp_path):
    said = walked("motor", tmp_path)
    check(tmp_path / "runs" / "motor", MOTOR)
    assert '"runs"' in said


@pytest.mark.slow
def test_an_arm_with_servos_is_corrected_and_then_lacks_nothing(tmp_path):
    said = walked("servo_arm", tmp_path)
    check(tmp_path / "runs" / "arm", ARM)
    assert found(tmp_path / "runs" / "arm_later") == ("none", {})
    assert "payload on fore" in said
