"""What a job costs beyond its work, and what ten thousand stored trials cost at the end.

    .venv/bin/python benchmarks/cluster_overhead.py            # all of it, some minutes
    .venv/bin/python benchmarks/cluster_overhead.py --jobs 200 --stored 1000

Three parts, each printed as a table and written to --out as JSON:

1. jobs: J jobs of a known length through processes of this machine and through Dask on it. A worker's gap is the time
   between two of its jobs; the overhead of a job is its gap, the median over all of them.
2. store: publishing one more small artifact, and looking for one that is not there, beside N stored ones.
3. summary: `gpsim prove reveal` of N stored trials, made by copying the records of a few that are diagnosed here.
"""

import argparse
import json
import os
import shutil
import statistics
import tempfile
import time
from contextlib import chdir
from functools import partial
from itertools import pairwise
from pathlib import Path

from gpsim.artifacts import Recipe, Store
from gpsim.launchers import Dask, Local, Progress, Task, run_tasks

WORK = 0.02  # s of one job


def job(number: int, progress: Progress) -> tuple[int, float, float]:
    """Process, begin and end of a job on the machine's clock."""
    begun = time.time()
    time.sleep(WORK)
    return os.getpid(), begun, time.time()


def silent(*_: object) -> None:
    pass


def warm(number: int, progress: Progress) -> None:
    time.sleep(1.0)


def overhead(launcher: Local | Dask, jobs: int, workers: int) -> dict[str, float]:
    """Milliseconds a job: the gap between two jobs of one worker, and the whole run's by its wall time."""
    first = [Task(f"warm {i}", partial(warm, i)) for i in range(2 * workers)]
    before = tuple(task.label for task in first)
    tasks = [*first, *(Task(f"job {i}", partial(job, i), before) for i in range(jobs))]
    spans = [o.result for o in run_tasks(launcher, tasks, silent) if o.result is not None]
    gaps = []
    for worker in {span[0] for span in spans}:
        mine = sorted(span[1:] for span in spans if span[0] == worker)
        gaps += [1e3 * (later[0] - earlier[1]) for earlier, later in pairwise(mine)]
    wall = max(span[2] for span in spans) - min(span[1] for span in spans)
    gaps.sort()
    return {
        "median_ms": statistics.median(gaps),
        "p90_ms": gaps[int(0.9 * len(gaps))],
        "by_wall_ms": 1e3 * (wall * workers / jobs - WORK),
    }


def store_costs(stored: int) -> dict[str, float]:
    """Milliseconds to publish and to miss beside so many versions, made by copying one."""
    with tempfile.TemporaryDirectory() as folder:
        store = Store(Path(folder), "x")
        first = store.publish(Recipe("s", {"n": -1}, {}, {}), _one_file)
        for i in range(2, stored + 1):
            shutil.copytree(first.path, first.path.with_name(f"v{i:04d}"))
        cold = _ms(lambda: store.find(Recipe("s", {"n": -2}, {}, {})))
        misses = [_ms(lambda: store.find(Recipe("s", {"n": -2}, {}, {}))) for _ in range(5)]
        marked = [_ms(lambda: store.find(Recipe("s", {"n": -2}, {}, {}), looked=True)) for _ in range(5)]
        puts = [_ms(lambda i=i: store.publish(Recipe("s", {"n": i}, {}, {}), _one_file)) for i in range(5)]
    return {
        "first_look_ms": cold,
        "later_look_ms": min(misses),
        "job_look_ms": min(marked),
        "publish_ms": min(puts),
    }


def _one_file(folder: Path) -> None:
    (folder / "a.json").write_text("{}")


def _ms(work) -> float:
    begun = time.perf_counter()
    work()
    return 1e3 * (time.perf_counter() - begun)


