"""Shell completion: what follows, where it is cut at `=` and where not, without waiting for a library."""

import json
import os
import subprocess
import sys

import pytest
from gpsim.cli import completion

ASKED = """
import contextlib, io, json, os, sys
from gpsim.cli.main import main

sys.argv, said = ["gpsim"], []
for line in json.load(sys.stdin):
    os.environ |= {"COMP_WORDS": line, "COMP_CWORD": str(len(line.split(" ")) - 1)}
    with contextlib.redirect_stdout(io.StringIO()) as out, contextlib.suppress(SystemExit):
        main()
    said.append(out.getvalue().split())
heavy = {"torch", "scipy", "matplotlib", "pandas", "hydra", "omegaconf"} & set(sys.modules)
print(json.dumps([said, sorted(heavy)]))
"""


@pytest.fixture
def folder(tmp_path):
    """A folder with artifacts, a log and a recording."""
    for name in ("collect/v0001", "diagnose/v0001", "diagnose/v0002", "train-source/v0001"):
        (tmp_path / "runs/cartpole" / name).mkdir(parents=True)
        (tmp_path / "runs/cartpole" / name / "manifest.json").write_text("{}")
    (tmp_path / "runs/cartpole/diagnose/.making").mkdir()
    (tmp_path / "drive.bag").touch()
    (tmp_path / "drive.txt").touch()
    (tmp_path / "mine.yaml").touch()
    return tmp_path


FOLLOW = {
    "gpsim fit-gp gp.n_tr": ["gp.n_train="],
    "gpsim fit-gp gp=ju": ["gp=jump"],
    "gpsim fit-gp gp = ju": ["jump"],  # as Bash cuts it
    "gpsim fit-gp experiment =": ["cartpole", "limo", "mujoco"],
    "gpsim run full-loop budget=": ["budget=smoke", "budget=thesis"],
    "gpsim diagnose dri": ["drive.bag"],
    "gpsim diagnose --simulator pend": ["pendulum"],
    "gpsim diagnose drive.bag --simulator pendulum th": ["theta=", "theta_dot="],
    "gpsim diagnose x diagnose.families.only=[spring,back": [],
    "gpsim diagnose x diagnose.families.only=[spring,visc": ["diagnose.families.only=[spring,viscous_friction"],
    "gpsim diagnose --score runs/c": ["runs/cartpole/diagnose/v0002", "runs/cartpole/diagnose/v0001", "runs/cartpole/"],
    "gpsim diagnose --mapping mi": ["mine.yaml"],
    "gpsim import --mapping em": ["emps"],
    "gpsim export policy runs/cartpole/t": ["runs/cartpole/train-source/v0001", "runs/cartpole/train-source/"],
    "gpsim export recording --format p": ["parquet"],
    "gpsim build-residuals recording=runs/cartpole/co": ["recording=runs/cartpole/collect/v0001", "recording=runs/cartpole/collect/"],
    "gpsim prove conceal --stratum u": ["unknown"],
    "gpsim prove co": ["conceal"],
}  # fmt: skip


def test_what_may_follow_without_waiting_for_a_library(folder):
    """What Bash would be given for the last word of a line."""
    env = os.environ | {"_GPSIM_COMPLETE": "complete_bash"}
    words, lines = [sys.executable, "-c", ASKED], json.dumps(list(FOLLOW))
    ended = subprocess.run(
        words, env=env, input=lines, capture_output=True, text=True, cwd=folder, check=False
    )
    assert ended.returncode == 0, ended.stderr
    said, heavy = json.loads(ended.stdout)
    assert dict(zip(FOLLOW, said, strict=True)) == FOLLOW
    assert heavy == []


def test_every_choice_and_key_that_is_offered_is_one(folder):
    from gpsim.cli.configuration import resolve

    together = ("budget", "experiment", "target", "task")
    groups = {group: choices for group, choices in completion.groups().items() if group not in together}
    for nth in range(max(map(len, groups.values()))):
        resolve([f"{group}={choices[nth % len(choices)]}" for group, choices in groups.items()], None)
    keys = completion.keys()
    assert {"seed", "gp.n_train", "diagnose.windows.length", "collect.mapping"} <= set(keys)
    config = resolve([], None)
    assert {key.split(".")[0] for key in keys} <= set(config)


def test_a_script_is_there_to_be_installed(folder):
    env = {**os.environ, "_TYPER_COMPLETE_TEST_DISABLE_SHELL_DETECTION": "1"}
    words = [sys.executable, "-m", "gpsim", "--show-completion", "bash"]
    shown = subprocess.run(words, env=env, capture_output=True, text=True, cwd=folder, check=False).stdout
    assert "_GPSIM_COMPLETE=complete_bash" in shown or "complete" in shown
