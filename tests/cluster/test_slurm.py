"""A real SLURM on this machine: `make test-cluster`. Workers, slurmctld and the scheduler are killed, nothing is lost.

The jobs are drives of a random policy, a second or less each: what is tested is who runs them.
"""

import json
import os
import re
import shutil
import signal
import socket
import subprocess
import sys
import time
from collections import Counter
from pathlib import Path

import psutil
import pytest

from gpsim.artifacts import MANIFEST

pytestmark = pytest.mark.cluster
SCRIPT = Path(__file__).with_name("slurm.sh")
JOBS = 200
SWEEP = ["sweep", "--of", "collect", "collect.policy=random", "collect.episodes=300", f"seed=range({JOBS})"]
SLURM = [
    "launcher=slurm", "launcher.queue=test", "launcher.interface=lo", "launcher.memory=2GB", "launcher.maximum=4",
    "launcher.walltime='00:30:00'",
]  # fmt: skip


@pytest.fixture(scope="module")
def slurm(tmp_path_factory):
    """SLURM's folder; what it starts ends with the tests."""
    folder = tmp_path_factory.mktemp("slurm")
    started = subprocess.run([SCRIPT, "start", folder], capture_output=True, text=True, check=False)
    if started.returncode:
        pytest.fail(started.stderr.strip())
    os.environ["SLURM_CONF"] = str(folder / "slurm.conf")
    yield folder
    subprocess.run([SCRIPT, "stop", folder], check=False)
    del os.environ["SLURM_CONF"]


@pytest.fixture(scope="module")
def local(tmp_path_factory):
    """The same jobs in processes of this machine."""
    folder = tmp_path_factory.mktemp("local")
    done = subprocess.run(command(*SWEEP), cwd=folder, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return folder


def command(*words):
    return [sys.executable, "-m", "gpsim", *words]


def started(folder, *words):
    with (folder / "log").open("a") as log:
        return subprocess.Popen(command(*words), cwd=folder, stdout=log, stderr=log, start_new_session=True)


def finished(folder):
    """Version -> when it was finished, and the bytes of its manifest."""
    found = {p.parent: p for p in folder.glob(f"runs/cartpole/collect/v*/{MANIFEST}")}
    return {
        path.name: (manifest.stat().st_mtime_ns, manifest.read_text()) for path, manifest in found.items()
    }


def wait_until(reached, process, seconds=600):
    until = time.monotonic() + seconds
    while not reached():
        assert process.poll() is None, "the command ended before it was disturbed"
        assert time.monotonic() < until, "nothing happens"
        time.sleep(0.05)


def workers():
    """The Dask workers of SLURM jobs: each a nanny's process, which SLURM started, and the worker below it."""
    nannies = [
        p
        for p in psutil.process_iter(["cmdline"])
        if "distributed.cli.dask_worker" in (p.info["cmdline"] or [])
    ]
    return [(nanny, nanny.children(recursive=True)) for nanny in nannies]


def queue():
    listed = subprocess.run(
        ["squeue", "--me", "--noheader", "--format=%j"], capture_output=True, text=True, check=True
    )
    return listed.stdout.split()


def kill_scheduler(process):
    """It is a part of the command: nothing is cleaned up."""
    os.kill(process.pid, signal.SIGKILL)
    process.wait()


def test_nothing_finished_is_lost_or_run_twice_whatever_is_killed(slurm, local, tmp_path, tree):
    first = started(tmp_path, *SWEEP, *SLURM)
    wait_until(lambda: len(finished(tmp_path)) >= 80, first)
    _, below = next(pair for pair in workers() if pair[1])
    max(below, key=lambda p: p.memory_info().rss).kill()  # one worker, whose nanny starts another
    wait_until(lambda: len(finished(tmp_path)) >= 100, first)
    nanny, below = next(pair for pair in workers() if pair[1])
    for process in (nanny, *below):  # one with its nanny: its SLURM job ends
        process.kill()
    subprocess.run([SCRIPT, "restart", slurm], check=True)
    at = len(finished(tmp_path))  # when slurmctld is back
    wait_until(lambda: len(finished(tmp_path)) >= max(at + 10, 140), first)
    kill_scheduler(first)
    before = finished(tmp_path)
    assert 140 <= len(before) < JOBS, "killed too late to show anything"

    second = started(tmp_path, *SWEEP, *SLURM)
    assert second.wait(timeout=900) == 0, (tmp_path / "log").read_text()
    after = finished(tmp_path)
    assert len(after) == JOBS
    assert {name: after[name] for name in before} == before  # neither lost nor made again
    assert max(Counter(json.loads(text)["key"] for _, text in after.values()).values()) == 1
    log = (tmp_path / "log").read_text()
    assert "Traceback" not in log
    made = re.findall(r"^made collect · (seed=\d+)", log, re.MULTILINE)
    assert max(Counter(made).values()) == 1
    assert log.count("dashboard: http://") == 2

    shutil.rmtree(tmp_path / "runs/.slurm")
    assert tree(tmp_path) == tree(local)
    until = time.monotonic() + 60
    while (
        queue() and time.monotonic() < until
    ):  # of the killed command, too: workers end without their scheduler
        time.sleep(1)
    assert queue() == []


def test_slurm_that_takes_no_jobs_is_one_line(slurm, tmp_path):
    words = [
        "sweep",
        "--of",
        "collect",
        "collect.policy=random",
        "seed=1,2",
        *SLURM,
        "launcher.queue=elsewhere",
    ]
    done = subprocess.run(
        command(*words), cwd=tmp_path, capture_output=True, text=True, check=False, timeout=200
    )
    assert done.returncode == 2
    *_, last = done.stderr.splitlines()
    assert last.startswith("error: SLURM takes no jobs: sbatch: error:")
    assert "launcher.queue" in last
    assert "Traceback" not in done.stderr


def test_jobs_that_end_before_a_worker_starts_are_one_line(slurm, tmp_path):
    words = ["sweep", "--of", "collect", "collect.policy=random", "seed=1,2", *SLURM]
    words.append("launcher.setup=['echo no such module >&2','exit 1']")
    done = subprocess.run(
        command(*words), cwd=tmp_path, capture_output=True, text=True, check=False, timeout=200
    )
    assert done.returncode == 2
    *_, last = done.stderr.splitlines()
    assert "SLURM jobs end before a worker starts" in last
    assert "no such module" in last
    assert queue() == []


def test_a_job_that_fails_names_its_node(slurm, tmp_path):
    words = ["diagnose", "bad", "good", "--each", "--simulator", "slider", *SLURM]
    for name in ("bad", "good"):
        (tmp_path / name).mkdir()
        (tmp_path / name / "recording.yaml").write_text("system: slider\n")
        (tmp_path / name / "recording.csv").write_text("t\n")
    done = subprocess.run(
        command(*words), cwd=tmp_path, capture_output=True, text=True, check=False, timeout=200
    )
    assert done.returncode == 2
    assert f"(on {socket.gethostname()})" in done.stderr.splitlines()[-1]
