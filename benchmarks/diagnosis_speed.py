"""What a diagnosis costs beside an earlier commit, on the same recordings in one run, and whether it says the same.

    python benchmarks/diagnosis_speed.py --recordings DIR [--base c9eb1aa] [--answers 73a0988] [--new HEAD] [--out DIR]

Recordings: worlds of the blind test's kind of every built-in system, and the open real sets of data/README.md where
--recordings has them. Every side runs in processes of its own from a copy of its commit. `new` runs once more with
nothing compiled yet. Written as it goes, so that the same command carries on: OUT/results.json, and OUT/summary.md.
Processor seconds are the main figure; they do not depend on what else the machine does, or hardly.
"""

from __future__ import annotations

import argparse
import json
import os
import shutil
import statistics
import subprocess
import sys
import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
SEED = 40
WORLDS = (1, 2, 3, 4, 5, 6, 8, 10, 12, 14, 15, 17, 19, 21)  # trials of that seed
TANKS = "docs/examples/cascaded_tanks.py:CascadedTanks"
REAL = {
    "emps": ("emps/DATA_EMPS.mat", "emps", None),
    "rig": ("physical_cartpole/balancing", "physical_cartpole", None),
    "dart": ("dart_jetracer/bags/4_sept_random_driving_slow.bag", "dart_jetracer", None),
    "f1tenth": ("f1tenth_track", "f1tenth_track", None),
    "pendulum": ("simple_pendulum", "simple_pendulum", None),
    "tanks": ("cascaded_tanks/dataBenchmark.csv", "cascaded_tanks", TANKS),
}
FIRST = "first"  # the side that has compiled nothing yet: the first recording only
CHILD = """
import json, resource, sys, time
begun, (recording, simulator) = time.monotonic(), sys.argv[1:3]
# An editable installation would lend this commit's files to a commit that has none of the name.
sys.meta_path[:] = [finder for finder in sys.meta_path if "editable" not in repr(finder).lower()]
try:
    import gpsim.api
except ImportError:  # before there was a Python face
    from pathlib import Path
    from gpsim.diagnosis.diagnosis import diagnose
    from gpsim.files import plain
    from gpsim.stages.diagnose import Task, generator, open_recording
    taken, model = open_recording(Task(Path(recording), simulator or None))
    found = diagnose(taken, model, model.defaults(taken.parameters), generator(0, "diagnose"))
    report = plain(found.report)
else:
    import gpsim
    report = gpsim.diagnose(recording, simulator or None).result.to_dict()
used = resource.getrusage(resource.RUSAGE_SELF)
print(json.dumps({"wall": time.monotonic() - begun, "processor": used.ru_utime + used.ru_stime, "report": report}))
"""


def tree(commit: str, parent: Path) -> Path:
    """A commit as it would be installed, in a folder of its own."""
    digest = subprocess.run(
        ["git", "rev-parse", commit], cwd=ROOT, check=True, capture_output=True, text=True
    ).stdout.strip()
    folder = parent / digest[:12]
    if not folder.is_dir():
        made = Path(tempfile.mkdtemp(dir=parent))
        packed = subprocess.run(
            ["git", "archive", digest, "gpsim", "cli", "conf", "docs/examples"],
            cwd=ROOT, check=True, capture_output=True,
        )  # fmt: skip
        subprocess.run(["tar", "-x", "-C", str(made)], input=packed.stdout, check=True)
        (made / "cli").rename(made / "gpsim" / "cli")
        (made / "conf").rename(made / "gpsim" / "conf")
        made.rename(folder)
    return folder


def recordings(out: Path, real: Path | None) -> dict[str, tuple[Path, str | None]]:
    """Name -> recording, and the simulator where it is somebody's own; what is there already is not made again."""
    from gpsim.trials.blinding import PUBLIC, trial_name, write_trial

    found: dict[str, tuple[Path, str | None]] = {}
    for name, (source, mapping, own) in REAL.items() if real else ():
        folder = out / "real" / name
        if not (folder / "recording.yaml").is_file():
            words = [str(Path(sys.executable).with_name("gpsim")), "import", str(real / source)]
            done = subprocess.run([*words, "--mapping", mapping, "--out", str(folder)], check=False)
            if done.returncode:
                continue
        found[name] = folder, own
    for number in WORLDS:
        write_trial(out / "worlds", SEED, number)
        folder = out / "worlds" / PUBLIC / trial_name(number)
        system = next(
            line.split()[1]
            for line in (folder / "recording.yaml").read_text(encoding="utf-8").splitlines()
            if line.startswith("system:")
        )
        found[f"{system} {number}"] = folder, None
    return found


def diagnosed(side: Path, recording: Path, simulator: str | None, cache: Path) -> dict[str, Any]:
    """Seconds and the answer of one side."""
    environment = {
        **os.environ,
        "PYTHONPATH": str(side),
        "OMP_NUM_THREADS": "1",
        "NUMBA_CACHE_DIR": str(cache),
    }
    done = subprocess.run(
        [sys.executable, "-c", CHILD, str(recording), str(side / simulator) if simulator else ""],
        env=environment, check=False, capture_output=True, text=True, cwd=side,
    )  # fmt: skip
    if done.returncode:
        return {"failed": done.stderr.strip().splitlines()[-1] if done.stderr.strip() else "no word"}
    answer: dict[str, Any] = json.loads(done.stdout.splitlines()[-1])
    return answer


