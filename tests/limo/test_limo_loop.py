"""The Limo's whole loop on a tiny budget: complete, repeatable to the byte, with a stand-in and with its bag alone."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

from gpsim.artifacts import MANIFEST, read_artifact

TINY = (
    "experiment=limo",
    "budget=smoke",
    "policy.total_steps=480",
    "policy.checkpoint_every=240",
    "policy.checkpoint_episodes=8",
    "task.max_steps=40",
    "evaluate.episodes=16",
    "evaluate.rollouts=6",
)
LOOP = [sys.executable, "-m", "gpsim.cli.main", "run", "full-loop", "--jobs", "1", *TINY]

pytestmark = pytest.mark.slow


def run_loop(folder: Path, *more: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run([*LOOP, *more], cwd=folder, capture_output=True, text=True, check=False)


@pytest.fixture(scope="module")
def finished(tmp_path_factory):
    folder = tmp_path_factory.mktemp("limo")
    ended = run_loop(folder)
    assert ended.returncode == 0, ended.stderr
    return folder, ended


def test_the_loop_leaves_every_artifact_and_says_who_got_there(finished):
    folder, ended = finished
    for path in sorted(p.parent for p in folder.glob(f"runs/*/*/v*/{MANIFEST}")):
        read_artifact(path)
    summary = json.loads((folder / ended.stdout.splitlines()[-1]).read_text())
    assert summary["experiment"] == "limo"
    policies = {"Source", "Domain randomisation", "GP-Mean", "GP-Sample", "Effects", "Target"}
    for key in ("success", "success_all", "success_certified", "returns_all"):
        assert set(summary[key]) == policies
    target = summary["success_all"]["Target"]
    assert target["episodes"] == 16
    assert {"rate", "interval", "by_seed", "behind", "ahead", "steps", "path", "of_target"} <= set(target)
    assert {"v", "w"} <= set(summary["one_step"])
    page = (folder / "runs/limo/report/v0001/report.html").read_text()
    assert "Goals reached on the target" in page
    assert "Traceback" not in ended.stderr


def test_the_same_seed_gives_the_same_bytes(finished, tmp_path, tree):
    folder, _ = finished
    assert run_loop(tmp_path).returncode == 0
    assert tree(tmp_path) == tree(folder)


def test_a_bag_as_the_target_runs_what_it_can_and_says_why_not_the_rest(finished, tmp_path):
    folder, _ = finished
    bag = folder / "runs/limo/collect/v0001/bags/drive.bag"
    words = ["target=recording", f"collect.source={bag}", "evaluate.policies=[Source,GP-Mean,Target]"]
    ended = run_loop(tmp_path, *words)
    assert ended.returncode == 0, ended.stderr
    assert "no returns: the target is a log" in ended.stdout
    summary = json.loads((tmp_path / ended.stdout.splitlines()[-1]).read_text())
    assert "returns_all" not in summary
    assert {"v", "w"} <= set(summary["one_step"])
    assert set(summary["rollout"]) >= {"Source", "GP-Mean", "GP-Sample"}
    assert not list(tmp_path.glob("runs/limo/certify"))
    # The loop's own recording and the one that is read from its bag are the same, to the byte.
    mine, theirs = (p / "runs/limo/collect/v0001/recording.parquet" for p in (tmp_path, folder))
    assert mine.read_bytes() == theirs.read_bytes()
