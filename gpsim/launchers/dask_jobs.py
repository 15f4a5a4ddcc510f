"""Tasks on a Dask scheduler: the client's side, and what runs on a worker.

A task ends there in a report and never in an exception: Dask would pickle that, and log it with a traceback. Artifacts
lie on the file system that all share.
"""

from __future__ import annotations

import logging
import queue
import socket
import threading
import time
import traceback
import uuid
from collections.abc import Callable, Iterator
from concurrent.futures import CancelledError, Future
from contextlib import ExitStack, chdir, contextmanager, suppress
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import dask
from distributed import Client, LocalCluster, get_worker
from distributed.scheduler import KilledWorker
from distributed.utils import format_dashboard_link

from gpsim.errors import UsageError
from gpsim.files import disk_errors, tells_of_full_disk
from gpsim.launchers.running import (
    Dask,
    JobFailedError,
    LostSchedulerError,
    Place,
    Progress,
    Slurm,
    Task,
    Update,
)
from gpsim.launchers.slurm import LOOPBACK, Upkeep, check_keys, own_keys, slurm_workers
from gpsim.trust import Lent, lent, take

TOPIC = "gpsim"
AHEAD = 2  # tasks handed out for each thread, so that none waits for the next
SPARE = 8  # tasks handed out besides: for workers that come in the meantime
LOOK = 1.0  # s between two counts of the threads
BETWEEN = 1.0  # s between two messages of one task
PATIENCE = 10.0  # s in which a file that was just written here comes in sight on another machine
CONNECT = 20  # s within which a scheduler answers
ALONE = 10.0  # s without any worker after which that is said
DEATHS = 5  # workers that a task may lose before it is given up: a task that kills them would go on for ever
AGAIN = "run the same command to continue"


class DaskWorkers(Place):
    """At most a few tasks a thread are on their way at a time, the others wait here."""

    def __init__(
        self, client: Client, mark: str, launcher: Dask | Slurm, update: Update, upkeep: Upkeep | None
    ) -> None:
        told: queue.SimpleQueue[tuple[str, int, int, str]] = queue.SimpleQueue()
        super().__init__(client.get_executor(pure=False), SPARE, update, told)
        self.client, self._mark, self._launcher, self._upkeep = client, mark, launcher, upkeep
        self._threads, self._looked = 0, -LOOK
        self._seen, self._patience = time.monotonic(), ALONE
        client.subscribe_topic(TOPIC, lambda event: told.put(tuple(event[1])))

    def room(self) -> int:
        """Twice the threads of all workers, and some for those that come."""
        now = time.monotonic()
        if now - self._looked > LOOK:
            self._looked = now
            with suppress(OSError, ValueError, TimeoutError):
                self._threads = sum(self.client.nthreads().values())
            self._say_if_alone(now)
        return AHEAD * self._threads + self.count

    def sent(self, task: Task) -> Callable[[], Any]:
        """With the command's folder, and the code that it may run."""
        errand = Errand(task.label, task.work, str(Path.cwd()), self._mark, PATIENCE, lent())
        return partial(carry_out, errand)

    def look(self, unfinished: int) -> None:
        """So many workers are enough. Raises LostSchedulerError where nobody knows what became of the tasks."""
        super().look(unfinished)
        if self.client.status != "running":
            raise LostSchedulerError(f"the Dask scheduler is gone; {AGAIN}")
        if self._upkeep is not None:
            self._upkeep.tasks = unfinished
            if self._upkeep.why is not None:
                raise UsageError(self._upkeep.why)

    def result(self, task: Task, done: Future[Any]) -> tuple[Any, str]:
        """As its report says, or why there is none."""
        try:
            report: Report = done.result()
        except CancelledError as error:
            raise LostSchedulerError(f"the Dask scheduler forgot {task.label}; {AGAIN}") from error
        except KilledWorker as killed:
            last = getattr(killed.last_worker, "address", killed.last_worker)
            raise UsageError(
                f"{task.label}: {DEATHS + 1} workers died from it, the last on {last} (out of memory?); increase "
                f"launcher.memory, or use fewer workers per machine, and {AGAIN}"
            ) from killed
        except Exception as error:
            raise JobFailedError(f"{task.label}: {type(error).__name__}: {error}") from error
        if report.refusal is not None:
            raise UsageError(f"{report.refusal} (on {report.node})")
        if report.crash is not None:
            raise JobFailedError(f"{task.label} failed on {report.node}:\n{report.crash}")
        return report.result, report.node

    def leave(self) -> None:
        """Cancel what is under way: nobody waits for it."""
        if self.client.status == "running":
            with suppress(Exception):  # the scheduler may go at the same time
                self.executor.shutdown(wait=False)

    def _say_if_alone(self, now: float) -> None:
        """Once in a while: a command that waits without a word looks like one that hangs."""
        if self._threads:
            self._seen, self._patience = now, ALONE
        elif now - self._seen > self._patience:
            self._patience *= 6  # the next time is later
            address = self.client.scheduler.address
            if isinstance(self._launcher, Slurm):
                why = "no worker yet, the SLURM jobs are in the queue (squeue --me)"
            elif self._launcher.address is None:
                why = "the workers started here do not respond; starting new ones"
            else:
                start = f"dask worker {address} --nthreads 1 --nworkers 4"
                why = f"{address} has no workers; start some with: {start}"
            self._launcher.announce(f"waiting: {why}")


