"""Tasks on a Dask scheduler: the client's side."""

from __future__ import annotations

import logging
import queue
import tempfile
import time
import uuid
import warnings
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import dask
from distributed import Client, Future, LocalCluster
from distributed.scheduler import KilledWorker
from distributed.utils import format_dashboard_link

from gpsim.errors import UsageError
from gpsim.files import disk_errors
from gpsim.launchers.dask_worker import TOPIC, Errand, Report, carry_out
from gpsim.launchers.launcher import Dask, Slurm
from gpsim.launchers.parcels import check_inside, packed, unpacked
from gpsim.launchers.security import LOOPBACK, check_keys, own_keys
from gpsim.launchers.slurm import SlurmWorkers, slurm_workers
from gpsim.launchers.tasks import JobFailedError, LostSchedulerError, Outcome, Task, Update
from gpsim.trust import lent

MOMENT = 0.2  # s that one look for what has ended waits
AHEAD = 2  # tasks handed out for each thread, so that none waits for the next
SPARE = 8  # tasks handed out besides: for workers that come in the meantime
LOOK = 1.0  # s between two counts of the threads
PATIENCE = 10.0  # s in which a file that was just written here comes in sight on another machine
CONNECT = 20  # s within which a scheduler answers
ALONE = 10.0  # s without any worker after which that is said
DEATHS = 5  # workers that a task may lose before it is given up: a task that kills them would go on for ever


@dataclass
class _Started:
    task: Task
    future: Future


class DaskExecutor:
    """At most a few tasks a thread are on their way at a time, the others wait here."""

    def __init__(
        self,
        client: Client,
        mark: str,
        launcher: Dask | Slurm,
        workers: SlurmWorkers | None = None,
    ) -> None:
        self._client, self._mark, self._shared, self._workers = client, mark, launcher.shared, workers
        self._alone = _Alone(client, launcher)
        self._folder = str(Path.cwd())
        self._running: dict[str, _Started] = {}
        self._ended: queue.SimpleQueue[str] = queue.SimpleQueue()
        self._told: queue.SimpleQueue[tuple[str, int, int, str]] = queue.SimpleQueue()
        self._threads, self._looked = 0, -LOOK
        client.subscribe_topic(TOPIC, lambda event: self._told.put(tuple(event[1])))

    def free(self) -> int:
        """Twice the threads of all workers, and some for those that come."""
        if time.monotonic() - self._looked > LOOK:
            self._looked, self._threads = time.monotonic(), self._count()
            self._alone.look(self._threads)
        return max(0, AHEAD * self._threads + SPARE - len(self._running))

    def start(self, task: Task) -> None:
        """To the scheduler, with what it needs where no file system is shared."""
        parcel = None
        if not self._shared:
            for folder in task.writes:
                check_inside(folder)
            parcel = packed(task.needs())
        errand = Errand(
            task.label, task.work, self._folder, self._mark, PATIENCE, lent(), parcel, task.writes
        )
        key = f"{uuid.uuid4().hex}"
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", UserWarning)  # that a parcel is large
            future = self._client.submit(carry_out, errand, key=key, pure=False)
        self._running[key] = _Started(task, future)
        future.add_done_callback(lambda done: self._ended.put(done.key))

    def ended(self, update: Update) -> list[Outcome]:
        """As every executor's; raises LostSchedulerError where nobody knows what became of the tasks."""
        keys = self._wait()
        with suppress(queue.Empty):
            while True:
                update(*self._told.get_nowait())
        if self._client.status != "running":
            raise LostSchedulerError("the Dask scheduler is gone; run the same command to carry on")
        if self._workers is not None and (why := self._workers.given_up()):
            raise UsageError(why)
        started = [self._running.pop(key) for key in keys if key in self._running]
        fine = [s.future for s in started if s.future.status == "finished"]
        reports = dict(zip([f.key for f in fine], self._gathered(fine), strict=True))
        return [self._outcome(s, reports.get(s.future.key)) for s in started]

    def expect(self, unfinished: int) -> None:
        """So many workers are enough."""
        if self._workers is not None:
            self._workers.wanted(unfinished)

    def leave(self) -> None:
        """Cancel what is under way: nobody waits for it."""
        futures = [started.future for started in self._running.values()]
        if futures and self._client.status == "running":
            with suppress(Exception):  # the scheduler may go at the same time
                self._client.cancel(futures, force=True)

    def _count(self) -> int:
        with suppress(OSError, ValueError, TimeoutError):
            return sum(self._client.nthreads().values())
        return self._threads

    def _wait(self) -> list[str]:
        """Keys of the tasks that ended: all that are known, after a moment if none is yet."""
        found: list[str] = []
        with suppress(queue.Empty):
            found.append(self._ended.get(timeout=MOMENT))
            while True:
                found.append(self._ended.get_nowait())
        return found

    def _gathered(self, futures: list[Future]) -> list[Report]:
        if not futures:
            return []
        try:
            reports: list[Report] = self._client.gather(futures)
        except Exception as error:  # a lost scheduler, or a lost worker whose result nobody can make again
            raise LostSchedulerError(
                f"results could not be fetched ({type(error).__name__}); run the same command to carry on"
            ) from error
        return reports

    def _outcome(self, started: _Started, report: Report | None) -> Outcome:
        task = started.task
        if report is None:
            return Outcome(task.label, error=_lost(task.label, started.future))
        if report.refusal is not None:
            return Outcome(task.label, error=UsageError(_on(report.node, report.refusal)), node=report.node)
        if report.crash is not None:
            said = f"{task.label} failed on {report.node}:\n{report.crash}"
            return Outcome(task.label, error=JobFailedError(said), node=report.node)
        if report.parcel is None:
            return Outcome(task.label, report.result, node=report.node)
        with tempfile.TemporaryDirectory(prefix="gpsim-back-") as folder:
            unpacked(report.parcel, Path(folder))
            return Outcome(task.label, task.keep(Path(folder), report.result), node=report.node)


