"""The whole loop on a tiny budget: complete, repeatable to the byte, and safe to kill."""

import json
import os
import random
import resource
import signal
import subprocess
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from budgets import TINY
from cli_calls import called
from shared_loop import LOOP, finished_loop

from gpsim.artifacts import MANIFEST, folder_digests, read_artifact


def run_loop(folder: Path, *more: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run([*LOOP, *more], cwd=folder, capture_output=True, text=True, check=False)


def versions(folder: Path) -> list[Path]:
    return sorted(path.parent for path in folder.glob(f"runs/*/*/v*/{MANIFEST}"))


@pytest.fixture(scope="module")
def finished(tmp_path_factory):
    """The folder, and what was said on stderr."""
    folder, _, said = finished_loop(tmp_path_factory)
    return folder, said


@pytest.fixture
def gpsim(monkeypatch, capfd):
    return lambda *words: called(monkeypatch, capfd, *words)


@pytest.mark.slow
def test_every_policy_of_the_loop_can_learn_from_an_expert(tmp_path):
    ended = run_loop(tmp_path, "policy=expert", "policy.expert_rounds=1", "task.max_steps=60")
    assert ended.returncode == 0, ended.stderr
    for stage in ("train-source", "train-gp-policy"):
        tables = [path / "checkpoints.csv" for path in tmp_path.glob(f"runs/cartpole/{stage}/v*")]
        assert len(tables) == 3
        for table in tables:
            assert table.read_text().startswith("steps,score,success,length\n0,")


def test_the_loop_leaves_every_artifact_and_a_report(finished):
    folder, said = finished
    count = {
        name: len(list(folder.glob(f"runs/cartpole/{name}/v*")))
        for name in ("train-source", "train-gp-policy")
    }
    assert count == {"train-source": 6, "train-gp-policy": 6}
    for path in versions(folder):
        read_artifact(path)
    summary = json.loads((folder / "runs/cartpole/report/v0001/summary.json").read_text())
    assert summary["experiment"] == "cartpole"
    assert summary["seeds"] == [0, 1]
    policies = {"Source", "Domain randomisation", "GP-Mean", "GP-Sample", "Effects", "Target"}
    for key in ("returns", "returns_all", "returns_certified"):
        assert set(summary[key]) == policies
    assert summary["returns_all"]["Target"]["episodes"] == 24
    assert {"mean", "std", "episodes", "interval"} <= set(summary["returns_all"]["Source"])
    assert set(summary["share"]) == {"returns", "returns_all", "returns_certified"}
    assert set(summary["own_simulator"]) == set(summary["returns_all"])
    # A Target policy's own simulator is the target.
    assert summary["own_simulator"]["Target"] == pytest.approx(summary["returns_all"]["Target"]["mean"])
    assert {"nrmse", "r2"} <= set(summary["one_step"]["x_acc"]["mean"])
    page = (folder / "runs/cartpole/report/v0001/report.html").read_text()
    assert "GP-Sample" in page
    assert "Traceback" not in said


def test_a_second_run_makes_nothing_anew(finished, tree, gpsim, monkeypatch):
    folder, _ = finished
    monkeypatch.chdir(folder)
    before = tree(folder)
    code, _, said = gpsim("run", "full-loop", *TINY, "--seeds", "2")
    assert code == 0
    assert "made" not in said
    assert tree(folder) == before


@pytest.mark.slow
def test_the_same_seed_gives_the_same_bytes(finished, tmp_path, tree):
    folder, _ = finished
    assert run_loop(tmp_path, "--seeds", "2", "runs_dir=elsewhere").returncode == 0
    (tmp_path / "elsewhere").rename(tmp_path / "runs")
    assert tree(tmp_path) == tree(folder)


@contextmanager
def started(folder: Path, **pipes: int) -> Iterator[subprocess.Popen[str]]:
    """The loop in a process group of its own; where it still runs at the end of the block, it is killed."""
    process = subprocess.Popen(
        LOOP,
        cwd=folder,
        text=True,
        start_new_session=True,
        preexec_fn=lambda: signal.signal(
            signal.SIGINT, signal.SIG_DFL
        ),  # a shell's background jobs ignore it
        **pipes,
    )
    with process:
        try:
            yield process
        finally:
            if process.poll() is None:
                os.killpg(process.pid, signal.SIGKILL)


def kill_at_random_moments(folder: Path, kills: int, longest: float, seed: int) -> None:
    """Start the loop and kill it, again and again: SIGKILL to all of it or to its parent alone, or Ctrl-C."""
    rng = random.Random(seed)
    for _ in range(kills):
        with started(folder, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL) as process:
            time.sleep(rng.uniform(0.2, longest))
            how = rng.choice(["group", "parent", "interrupt"])
            if how == "group":
                os.killpg(process.pid, signal.SIGKILL)
            elif how == "parent":
                process.kill()
            else:
                os.killpg(process.pid, signal.SIGINT)
            process.wait(timeout=60)
        for path in versions(folder):
            read_artifact(path)


def wait_for_more(folder: Path, known: int = 0) -> None:
    """Until the loop has made an artifact."""
    deadline = time.monotonic() + 120
    while len(versions(folder)) <= known and time.monotonic() < deadline:
        time.sleep(0.05)


def test_killed_and_carried_on(finished, tmp_path_factory, gpsim, monkeypatch):
    """In the middle of it: the first half has been made before."""
    folder, _, _ = finished_loop(tmp_path_factory, "train-gp-policy", "certify", "evaluate", "report")
    with started(folder, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL) as process:
        wait_for_more(folder, len(versions(folder)))
        os.killpg(process.pid, signal.SIGKILL)
    for path in versions(folder):
        read_artifact(path)
    monkeypatch.chdir(folder)
    code, out, said = gpsim("run", "full-loop", *TINY, "--jobs", "1")
    assert code == 0, said
    assert "Traceback" not in said
    summary = json.loads(Path(out.splitlines()[-1]).read_text())
    assert summary["seeds"] == [0]
    # What survived the kill and what was made after it is what an undisturbed run makes, to the byte.
    undisturbed, mine = (
        {digest for name, digest in folder_digests(place / "runs").items() if name.endswith(".safetensors")}
        for place in (finished[0], folder)
    )
    assert mine <= undisturbed
    assert not list(folder.glob("runs/*/*/.tmp-*"))


@pytest.mark.slow
def test_killed_many_times(tmp_path):
    kill_at_random_moments(tmp_path, kills=12, longest=20.0, seed=2)
    assert run_loop(tmp_path).returncode == 0
    for path in versions(tmp_path):
        read_artifact(path)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("asked", "code"), [(signal.SIGINT, 130), pytest.param(signal.SIGTERM, 143, marks=pytest.mark.slow)]
)
def test_ctrl_c_and_a_request_to_end_say_how_to_carry_on(tmp_path, asked, code):
    with started(tmp_path, stdout=subprocess.PIPE, stderr=subprocess.PIPE) as process:
        wait_for_more(tmp_path)
        os.killpg(process.pid, asked)
        _, shown = process.communicate(timeout=120)
    assert process.returncode == code
    assert shown.splitlines()[-1].startswith("interrupted: finished artifacts are complete"), shown
    assert "Traceback" not in shown
    assert not list(tmp_path.glob("runs/*/*/.*"))
    for path in versions(tmp_path):
        read_artifact(path)


