"""Ten thousand trials on five hundred cores: what the queue costs, by a model and by a run of it, and where it bends.

    .venv/bin/python benchmarks/cluster_scale.py                   # the model, some seconds
    .venv/bin/python benchmarks/cluster_scale.py --real 2 0.5      # and Dask itself, trials of 2 s and of 0.5 s

The model: every trial passes the command (submit), the scheduler, a core, the file server and the command again (the
outcome). Command, scheduler and file server are one server each that takes trials in turn; a core pays its gap besides.
Their times a trial are what cluster_overhead.py measures; the trials' own are log-normal.

The run: Dask's scheduler and the command of gpsim as they are, but its cores are threads, and its trials sleep.
"""

import argparse
import heapq
import json
import logging
import random
import tempfile
import time
from contextlib import chdir, nullcontext
from dataclasses import asdict, dataclass, replace
from functools import partial
from pathlib import Path

from gpsim.launchers import Dask, Progress, Task, run_tasks

MEDIAN, SIGMA, LONGEST = 6.5, 0.9, 64.0  # s, -, s: the diagnoses of docs/results.md, on one core
ON_WAY = 2  # tasks handed out for each core, as gpsim/launchers/dask_client.py does


@dataclass(frozen=True)
class Costs:
    """Seconds a trial: of the command when it hands one out and takes one in, of the scheduler, of the file server.

    gap: between two trials of one core; fixed: before the first worker works; summary: at the end, a trial.
    """

    submit: float = 0.4e-3
    outcome: float = 0.6e-3
    scheduler: float = 1.0e-3
    files: float = 1.0e-3
    gap: float = 5e-3
    fixed: float = 20.0
    summary: float = 3e-3


def durations(trials: int, median: float, seed: int = 1) -> list[float]:
    """Seconds of each trial, in the order of the plan."""
    draw = random.Random(seed)
    longest = LONGEST * median / MEDIAN
    return [min(median * draw.lognormvariate(0.0, SIGMA), longest) for _ in range(trials)]


def modelled(work: list[float], cores: int, costs: Costs) -> dict[str, float]:
    """Wall seconds without and with the summary, and the share of the cores' time that was work."""
    free = {"command": 0.0, "scheduler": 0.0, "files": 0.0}

    def served(name: str, at: float, takes: float) -> float:
        free[name] = max(free[name], at) + takes
        return free[name]

    # Events in the order of time: (when, number, what, trial); a core is no more than a count.
    events: list[tuple[float, int, str, int]] = []
    counter = iter(range(10 * len(work) + 10))

    def at(when: float, what: str, trial: int) -> None:
        heapq.heappush(events, (when, next(counter), what, trial))

    ahead = min(ON_WAY * cores, len(work))
    for trial in range(ahead):
        at(0.0, "submit", trial)
    following, idle, waiting, last = ahead, cores, [], 0.0
    while events:
        now, _, what, trial = heapq.heappop(events)
        if what == "submit":
            at(served("command", now, costs.submit), "assign", trial)
        elif what == "assign":
            at(served("scheduler", now, costs.scheduler / 2), "queue", trial)
        elif what == "queue":
            if idle:
                idle -= 1
                at(now + costs.gap + work[trial], "write", trial)
            else:
                waiting.append(trial)
        elif what == "write":
            at(served("files", now, costs.files), "end", trial)
        elif what == "end":
            at(served("scheduler", now, costs.scheduler / 2), "outcome", trial)
            if waiting:
                following_trial = waiting.pop(0)
                at(now + costs.gap + work[following_trial], "write", following_trial)
            else:
                idle += 1
        else:
            last = max(last, served("command", now, costs.outcome))
            if following < len(work):
                at(last, "submit", following)
                following += 1
    wall = costs.fixed + last
    return {
        "wall_s": wall,
        "with_summary_s": wall + costs.summary * len(work),
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
    from gpsim.launchers import dask_worker

    dask_worker._ONE = nullcontext()  # type: ignore[assignment]


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
        "--medians", type=float, nargs="+", default=[60.0, 6.5, 2.0, 1.0, 0.5, 0.2], help="s of a trial"
    )
    for name, value in asdict(Costs()).items():
        parser.add_argument(f"--{name}", type=float, default=value, help="s")
    parser.add_argument("--real", type=float, nargs="*", default=[], help="medians to run on Dask itself [s]")
    parser.add_argument("--processes", type=int, default=4, help="of the workers whose threads are the cores")
    parser.add_argument("--out", type=Path)
    options = parser.parse_args()
    costs = replace(Costs(), **{name: getattr(options, name) for name in asdict(Costs())})
    found: dict[str, object] = {"costs": asdict(costs)}
    for median in options.medians:
        found[f"model {median:g} s"] = told = modelled(
            durations(options.trials, median), options.cores, costs
        )
        print(f"model {median:g} s", told, flush=True)
    for cores in (100, 200, 500, 1000, 2000, 5000):
        found[f"model {cores} cores"] = told = modelled(durations(options.trials, MEDIAN), cores, costs)
        print(f"model {cores} cores", told, flush=True)
    for median in options.real:
        found[f"real {median:g} s"] = told = real(
            durations(options.trials, median), options.cores, options.processes
        )
        print(f"real {median:g} s", told, flush=True)
    if options.out is not None:
        options.out.write_text(json.dumps(found, indent=1) + "\n")


if __name__ == "__main__":
    main()
