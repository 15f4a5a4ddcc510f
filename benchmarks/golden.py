"""Whether two states of the code give the same answers to the byte: diagnosis.json and corrected.json, side by side.

    python benchmarks/golden.py --base c9eb1aa [--out runs/golden] [--only emps world-single-0003] [--count 4]

The base is a commit; compared with it is the checkout as it stands, or another commit (`--with`). Both run here, in one
run, with the Python that runs this. Diagnosed are the recordings of both loops, the open real ones where they lie
(GPSIM_RECORDINGS, see data/README.md) and forty concealed worlds of a tuning seed: 25 of one effect, 12 of two, one
without, two with physics outside the catalogue; each family is among them, most twice. The base makes the inputs. What
a commit has answered is kept in OUT and not asked again; what the checkout answers is not. Exit code 1: they differ.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import os
import shutil
import subprocess
import sys
import tarfile
import time
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
FOLDER = Path(os.environ.get("GPSIM_RECORDINGS", ROOT.parent / "shared" / "recordings"))
TANKS = f"{ROOT / 'docs' / 'examples' / 'cascaded_tanks.py'}:CascadedTanks"
SEED = 30  # a tuning seed, of 1 to 99: all 27 families occur in its forty worlds, 19 of them at least twice
STRATA = {"single": 25, "pair": 12, "none": 1, "unknown": 2}
COMPARED = ("diagnosis.json", "corrected.json")
CHECKOUT = "checkout"
REAL = {
    "emps": "emps/DATA_EMPS.mat",
    "rig": "physical_cartpole/balancing",
    "rig-held": "physical_cartpole/free_swing",
    "dart": "dart_jetracer/bags/4_sept_random_driving_slow.bag",
    "f1tenth": "f1tenth_track",
    "pendulum": "simple_pendulum",
    "tanks": "cascaded_tanks/dataBenchmark.csv",
}
MAPPINGS = {
    "emps": "emps",
    "rig": "physical_cartpole",
    "rig-held": "physical_cartpole",
    "dart": "dart_jetracer",
    "f1tenth": "f1tenth_track",
    "pendulum": "simple_pendulum",
    "tanks": "cascaded_tanks",
}


@dataclass(frozen=True)
class Code:
    """A state of the code, laid out as the package that is imported. name: a commit's hash, or the checkout."""

    name: str
    path: Path

    def run(self, words: Sequence[str], cwd: Path) -> str:
        """What a gpsim command of this state says on stderr where it fails; empty where it does not."""
        environment = os.environ | {"PYTHONPATH": str(self.path), "OMP_NUM_THREADS": "1"}
        command = [sys.executable, "-c", "from gpsim.cli.main import main; main()", *words]
        done = subprocess.run(command, cwd=cwd, env=environment, capture_output=True, text=True, check=False)
        return done.stderr.strip() or f"exit code {done.returncode}" if done.returncode else ""


@dataclass(frozen=True)
class Case:
    """A recording to be diagnosed; words: what the command is told beside it."""

    name: str
    recording: Path
    words: tuple[str, ...] = ()


def commit_of(name: str) -> str:
    """The full hash of a commit."""
    found = subprocess.run(
        ["git", "rev-parse", "--verify", f"{name}^{{commit}}"],
        cwd=ROOT, capture_output=True, text=True, check=False,
    )  # fmt: skip
    if found.returncode:
        raise SystemExit(f"error: no commit {name}")
    return found.stdout.strip()


def laid_out(name: str, shelf: Path) -> Code:
    """The package as a commit or the checkout has it: gpsim/ with cli/ and conf/ inside, as it is installed."""
    place = shelf / "code" / name
    shutil.rmtree(place, ignore_errors=True)
    place.mkdir(parents=True)
    if name == CHECKOUT:
        for folder in ("gpsim", "cli", "conf"):
            shutil.copytree(ROOT / folder, place / folder, ignore=shutil.ignore_patterns("__pycache__"))
    else:
        packed = subprocess.run(
            ["git", "archive", "--format=tar", name, "gpsim", "cli", "conf"],
            cwd=ROOT, capture_output=True, check=True,
        )  # fmt: skip
        with tarfile.open(fileobj=BytesIO(packed.stdout)) as archive:
            archive.extractall(place, filter="data")
    for folder in ("cli", "conf"):
        (place / folder).rename(place / "gpsim" / folder)
    return Code(name, place)


def cases(base: Code, shelf: Path) -> list[Case]:
    """All recordings, made by the base's code where they are not there yet."""
    place = shelf / "inputs" / base.name
    place.mkdir(parents=True, exist_ok=True)
    return [*_loops(base, place), *_real(base, place), *_worlds(base, place)]


def _loops(code: Code, place: Path) -> Iterator[Case]:
    for experiment in ("cartpole", "limo"):
        target = place / f"loop-{experiment}"
        if not target.is_dir():
            words = [f"experiment={experiment}", "budget=smoke"]
            if experiment == "cartpole":
                _must(code, ["train-source", *words], place)
            _must(code, ["collect", *words, "--out", str(target)], place)
        yield Case(target.name, target)