def summary_costs(stored: list[int], seed: int, originals: int, proof: Path | None) -> list[dict[str, float]]:
    """Seconds of a reveal with so many stored trials. proof: a finished one whose records are copied instead."""
    from gpsim.stages import prove

    with tempfile.TemporaryDirectory() as folder, chdir(folder):
        home = Path("proof")
        if proof is not None:
            names = sorted(p.name for p in (proof / "diagnoses").glob("[0-9]*"))
            names = [n for n in names if (proof / "equivalents" / f"{n}.json").is_file()][:originals]
            _copied(proof, home, names, names)
        else:
            launcher = Local(os.cpu_count() or 1)
            prove.conceal(home, seed, prove.numbers_of(originals, long=False), launcher, silent)
            prove.diagnose(home, launcher, silent)
            prove.reveal(home, None, launcher, silent)
            names = sorted(p.name for p in (home / "diagnoses").glob("[0-9]*"))
        found = []
        for count in stored:
            whole = Path(f"proof-{count}")
            _copied(home, whole, names, [f"{i:04d}" for i in range(1, count + 1)])
            begun = time.perf_counter()
            prove.reveal(whole, None, Local(os.cpu_count() or 1), silent)
            seconds = time.perf_counter() - begun
            begun = time.perf_counter()
            scores = [json.loads(p.read_text()) for p in sorted((whole / "scores").iterdir())]
            read = time.perf_counter() - begun
            begun = time.perf_counter()
            prove.summarise(scores)
            summed = time.perf_counter() - begun
            size = (whole / "report.html").stat().st_size / 1e6
            found.append(
                {
                    "stored": count,
                    "reveal_s": seconds,
                    "read_scores_s": read,
                    "summarise_s": summed,
                    "page_MB": size,
                }
            )
            print(found[-1], flush=True)
            shutil.rmtree(whole)
    return found


def _copied(home: Path, whole: Path, names: list[str], to: list[str]) -> None:
    """Records under other numbers, hashes and all; answers are by their bytes, which the number is no part of here."""
    for kind in ("public", "private", "diagnoses", "equivalents"):
        (whole / kind).mkdir(parents=True, exist_ok=True)
    known = dict(reversed(line.split()) for line in (home / "public/answers.sha256").read_text().splitlines())
    lines = []
    for i, name in enumerate(to):
        old = names[i % len(names)]
        for kind in ("public", "private"):
            shutil.copytree(home / kind / old, whole / kind / name)
        there = whole / "diagnoses" / name / "diagnosis"
        there.mkdir(parents=True)
        shutil.copyfile(home / "diagnoses" / old / "outcome.json", there.parent / "outcome.json")
        shutil.copyfile(home / "diagnoses" / old / "diagnosis/diagnosis.json", there / "diagnosis.json")
        shutil.copyfile(home / f"equivalents/{old}.json", whole / f"equivalents/{name}.json")
        lines.append(f"{known[old]}  {name}\n")
    (whole / "public/answers.sha256").write_text("".join(sorted(lines)))


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--jobs", type=int, default=1000)
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--stored", type=int, default=10_000)
    parser.add_argument("--seed", type=int, default=3)
    parser.add_argument("--originals", type=int, default=4)
    parser.add_argument(
        "--proof", type=Path, help="copy the records of this finished proof instead of making some"
    )
    parser.add_argument("--parts", nargs="+", default=["jobs", "store", "summary"])
    parser.add_argument("--out", type=Path)
    options = parser.parse_args()
    found: dict[str, object] = {}
    if "jobs" in options.parts:
        with tempfile.TemporaryDirectory() as folder, chdir(folder):
            for name, launcher in (
                ("local", Local(options.workers)),
                ("dask", Dask(workers=options.workers)),
            ):
                found[name] = overhead(launcher, options.jobs, options.workers)
                print(name, found[name], flush=True)
    if "store" in options.parts:
        for stored in (100, 1000, options.stored):
            found[f"store {stored}"] = store_costs(stored)
            print("store", stored, found[f"store {stored}"], flush=True)
    if "summary" in options.parts:
        sizes = sorted({options.stored // 100, options.stored // 10, options.stored} - {0})
        found["summary"] = summary_costs(sizes, options.seed, options.originals, options.proof)
    if options.out is not None:
        options.out.write_text(json.dumps(found, indent=1) + "\n")


if __name__ == "__main__":
    main()
