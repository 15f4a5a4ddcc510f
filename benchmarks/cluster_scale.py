"""Ten thousand trials on five hundred cores: what the queue costs, by a model and by a run of it, and where it bends.

    .venv/bin/python benchmarks/cluster_scale.py                   # the model, some seconds
    .venv/bin/python benchmarks/cluster_scale.py --real 2 0.5      # and Dask itself, trials of 2 s and of 0.5 s

The model: every trial passes the command and Dask's scheduler, which share a process, a core, the file server and the
process again (the outcome). Process and file server take one trial at a time; a core pays its gap besides. Their times
a trial are what this file and cluster_overhead.py measure; the trials' own are log-normal.

Of a proof every trial has folders of its own. In a sweep all artifacts of a stage lie on one shelf, whose names a job
lists; --looking says what it cost if every job looked at each version that is stored, as one does without markers.

The run: Dask's scheduler and the command of gpsim as they are, but its cores are threads, and its trials sleep.
"""

import argparse
import heapq
import itertools
import json
import logging
import random
import tempfile
import time
from collections import deque
from contextlib import chdir, nullcontext
from dataclasses import asdict, dataclass, replace
from functools import partial
from pathlib import Path

from gpsim.launchers import Dask, Progress, Task, run_tasks

MEDIAN, SIGMA, LONGEST = 6.5, 0.9, 64.0  # s, -, s: the diagnoses of docs/results.md, on one core
ON_WAY = 2  # tasks handed out for each core, as gpsim/launchers/dask_jobs.py does


@dataclass(frozen=True)
class Costs:
    """What a trial costs beside its work.

    process: s of the command and the scheduler together; gap: s between two trials of a core; operations: on files and
    folders, rate: how many of these the file server does in a second; fixed: s before the first worker works;
    summary: s at the end.
    """

    process: float = 3.8e-3
    gap: float = 1e-3
    operations: int = 80
    rate: float = 20_000.0
    fixed: float = 20.0
    summary: float = 13e-3


LISTINGS, NAMES = 3, 200  # of a shelf by a job; names that one answer of the file server holds
MANIFEST = 3  # operations that reading one takes


def durations(trials: int, median: float, seed: int = 1) -> list[float]:
    """Seconds of each trial, in the order of the plan."""
    draw = random.Random(seed)
    longest = LONGEST * median / MEDIAN
    return [min(median * draw.lognormvariate(0.0, SIGMA), longest) for _ in range(trials)]


def shelf_operations(kind: str, stored: int, cores: int) -> float:
    """Of one job beside so many versions. looking: a stat of each, and the manifests made since its worker looked."""
    if kind == "proof":
        return 0.0
    looks = stored + MANIFEST * min(cores, stored) if kind == "looking" else 0
    return looks + LISTINGS * stored / NAMES


def modelled(work: list[float], cores: int, costs: Costs, kind: str = "proof") -> dict[str, float]:
    """Wall seconds without and with the summary, and the share of the cores' time that was work."""
    free, stored, counter = {"process": 0.0, "files": 0.0}, 0, itertools.count()
    events: list[tuple[float, int, str, int]] = []  # when, a number that orders equals, what ends then, trial
    waiting: deque[int] = deque()
    ahead, idle, last = min(ON_WAY * cores, len(work)), cores, 0.0

    def served(name: str, at: float, takes: float) -> float:
        free[name] = max(free[name], at) + takes
        return free[name]

    def then(when: float, what: str, trial: int) -> None:
        heapq.heappush(events, (when, next(counter), what, trial))

    def handed_out(now: float, trial: int) -> None:
        then(served("process", now, costs.process / 2), "queue", trial)

    def begun(now: float, trial: int) -> None:
        then(now + costs.gap + work[trial], "work", trial)

    for trial in range(ahead):
        handed_out(0.0, trial)
    while events:
        now, _, what, trial = heapq.heappop(events)
        if what == "queue" and idle:
            idle -= 1
            begun(now, trial)
        elif what == "queue":
            waiting.append(trial)
        elif what == "work":
            operations = costs.operations + shelf_operations(kind, stored, cores)
            stored += 1
            then(served("files", now, operations / costs.rate), "file", trial)
        elif what == "file":
            then(served("process", now, costs.process / 2), "outcome", trial)
            if waiting:
                begun(now, waiting.popleft())
            else:
                idle += 1
        else:
            last = now
            if ahead < len(work):
                handed_out(now, ahead)
                ahead += 1
    return {
        "wall_s": costs.fixed + last,
        "with_summary_s": costs.fixed + last + costs.summary * len(work),
        "busy": sum(work) / (cores * last),
        "ideal_s": sum(work) / cores,
    }


