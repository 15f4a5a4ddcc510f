"""Whether two states of the code give the same answers: digests of what the commands write and print, side by side.

    python benchmarks/golden.py NEW.json [--against OLD.json] [--code COMMIT] [--only recordings models ...]

Asked is the checkout, or a commit laid out beside it (`--code`), with the Python that runs this. The groups:

    recordings  the open recordings where they lie (GPSIM_RECORDINGS, see data/README.md), imported and inspected
    loops       both loops on the smoke budget: their artifacts and manifests
    models      an arm diagnosed, its corrected model exported and rolled out
    proof       forty concealed worlds of a tuning seed, diagnosed with few windows, revealed: every score
    worlds      only where --only names it: eight worlds diagnosed as a user would, a minute each

All but the last take eight minutes of one core. Files lie in the folder NEW beside NEW.json, for a look at what
differs. Times, paths, commits, versions and keys that follow from the source are left out of a digest. Exit code 1:
they differ from OLD.json.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import os
import re
import shutil
import subprocess
import sys
import tarfile
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from io import BytesIO
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
FOLDER = Path(os.environ.get("GPSIM_RECORDINGS", ROOT.parent / "shared" / "recordings"))
SEED = "30"  # a tuning seed, of 1 to 99
RECORDINGS = {
    "emps": ("emps/DATA_EMPS.mat", "emps"),
    "rig": ("physical_cartpole/balancing", "physical_cartpole"),
    "rig-held": ("physical_cartpole/free_swing", "physical_cartpole"),
    "dart": ("dart_jetracer/bags/4_sept_random_driving_slow.bag", "dart_jetracer"),
    "dart-ros2": ("dart_jetracer/bags/slow_ros2_sqlite3", "dart_jetracer"),
    "f1tenth": ("f1tenth_track", "f1tenth_track"),
    "pendulum": ("simple_pendulum", "simple_pendulum"),
    "tanks": ("cascaded_tanks/dataBenchmark.csv", "cascaded_tanks"),
}
CHEAP = [
    *("--cores", "1", "diagnose.windows.fitted=40", "diagnose.windows.searched=20", "diagnose.rollouts.most=20"),
    *("diagnose.rollouts.draws=40", "diagnose.gp.rows=50", "diagnose.gp.steps=200"),
]  # fmt: skip
WORLDS = {"plain": 24, "words": 6, "curves": 4, "rough": 3, "machines": 2, "plan": 1}
"""Kind of concealed worlds -> how many; together forty."""
VOLATILE = {
    *("code", "key", "parents", "packages", "git_commit", "diagnosed_under", "finished", "seconds", "sha256"),
    *("content_sha256", "version"),
}  # fmt: skip
"""Keys of JSON files that say when, where and with which source a file was made."""
LEFT_OUT = {"timings.json", "outcome.json"}
TIMES = re.compile(rb"\d{4}-\d\d-\d\d[T ]\d\d:\d\d(:\d\d)?|not recorded|\b(?=\d*[a-f])[0-9a-f]{7,64}\b")
CALLS = """
import contextlib, json, sys, time
from gpsim.cli.main import main
for name, words in json.load(sys.stdin):
    begun = time.process_time()
    sys.argv = ["gpsim", "-q", *words]
    with open(f"said/{name}.txt", "w") as said, contextlib.redirect_stdout(said):
        try:
            main()
        except SystemExit as ended:
            if ended.code:
                print("exit code", ended.code)
    print(f"{name}: {time.process_time() - begun:.1f} s of the processor", file=sys.stderr)
"""
"""Several commands in one process, which compiles and imports once; what each prints goes into said/."""
ROLLOUT = """
import json, sys
import numpy as np
sys.path.insert(0, ".")
from arm_corrected import Robot
robot, path = Robot(), []
robot.reset([0.3, -0.4], [0.0, 0.0])
for k in range(200):
    robot.step([2.0 * np.sin(0.05 * k), np.cos(0.08 * k)])
    path.append(np.concatenate(robot.measured()).tolist())
json.dump(path, open("rollout.json", "w"))
"""
"""The exported model, moved for 200 control steps by its own wrapper."""
OUTCOMES = """
import json, sys
from pathlib import Path
from gpsim.trials.blinding import published, recording_digests
out = Path("p")
for name, digest in published(out).items():
    known = {"answer_sha256": digest, "git_commit": None, "recording": recording_digests(out / "public" / name)}
    made = out / "diagnoses" / name
    code = 0 if (made / "diagnosis" / "diagnosis.json").is_file() else 3
    made.mkdir(parents=True, exist_ok=True)
    outcome = {"exit": code, "seconds": 1.0, "error": None, **known}
    (made / "outcome.json").write_text(json.dumps(outcome))