@pytest.mark.slow
def test_a_full_disk_ends_in_one_line_and_loses_nothing(tmp_path):
    """A limit on the size of files stands for the disk: the policy's file no longer fits."""
    command = [*LOOP[:3], "train-source", *TINY]
    full = subprocess.run(
        command,
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=False,
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (4_000, 4_000)),
    )
    assert full.returncode == 2
    assert full.stderr.startswith("error: ")
    assert "no space left" in full.stderr
    assert full.stderr.count("\n") == 1
    assert not list(tmp_path.glob("runs/*/*/*"))
    assert subprocess.run(command, cwd=tmp_path, capture_output=True, check=False).returncode == 0


def test_the_loop_trains_with_what_its_own_diagnosis_named(finished, gpsim, monkeypatch):
    folder, _ = finished
    for seed in (0, 1):
        manifest = json.loads(
            (folder / f"runs/cartpole/train-gp-policy/v000{3 * (seed + 1)}/manifest.json").read_text()
        )
        assert manifest["config"]["correction"] == "effects"
        assert manifest["seeds"] == {"seed": seed}
        assert manifest["parents"]["diagnosis"]["stage"] == "diagnose"
    words = ["train-gp-policy", *TINY, "correction=effects+gp", "diagnosis=runs/cartpole/diagnose/v0002"]
    monkeypatch.chdir(folder)
    code, _, said = gpsim(*words)
    assert code == 0, said
