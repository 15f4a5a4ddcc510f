"""A diagnosis that is killed, or whose disk is full, leaves a whole artifact or none, and the next one is the same."""

import os
import resource
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from gpsim.artifacts import folder_digests, read_artifact
from gpsim.recordings import write_recording

from .worlds import World, record

FEW = ["diagnose.families.only=[viscous_friction,spring]"]


def command(folder: Path, out: Path, cores: int = 2) -> list[str]:
    words = ["diagnose", str(folder), "--simulator", "slider", "--out", str(out), "--cores", str(cores), *FEW]
    return [sys.executable, "-m", "gpsim.cli.main", *words]


def of_session(leader: int) -> list[int]:
    """Processes of a session that still run."""
    found = []
    for entry in Path("/proc").glob("[0-9]*/stat"):
        try:
            state, _, _, session = entry.read_text().rpartition(")")[2].split()[:4]
        except OSError:  # it ended meanwhile
            continue
        if int(session) == leader and state != "Z":
            found.append(int(entry.parent.name))
    return found


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    path = tmp_path_factory.mktemp("recording")
    world = World("slider", forces={0: lambda q, v, t: -1.0 * v})
    write_recording(record(world, seed=6, episodes=4, steps=85), path, "csv")
    return path


@pytest.fixture(scope="module")
def undisturbed(folder, tmp_path_factory):
    """Its digests, and how long it took."""
    out, begun = tmp_path_factory.mktemp("out") / "diagnosis", time.monotonic()
    subprocess.run(command(folder, out), check=True, capture_output=True)
    return folder_digests(out), time.monotonic() - begun


def same(out: Path, digests: dict[str, str]) -> bool:
    return {k: v for k, v in folder_digests(out).items() if k != "timings.json"} == {
        k: v for k, v in digests.items() if k != "timings.json"
    }


@pytest.mark.skipif(not Path("/proc/self/stat").exists(), reason="processes are looked up in /proc")
@pytest.mark.slow
@pytest.mark.parametrize("how", ["group", "parent"])
def test_killed_at_random_moments(folder, undisturbed, tmp_path, how):
    digests, seconds = undisturbed
    rng, out = np.random.default_rng(len(how)), tmp_path / "out" / "diagnosis"
    for _ in range(2):
        process = subprocess.Popen(
            command(folder, out), stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, start_new_session=True
        )
        time.sleep(rng.uniform(0.3, 1.0) * seconds)
        if how == "group":
            os.killpg(process.pid, signal.SIGKILL)
        else:
            process.kill()
        process.wait(timeout=60)
        deadline = time.monotonic() + 60
        while of_session(process.pid) and time.monotonic() < deadline:
            time.sleep(0.2)
        assert not of_session(process.pid)  # whoever helped has ended, too
        if out.exists():  # it was through
            read_artifact(out, "diagnose")
            assert same(out, digests)
            return
    ended = subprocess.run(command(folder, out), capture_output=True, text=True, check=False)
    assert ended.returncode == 0, ended.stderr
    assert same(out, digests)
    assert [path.name for path in out.parent.iterdir()] == ["diagnosis"]


@pytest.mark.skipif(not Path("/proc/self/stat").exists(), reason="processes are looked up in /proc")
@pytest.mark.parametrize("whom", [pytest.param("group", marks=pytest.mark.slow), "parent"])
def test_asked_to_end_it_says_a_line_and_leaves_nothing(folder, tmp_path, whom):
    """As a shell's kill and a service manager ask: the parent alone, or all of its processes."""
    out = tmp_path / "out" / "diagnosis"
    process = subprocess.Popen(
        command(folder, out),
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )
    deadline = time.monotonic() + 60
    while not list(out.parent.glob(".tmp-*")) and time.monotonic() < deadline:  # it has begun
        time.sleep(0.05)
    (os.killpg if whom == "group" else os.kill)(process.pid, signal.SIGTERM)
    said, complained = process.communicate(timeout=60)
    assert process.returncode == 143
    assert (said, complained) == (
        "",
        "interrupted: finished artifacts are complete; run the same command to continue\n",
    )
    assert not list(out.parent.iterdir())
    while of_session(process.pid) and time.monotonic() < deadline:
        time.sleep(0.05)
    assert not of_session(process.pid)


@pytest.mark.slow
def test_a_full_disk_ends_in_one_line_and_leaves_nothing(folder, undisturbed, tmp_path):
    """A limit on the size of files stands for the disk: a picture no longer fits."""
    digests, _ = undisturbed
    out = tmp_path / "out" / "diagnosis"
    full = subprocess.run(
        command(folder, out, cores=1),
        capture_output=True,
        text=True,
        check=False,
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (20_000, 20_000)),
    )
    assert full.returncode == 2
    assert full.stderr.splitlines()[-1].startswith("error: ")
    assert "no space left" in full.stderr
    assert "Traceback" not in full.stderr
    assert not out.exists()
    assert not list(tmp_path.glob("out/*"))
    assert subprocess.run(command(folder, out, cores=1), capture_output=True, check=False).returncode == 0
    assert same(out, digests)  # whatever the number of processes