"""
"""What `gpsim prove diagnose` writes beside a diagnosis, beside ones that were made with fewer windows."""
Call = tuple[str, Sequence[str]]


def laid_out(name: str, shelf: Path) -> Path:
    """The package as a commit has it: gpsim/ with cli/ and conf/ inside, as it is installed."""
    asked = ["git", "rev-parse", "--short", f"{name}^{{commit}}"]
    commit = subprocess.run(asked, cwd=ROOT, capture_output=True, text=True, check=True).stdout.strip()
    place = shelf / f"code-{commit}"
    if place.is_dir():
        return place
    place.mkdir(parents=True)
    command = ["git", "archive", "--format=tar", commit, "gpsim", "cli", "conf"]
    packed = subprocess.run(command, cwd=ROOT, capture_output=True, check=True)
    with tarfile.open(fileobj=BytesIO(packed.stdout)) as archive:
        archive.extractall(place, filter="data")
    for folder in ("cli", "conf"):
        (place / folder).rename(place / "gpsim" / folder)
    return place


def called(code: Path, cwd: Path, calls: Sequence[Call], program: str = CALLS) -> None:
    """Make the calls in one process that imports `code`."""
    (cwd / "said").mkdir(parents=True, exist_ok=True)
    environment = os.environ | {"PYTHONPATH": str(code), "OMP_NUM_THREADS": "1", "COLUMNS": "100"}
    command, words = [sys.executable, "-c", program], json.dumps(list(calls))
    done = subprocess.run(
        command, cwd=cwd, env=environment, input=words, text=True, check=False, stderr=subprocess.PIPE
    )
    (cwd / "said" / f"stderr-{calls[0][0]}.log").write_text(done.stderr, encoding="utf-8")
    if done.returncode:
        raise SystemExit(f"error: {calls[0][0]}: {done.stderr[-2000:]}")


def at_once(code: Path, cwd: Path, calls: Sequence[Call], jobs: int) -> None:
    """Make calls that need nothing of one another, in so many processes."""
    with ThreadPoolExecutor(jobs) as pool:
        list(pool.map(lambda i: called(code, cwd, calls[i::jobs]), range(min(jobs, len(calls)))))


def recordings(code: Path, cwd: Path, jobs: int) -> None:
    """Import every open recording, and inspect it as a raw log of which nothing is known."""
    if not FOLDER.is_dir():
        print(f"no recordings at {FOLDER}: set GPSIM_RECORDINGS; the rest goes on", file=sys.stderr)
        return
    calls: list[Call] = []
    for name, (source, mapping) in RECORDINGS.items():
        raw = str(FOLDER / source)
        calls.append((f"import-{name}", ["import", raw, "--mapping", mapping, "--out", name]))
        calls.append((f"inspect-{name}", ["import", raw, "--inspect"]))
    at_once(code, cwd, calls, jobs)


def loops(code: Path, cwd: Path, jobs: int) -> None:
    """Both loops on the smoke budget."""
    words = {n: ["run", "full-loop", f"experiment={n}", "budget=smoke"] for n in ("cartpole", "limo")}
    called(code, cwd, list(words.items()))


def models(code: Path, cwd: Path, jobs: int) -> None:
    """One drive of an arm, asked for two families; its corrected model as MJCF, and where that goes."""
    rows = (ROOT / "data" / "arm.csv").read_text(encoding="utf-8").splitlines(keepends=True)
    cwd.mkdir(parents=True)
    (cwd / "arm.csv").write_text("".join(rows[:152]), encoding="utf-8")
    few = ["diagnose.windows.fitted=8", "diagnose.windows.searched=4", "diagnose.rollouts.most=5"]
    few.append("diagnose.families.only=[coulomb_friction,actuator_dead_zone]")
    model = str(ROOT / "data" / "arm.xml")
    asked = ["diagnose", "arm.csv", "--simulator", model, "--out", "arm", *CHEAP, *few]
    written = ["export", "model", "arm", "--out", "arm_corrected.xml", "--urdf"]
    called(code, cwd, [("diagnose-arm", asked), ("export-arm", written)])
    called(code, cwd, [("rollout", [])], ROLLOUT)


def proof(code: Path, cwd: Path, jobs: int) -> None:
    """Conceal, diagnose with few windows, reveal."""
    counts = [w for kind in ("curves", "rough", "machines", "plan") for w in (f"--{kind}", str(WORLDS[kind]))]
    plain = ["--trials", str(WORLDS["plain"]), "--no-long", *counts]
    words = ["--trials", str(WORLDS["words"]), "--stratum", "words"]
    conceal = ["prove", "conceal", "--out", "p", "--seed", SEED, "--jobs", str(jobs)]
    called(code, cwd, [("conceal", [*conceal, *plain]), ("conceal-words", [*conceal, *words])])
    calls: list[Call] = []
    for folder in sorted(p for p in (cwd / "p" / "public").iterdir() if p.is_dir()):
        shown = sorted(str(p.parent.relative_to(cwd)) for p in folder.rglob("recording.yaml"))
        target = f"p/diagnoses/{folder.name}/diagnosis"
        calls.append((folder.name, ["diagnose", *shown, "--out", target, *CHEAP]))
    at_once(code, cwd, calls, jobs)
    called(code, cwd, [("outcomes", [])], OUTCOMES)
    called(code, cwd, [("reveal", ["prove", "reveal", "--out", "p", "--jobs", str(jobs)])])


def worlds(code: Path, cwd: Path, jobs: int) -> None:
    """Eight worlds, as a user would."""
    conceal = ["prove", "conceal", "--out", "w", "--seed", SEED, "--trials", "8", "--no-long"]
    called(code, cwd, [("conceal", conceal)])
    found = sorted(p.name for p in (cwd / "w" / "public").iterdir() if p.is_dir())
    calls: list[Call] = [(n, ["diagnose", f"w/public/{n}", "--out", n, "--cores", "1"]) for n in found]
    at_once(code, cwd, calls, jobs)


GROUPS = {f.__name__: f for f in (recordings, loops, models, proof, worlds)}


def digests(folder: Path) -> Iterator[tuple[str, str]]:
    """Name and digest of every file that is an answer."""
    for path in sorted(p for p in folder.rglob("*") if p.is_file()):
        name = path.relative_to(folder).as_posix()
        if path.suffix == ".log" or path.name in LEFT_OUT or "/." in f"/{name}" or "__pycache__" in name:
            continue
        content = path.read_bytes().replace(str(ROOT).encode(), b"ROOT")
        if path.suffix == ".json":
            content = json.dumps(_lasting(json.loads(content)), sort_keys=True).encode()
        elif path.suffix in (".html", ".md", ".txt"):
            content = TIMES.sub(b"", content)
        yield name, hashlib.sha256(content).hexdigest()[:16]


def _lasting(value: Any) -> Any:
    """A JSON value without what says when, where and with which source it was made."""
    if isinstance(value, dict):
        return {k: _lasting(v) for k, v in value.items() if k not in VOLATILE and not k.endswith(".html")}
    return list(map(_lasting, value)) if isinstance(value, list) else value


def main() -> None:
    """Ask everything, write the digests, and say where they differ from others."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("new", type=Path, help="where the digests go")
    parser.add_argument("--against", type=Path, help="digests of another state of the code")
    parser.add_argument("--code", help="a commit; the checkout by default")
    parser.add_argument("--only", nargs="*", choices=GROUPS, default=[g for g in GROUPS if g != "worlds"])
    parser.add_argument("--jobs", type=int, default=os.cpu_count() or 1)
    given = parser.parse_args()
    place = given.new.resolve().with_suffix("")
    code = ROOT if given.code is None else laid_out(given.code, place.parent)
    for group in given.only:
        shutil.rmtree(place / group, ignore_errors=True)
        GROUPS[group](code, place / group, given.jobs)
    made = {f"{group}/{name}": value for group in given.only for name, value in digests(place / group)}
    given.new.write_text(json.dumps(made, indent=1) + "\n", encoding="utf-8")
    print(f"{len(made)} digests in {given.new}")
    if given.against is None:
        return
    known = json.loads(given.against.read_text(encoding="utf-8"))
    known = {name: value for name, value in known.items() if name.partition("/")[0] in given.only}
    differing = sorted(name for name in {*made, *known} if made.get(name) != known.get(name))
    print(*(f"DIFFERS {name}" for name in differing), sep="\n")
    print(
        f"{len({*made, *known}) - len(differing)} of {len({*made, *known})} equal to those of {given.against}"
    )
    sys.exit(1 if differing else 0)


if __name__ == "__main__":
    main()