def _real(code: Code, place: Path) -> Iterator[Case]:
    if not FOLDER.is_dir():
        print(f"no real recordings at {FOLDER}: set GPSIM_RECORDINGS; the rest goes on", file=sys.stderr)
        return
    for name, source in REAL.items():
        target = place / name
        if not target.is_dir():
            mapping = ["--mapping", MAPPINGS[name]]
            _must(code, ["import", str(FOLDER / source), *mapping, "--out", str(target)], place)
        yield Case(name, target, ("--simulator", TANKS) if name == "tanks" else ())


def _worlds(code: Code, place: Path) -> Iterator[Case]:
    for stratum, count in STRATA.items():
        out = place / f"worlds-{stratum}"
        if not (out / "public" / "answers.sha256").is_file():
            words = ["--trials", str(count), "--seed", str(SEED), "--stratum", stratum, "--no-long"]
            _must(code, ["prove", "conceal", "--out", str(out), *words], place)
        for folder in sorted(p for p in (out / "public").iterdir() if p.is_dir()):
            yield Case(f"world-{stratum}-{folder.name}", folder)


def _must(code: Code, words: Sequence[str], cwd: Path) -> None:
    if said := code.run(words, cwd):
        raise SystemExit(f"error: gpsim {' '.join(words)}: {said}")


def answered(code: Code, case: Case, shelf: Path) -> tuple[Path, float]:
    """The folder of a state's answer to a case, and seconds by the clock; what a commit has answered is kept."""
    folder = shelf / "answers" / code.name / case.name
    done = folder / "seconds.json"
    if done.is_file() and code.name != CHECKOUT:
        return folder, float(json.loads(done.read_text(encoding="utf-8")))
    shutil.rmtree(folder, ignore_errors=True)
    folder.parent.mkdir(parents=True, exist_ok=True)
    begun = time.monotonic()
    words = ["diagnose", str(case.recording), "--out", str(folder), "--cores", "1", *case.words]
    said = code.run(words, shelf)
    seconds = time.monotonic() - begun
    folder.mkdir(exist_ok=True)
    if said:
        (folder / COMPARED[0]).write_text(json.dumps({"refused": said.splitlines()[-1]}), encoding="utf-8")
    done.write_text(json.dumps(seconds), encoding="utf-8")
    return folder, seconds


def differences(one: Path, other: Path) -> list[str]:
    """Where the compared files of two answers differ; empty where they are equal to the byte."""
    out = []
    for name in COMPARED:
        pair = [folder / name for folder in (one, other)]
        texts = [p.read_bytes() if p.is_file() else b"null" for p in pair]
        if texts[0] != texts[1]:
            found = list(_unequal(*(json.loads(t) for t in texts), name.removesuffix(".json")))
            out += found or [f"{name}: other bytes, the same values"]
    return out


def _unequal(one: Any, other: Any, path: str) -> Iterator[str]:
    """Leaves in which two JSON values differ."""
    if isinstance(one, dict) and isinstance(other, dict):
        for key in sorted({*one, *other}):
            yield from _unequal(one.get(key), other.get(key), f"{path}.{key}")
    elif isinstance(one, list) and isinstance(other, list) and len(one) == len(other):
        for i, (a, b) in enumerate(zip(one, other, strict=True)):
            yield from _unequal(a, b, f"{path}[{i}]")
    elif one != other:
        yield f"{path}: {_short(one)} and {_short(other)}"


def _short(value: Any) -> str:
    text = json.dumps(value)
    return text if len(text) < 80 else f"{text[:77]}..."


def digest(folder: Path) -> str:
    """A few digits that stand for an answer."""
    files = [folder / name for name in COMPARED if (folder / name).is_file()]
    return hashlib.sha256(b"".join(p.read_bytes() for p in files)).hexdigest()[:12]


def main() -> None:
    """Ask both states everything, and say where they differ."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--base", required=True, help="a commit")
    parser.add_argument("--with", dest="head", default=CHECKOUT, help="another one; the checkout by default")
    parser.add_argument("--out", type=Path, default=Path("runs/golden"))
    parser.add_argument("--only", nargs="*", default=[], help="names of cases, or how they begin")
    parser.add_argument("--every", type=int, default=1, help="only every so many-th case: a quick look")
    parser.add_argument("--jobs", type=int, default=os.cpu_count() or 1)
    given = parser.parse_args()
    shelf = given.out.resolve()
    base = laid_out(commit_of(given.base), shelf)
    head = laid_out(CHECKOUT if given.head == CHECKOUT else commit_of(given.head), shelf)
    every = cases(base, shelf)[:: given.every]
    chosen = [c for c in every if not given.only or c.name.startswith(tuple(given.only))]

    def both(case: Case) -> tuple[Case, list[str], tuple[float, float], str]:
        (before, old), (after, new) = answered(base, case, shelf), answered(head, case, shelf)
        return case, differences(before, after), (old, new), digest(after)

    different = 0
    with ThreadPoolExecutor(given.jobs) as pool:
        for case, found, (old, new), what in pool.map(both, chosen):
            print(
                f"{'DIFFERS' if found else 'equal  '} {case.name:<24} {what}  {old:6.1f} s {new:6.1f} s",
                flush=True,
            )
            different += bool(found)
            for line in found[:6]:
                print(f"          {line}", flush=True)
    print(
        f"{len(chosen) - different} of {len(chosen)} equal to the byte: {base.name[:7]} and {head.name[:7]}"
    )
    sys.exit(1 if different else 0)


if __name__ == "__main__":
    main()