@contextmanager
def dask_workers(launcher: Dask | Slurm, update: Update) -> Iterator[DaskWorkers]:
    """The workers of the launcher's scheduler; what was started for it ends with the block."""
    logging.getLogger("distributed").setLevel(logging.CRITICAL)  # what matters is said in one line
    settings = {
        "logging.distributed": "critical",
        "distributed.scheduler.allowed-failures": DEATHS,
        "distributed.deploy.lost-worker-timeout": "5s",
        "distributed.comm.timeouts.connect": f"{CONNECT}s",
        "distributed.worker.memory.terminate": 0.95,
    }
    with dask.config.set(settings), ExitStack() as stack:
        upkeep, theirs = None, isinstance(launcher, Dask) and launcher.address is not None
        to: Any
        if isinstance(launcher, Slurm):
            to, upkeep = stack.enter_context(slurm_workers(launcher))
        elif launcher.address is None:
            to = stack.enter_context(_local_cluster(launcher))
        else:
            check_keys(to := launcher.address)
        client = stack.enter_context(_connected(to))
        # Dask would give the dashboard of what is started here the scheduler's address.
        port = client.scheduler_info()["services"]["dashboard"]
        link = client.dashboard_link if theirs else format_dashboard_link(launcher.dashboard, port)
        launcher.announce(f"Dask's dashboard: {link}")
        workers = DaskWorkers(client, stack.enter_context(_mark()), launcher, update, upkeep)
        stack.callback(workers.leave)
        yield workers


def _local_cluster(launcher: Dask) -> Any:
    """Workers of this machine, one thread each, which nobody else can reach or give orders."""
    return LocalCluster(
        n_workers=launcher.workers or 1,
        threads_per_worker=1,
        processes=True,
        silence_logs=logging.CRITICAL,
        host=LOOPBACK,
        protocol="tls://",
        security=own_keys(),
        dashboard_address=f"{launcher.dashboard}:0",
    )


@contextmanager
def _connected(to: Any) -> Iterator[Client]:
    try:
        client = Client(to, timeout=CONNECT, set_as_default=False)
    except (OSError, ValueError, TimeoutError) as error:
        raise UsageError(
            f"launcher.address={to}: no Dask scheduler answers ({' '.join(str(error).split())[:120]}); start one "
            "with: dask scheduler"
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


_ONE = threading.Lock()  # a worker with several threads has one current folder
_seen: set[str] = set()
_missed: set[str] = set()


@dataclass(frozen=True)
class Errand:
    """A task as it travels.

    folder: where the command was started; mark: a file there, by which a worker sees that it is the same folder, if it
    comes in sight within `patience` seconds; trusted: the code that the command may run.
    """

    label: str
    work: Callable[[Progress], Any]
    folder: str
    mark: str
    patience: float
    trusted: Lent


@dataclass(frozen=True)
class Report:
    """How an errand ended. refusal: the one line of a UsageError; crash: the traceback of anything else."""

    node: str
    result: Any = None
    refusal: str | None = None
    crash: str | None = None


def carry_out(errand: Errand) -> Report:
    """Run a task on this worker."""
    node = socket.gethostname()
    with _ONE:
        try:
            take(errand.trusted)
            _check_shared(Path(errand.folder), errand.mark, errand.patience)
            with chdir(errand.folder):
                return Report(node, errand.work(_teller(errand.label, node)))
        except UsageError as error:
            return Report(node, refusal=str(error))
        except (Exception, SystemExit) as error:
            if isinstance(error, OSError) and tells_of_full_disk(str(error)):
                said = f"no disk space left there ({error}); free some and run again"
                return Report(node, refusal=said)
            return Report(node, crash=traceback.format_exc())


def _teller(label: str, node: str) -> Progress:
    """Messages to the command, not more than one in a while; what of no total is said at once."""
    worker, last = get_worker(), 0.0

    def tell(done: int, total: int, note: str) -> None:
        nonlocal last
        if not total or time.monotonic() - last >= BETWEEN:
            last = time.monotonic()
            worker.log_event(TOPIC, (label, done, total, f"{note} on {node}".strip()))

    return tell


def _check_shared(folder: Path, mark: str, patience: float) -> None:
    """Raise UsageError where this machine does not see the command's folder. It is waited for once a command."""
    until = time.monotonic() + (0.0 if mark in _missed else patience)
    while mark not in _seen:
        if (folder / mark).is_file():
            _seen.add(mark)
        elif time.monotonic() >= until:
            _missed.add(mark)
            raise UsageError(
                f"{folder}: not the folder in which the command was started: workers need a shared file system"
            )
        else:
            time.sleep(0.2)
