"""The CartPole loop of two commits side by side: processor and wall seconds, and whether they find the same.

Both are unpacked from git and run at the same time, one process each, so that both meet the same machine. Shown are the
seconds of each and their ratio, the wall seconds of every stage, which policies are the same to the byte, and the
returns on the target of all seeds together with their 95 % intervals.

python benchmarks/run_speed.py [--base c9eb1aa] [--seeds 1] [--out DIR] [--word policy.total_steps=30000]
"""

from __future__ import annotations

import argparse
import io
import json
import os
import subprocess
import sys
import tarfile
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd

from gpsim.channels import BoolArray, FloatArray
from gpsim.evaluation import start_sets, summarise_all
from gpsim.files import file_digest

ROOT = Path(__file__).resolve().parents[1]
FOLDERS = {"gpsim": "gpsim", "cli": "gpsim/cli", "conf": "gpsim/conf"}  # as pyproject.toml installs them
START = "from gpsim.cli.main import main; main()"
STEPS = 500  # of an episode that nothing ends


@dataclass(frozen=True)
class Loop:
    """A finished loop of one commit."""

    folder: Path
    processor: float  # s
    wall: float  # s

    def stages(self) -> dict[str, float]:
        """Wall seconds by stage, of all its artifacts."""
        found: dict[str, float] = {}
        for path in sorted(self.folder.glob("*/v*/timings.json")):
            seconds = json.loads(path.read_text(encoding="utf-8"))["seconds"]
            found[path.parts[-3]] = found.get(path.parts[-3], 0.0) + float(seconds)
        return found

    def policies(self) -> dict[str, str]:
        """Digest of every trained policy, by its folder: the plan numbers them in the same order."""
        paths = sorted(self.folder.glob("train-*/v*/policy.safetensors"))
        return {path.parent.relative_to(self.folder).as_posix(): file_digest(path) for path in paths}

    def returns(self) -> tuple[dict[str, FloatArray], BoolArray]:
        """Returns (seeds, starts) by policy, and which starts are certified (starts,)."""
        tables = [
            pd.read_csv(path, index_col="start")
            for path in sorted(self.folder.glob("evaluate/v*/returns.csv"))
        ]
        names = [str(name) for name in tables[0].columns if name != "certified"]
        stacked = {
            name: np.stack([table[name].to_numpy(dtype=np.float64) for table in tables]) for name in names
        }
        return stacked, tables[0]["certified"].to_numpy(dtype=np.bool_)


def unpack(commit: str, into: Path) -> Path:
    """The package as a commit has it."""
    made = subprocess.run(
        ["git", "archive", commit, *FOLDERS], cwd=ROOT, check=True, capture_output=True
    ).stdout
    with tarfile.open(fileobj=io.BytesIO(made)) as packed:
        packed.extractall(into, filter="data")
    for have, want in FOLDERS.items():
        if have != want:
            (into / have).rename(into / want)
    return into


def started(package: Path, runs: Path, words: list[str]) -> subprocess.Popen[bytes]:
    """The loop, in one process beside the one that plans."""
    command = [sys.executable, "-c", START, "run", "full-loop", "experiment=cartpole", f"runs_dir={runs}"]
    environment = {**os.environ, "OMP_NUM_THREADS": "1", "PYTHONPATH": str(package)}
    log = (runs.parent / f"{runs.name}.log").open("wb")
    return subprocess.Popen(
        [*command, "--jobs", "1", *words], env=environment, stdout=log, stderr=subprocess.STDOUT, cwd=package
    )


def side_by_side(packages: dict[str, Path], out: Path, words: list[str]) -> dict[str, Loop]:
    """The loops of all packages, at the same time."""
    began = time.perf_counter()
    running = {started(package, out / name, words).pid: name for name, package in packages.items()}
    found: dict[str, Loop] = {}
    while running:
        pid, status, used = os.wait4(-1, 0)  # with the workers that it waited for
        if (name := running.pop(pid, None)) is None:
            continue
        if status:
            raise SystemExit(f"{name}: the loop failed; see {out / name}.log")
        seconds = used.ru_utime + used.ru_stime
        found[name] = Loop(out / name / "cartpole", seconds, time.perf_counter() - began)
    return found


def show(base: Loop, now: Loop) -> None:
    """Seconds, stages, policies and returns of both."""
    print(f"{'':>22} {'base':>9} {'now':>9} {'ratio':>7}")
    rows = {"processor, s": (base.processor, now.processor), "wall, s": (base.wall, now.wall)}
    before, after = base.stages(), now.stages()
    rows |= {f"{name}, wall s": (before[name], after[name]) for name in before if name in after}
    for name, (old, new) in rows.items():
        print(f"{name:>22} {old:9.1f} {new:9.1f} {new / old:7.2f}")
    old, new = base.policies(), now.policies()
    same = [name for name in old if new.get(name) == old[name]]
    print(f"{len(same)} of {len(old)} policies are the same to the byte: {', '.join(same)}")
    for label, loop in (("base", base), ("now", now)):
        returns, certified = loop.returns()
        for key, starts in start_sets(returns, certified, STEPS).items():
            for name, summary in summarise_all(returns, starts).items():
                print(f"{label:>5} {key:>18} {name:>22}: {summary}")


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--base", default="c9eb1aa", help="the commit to compare with")
    parser.add_argument("--now", default="HEAD", help="the commit to be compared")
    parser.add_argument("--seeds", type=int, default=1)
    parser.add_argument("--out", type=Path, help="where the runs are kept")
    parser.add_argument("--word", action="append", default=[], help="a setting for both, as budget=smoke")
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as scratch:
        out = (arguments.out or Path(scratch)).absolute()
        out.mkdir(parents=True, exist_ok=True)
        packages = {
            name: unpack(commit, Path(scratch) / f"package-{name}")
            for name, commit in (("base", arguments.base), ("now", arguments.now))
        }
        found = side_by_side(packages, out, ["--seeds", str(arguments.seeds), *arguments.word])
        show(found["base"], found["now"])


if __name__ == "__main__":
    main()