def claims(report: Mapping[str, Any]) -> set[tuple[str, str]]:
    """Family and place of what is claimed."""
    return {(e["family"], e["on"]) for e in report["effects"] if e.get("role", "headline") == "headline"}


def difference(new: Mapping[str, Any], old: Mapping[str, Any]) -> str:
    """In what two answers differ, empty where that is nothing of weight."""
    if new["verdict"] != old["verdict"]:
        return f"verdict {old['verdict']} -> {new['verdict']}"
    mine, theirs = claims(new), claims(old)
    if mine != theirs:
        listed = [{(e["family"], e["on"]) for e in a["effects"]} for a in old.get("alternatives", [])]
        if not any(mine == other or mine - theirs <= other for other in listed):
            return f"claims {sorted(theirs)} -> {sorted(mine)}"
    before = {(e["family"], e["on"]): e["parameters"] for e in old["effects"]}
    for effect in new["effects"]:
        for name, value in before.get((effect["family"], effect["on"]), {}).items():
            got = effect["parameters"].get(name, {}).get("value")
            low, high = value.get("low"), value.get("high")
            if None not in (got, low, high) and not low <= got <= high:
                return (
                    f"{effect['family']} on {effect['on']}: {name} {got:.4g} outside [{low:.4g}, {high:.4g}]"
                )
    return ""


def summary(results: Mapping[str, Any]) -> str:
    """The table, and medians."""
    lines = [
        "| recording | base: processor s, wall s | new | times, processor | times, wall | answer |",
        "|---" * 6 + "|",
    ]
    ratios, walls = [], []
    for name, sides in results.items():
        base, new = sides.get("base"), sides.get("new")
        if not base or not new or "failed" in base or "failed" in new:
            lines.append(f"| {name} | {base and base.get('failed')} | {new and new.get('failed')} | | | |")
            continue
        ratios.append(base["processor"] / new["processor"])
        walls.append(base["wall"] / new["wall"])
        other = sides.get("answers")
        told = "" if not other else difference(new["report"], other["report"]) or "the same"
        seconds = [f"{side['processor']:.1f}, {side['wall']:.1f}" for side in (base, new)]
        lines.append(f"| {name} | {' | '.join(seconds)} | {ratios[-1]:.2f} | {walls[-1]:.2f} | {told} |")
    if ratios:
        middle = f"median {statistics.median(ratios):.2f} (processor), {statistics.median(walls):.2f} (wall)"
        lines += ["", f"{len(ratios)} recordings, {middle}; least {min(ratios):.2f}"]
    for name, sides in results.items():
        if FIRST in sides and "failed" not in sides[FIRST] and "new" in sides:
            more = sides[FIRST]["processor"] - sides["new"]["processor"]
            lines.append(f"first run, with nothing compiled yet ({name}): {more:.1f} processor s more")
    return "\n".join(lines) + "\n"


def main() -> None:
    """Run what is missing, and write the summary after each."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--recordings", type=Path, help="folder of the open real sets; none without it")
    parser.add_argument("--base", default="c9eb1aa", help="the commit that speed is compared with")
    parser.add_argument("--answers", default="73a0988", help="the commit that answers are compared with")
    parser.add_argument("--new", default="HEAD", help="the commit that is measured")
    parser.add_argument("--out", type=Path, default=Path("runs/diagnosis_speed"))
    parser.add_argument("--only", nargs="*", default=[], help="recordings to look at, all by default")
    parser.add_argument("--sides", nargs="*", default=[], help="sides to run, all by default")
    parser.add_argument("--again", nargs="*", default=[], help="sides to run anew: base, answers, new, first")
    given = parser.parse_args()
    out: Path = given.out.resolve()
    (out / "sides").mkdir(parents=True, exist_ok=True)
    sides = {side: tree(getattr(given, side), out / "sides") for side in ("base", "new", "answers")}
    path = out / "results.json"
    results: dict[str, Any] = json.loads(path.read_text(encoding="utf-8")) if path.is_file() else {}
    for found in results.values():
        for side in given.again:
            found.pop(side, None)
    every = recordings(out, given.recordings)
    warm = out / "compiled"
    for place, (name, (recording, own)) in enumerate(every.items()):
        if given.only and name not in given.only and name.split()[0] not in given.only:
            continue
        wanted = [*([FIRST] if place == 0 else []), *sides]
        for side in wanted:
            if side in results.setdefault(name, {}) or (given.sides and side not in given.sides):
                continue
            cache = out / "cold" if side == FIRST else warm
            if side == FIRST:
                shutil.rmtree(cache, ignore_errors=True)
            results[name][side] = diagnosed(sides.get(side, sides["new"]), recording, own, cache)
            if side == FIRST and not warm.exists():
                shutil.copytree(cache, warm, dirs_exist_ok=True)
            path.write_text(json.dumps(results), encoding="utf-8")
            (out / "summary.md").write_text(summary(results), encoding="utf-8")
            told = results[name][side]
            print(f"{name}, {side}: {told.get('failed') or round(told['processor'], 1)}", flush=True)
    print(summary(results))


if __name__ == "__main__":
    main()