class _Alone:
    """Says once in a while that nobody works: a command that waits without a word looks like one that hangs."""

    def __init__(self, client: Client, launcher: Dask | Slurm) -> None:
        self._client, self._launcher, self._seen = client, launcher, time.monotonic()
        self._patience = ALONE

    def look(self, threads: int) -> None:
        """threads: of all workers now."""
        now = time.monotonic()
        if threads:
            self._seen, self._patience = now, ALONE
        elif now - self._seen > self._patience:
            self._patience *= 6  # the next time is later
            self._launcher.announce(self._said())

    def _said(self) -> str:
        if isinstance(self._launcher, Slurm):
            return "waiting: no worker yet, the SLURM jobs are in the queue (squeue --me)"
        if self._launcher.address is None:
            return "waiting: the workers that were started here do not come; they are started anew"
        address = self._client.scheduler.address
        return f"waiting: {address} has no workers; start some with: dask worker {address} --nthreads 1 --nworkers 4"


def _on(node: str, said: str) -> str:
    return f"{said} (on {node})"


def _lost(label: str, future: Future) -> Exception:
    """Why a task has no report."""
    if future.status == "error":
        error = future.exception()
        if isinstance(error, KilledWorker):
            address = str(getattr(error.last_worker, "address", error.last_worker))
            return UsageError(
                f"{label}: {DEATHS + 1} workers died of it, the last on {address} (out of memory?); give more "
                "launcher.memory, or fewer workers a machine, and run the same command to carry on"
            )
        return JobFailedError(f"{label}: {type(error).__name__}: {error}")
    return LostSchedulerError(
        f"the Dask scheduler forgot {label} ({future.status}); run the same command to carry on"
    )


@contextmanager
def dask_executor(launcher: Dask | Slurm) -> Iterator[DaskExecutor]:
    """An executor on the launcher's scheduler; what was started for it ends with the block."""
    logging.getLogger("distributed").setLevel(logging.CRITICAL)  # what matters is said in one line
    settings = {
        "logging.distributed": "critical",
        "distributed.scheduler.allowed-failures": DEATHS,
        "distributed.deploy.lost-worker-timeout": "5s",
        "distributed.comm.timeouts.connect": f"{CONNECT}s",
        "distributed.worker.memory.terminate": 0.95,
    }
    with dask.config.set(settings), ExitStack() as stack:
        workers = None
        if isinstance(launcher, Slurm):
            workers = stack.enter_context(slurm_workers(launcher))
            client = stack.enter_context(_connected(workers.cluster))
        elif launcher.address is None:
            client = stack.enter_context(_connected(stack.enter_context(_local_cluster(launcher))))
        else:
            check_keys(launcher.address)
            client = stack.enter_context(_connected(launcher.address))
        launcher.announce(f"Dask's dashboard: {_dashboard(client, launcher)}")
        mark = stack.enter_context(_mark()) if launcher.shared else ""
        executor = DaskExecutor(client, mark, launcher, workers)
        try:
            yield executor
        finally:
            executor.leave()


def _dashboard(client: Client, launcher: Dask | Slurm) -> str:
    """The dashboard's link. Dask would give that of what is started here the scheduler's address."""
    if isinstance(launcher, Dask) and launcher.address is not None:
        return str(client.dashboard_link)
    return str(format_dashboard_link(launcher.dashboard, client.scheduler_info()["services"]["dashboard"]))


@contextmanager
def _local_cluster(launcher: Dask) -> Iterator[Any]:
    """Workers of this machine, one thread each, which nobody else can reach or give orders."""
    with LocalCluster(
        n_workers=launcher.workers or 1,
        threads_per_worker=1,
        processes=True,
        silence_logs=logging.CRITICAL,
        host=LOOPBACK,
        protocol="tls://",
        security=own_keys(),
        dashboard_address=f"{launcher.dashboard}:0",
    ) as cluster:
        yield cluster


@contextmanager
def _connected(to: Any) -> Iterator[Client]:
    try:
        client = Client(to, timeout=CONNECT, set_as_default=False)
    except (OSError, ValueError, TimeoutError) as error:
        raise UsageError(
            f"launcher.address={to}: no Dask scheduler answers ({' '.join(str(error).split())[:120]}); start one with: "
            "dask scheduler"
        ) from error
    try:
        yield client
    finally:
        with suppress(Exception):  # a scheduler that is gone cannot be told
            client.close(timeout=5)


@contextmanager
def _mark() -> Iterator[str]:
    """A file in the current folder, by which workers see that it is the same for them."""
    path = Path(f".gpsim-here-{uuid.uuid4().hex}")
    with disk_errors(Path.cwd(), "folder"):
        path.touch()
    try:
        yield path.name
    finally:
        path.unlink(missing_ok=True)