def sleeps(seconds: float, progress: Progress) -> None:
    """A trial that costs nobody anything."""
    time.sleep(seconds)


def silent(*_: object) -> None:
    pass


def _unlock() -> None:
    """The cores of this run are threads of one process: in truth a worker has one, and its folder."""
    from gpsim.launchers import dask_jobs

    dask_jobs._ONE = nullcontext()  # type: ignore[assignment]


def real(work: list[float], cores: int, processes: int) -> dict[str, float]:
    """The same trials asleep on Dask's own scheduler."""
    from distributed import Client, LocalCluster

    with (
        tempfile.TemporaryDirectory() as folder,
        chdir(folder),
        LocalCluster(
            n_workers=processes,
            threads_per_worker=cores // processes,
            memory_limit=0,
            dashboard_address=":0",
            silence_logs=logging.CRITICAL,
        ) as cluster,
    ):
        with Client(cluster, set_as_default=False) as client:
            client.run(_unlock)
        cpu, begun = time.process_time(), time.perf_counter()
        tasks = [Task(f"trial {i}", partial(sleeps, seconds)) for i, seconds in enumerate(work)]
        ended = sum(o.error is None for o in run_tasks(Dask(cluster.scheduler_address), tasks, silent))
        wall, cpu = time.perf_counter() - begun, time.process_time() - cpu
    assert ended == len(work)
    return {
        "wall_s": wall,
        "busy": sum(work) / (cores * wall),
        "ideal_s": sum(work) / cores,
        "command_and_scheduler_ms": 1e3 * cpu / len(work),
    }


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--trials", type=int, default=10_000)
    parser.add_argument("--cores", type=int, default=500)
    parser.add_argument(
        "--medians", type=float, nargs="+", default=[60.0, MEDIAN, 2.0, 1.0, 0.5], help="s of a trial"
    )
    for name, value in asdict(Costs()).items():
        parser.add_argument(f"--{name}", type=type(value), default=value, help="see Costs")
    parser.add_argument("--looking", action="store_true", help="as well: jobs that look through the shelf")
    parser.add_argument("--real", type=float, nargs="*", default=[], help="medians to run on Dask itself [s]")
    parser.add_argument("--processes", type=int, default=4, help="of the workers whose threads are the cores")
    parser.add_argument("--out", type=Path)
    options = parser.parse_args()
    costs = replace(Costs(), **{name: getattr(options, name) for name in asdict(Costs())})
    found: dict[str, object] = {"costs": asdict(costs)}
    runs = [("proof", median, options.cores) for median in options.medians]
    runs += [("proof", MEDIAN, cores) for cores in (100, 1000, 2000, 5000)]
    kinds = ["sweep", *(["looking"] if options.looking else [])]
    runs += [(kind, MEDIAN, cores) for kind in kinds for cores in (100, options.cores, 2000)]
    for kind, median, cores in runs:
        told = modelled(durations(options.trials, median), cores, costs, kind)
        name = f"{kind}, median {median:g} s, {cores} cores"
        found[name] = told
        print(f"{name:36s}", "  ".join(f"{key} {value:8.3g}" for key, value in told.items()), flush=True)
    for median in options.real:
        found[f"real {median:g} s"] = told = real(
            durations(options.trials, median), options.cores, options.processes
        )
        print(f"real {median:g} s", told, flush=True)
    if options.out is not None:
        options.out.write_text(json.dumps(found, indent=1) + "\n")


if __name__ == "__main__":
    main()
