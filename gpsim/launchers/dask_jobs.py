"""Tasks on a Dask scheduler: the client's side, and what runs on a worker.

A task ends there in a report and never in an exception: Dask would pickle that, and log it with a traceback. Where no
file system is shared, files travel with it: a tar archive and its SHA-256, never a pickle.
"""

from __future__ import annotations

import hashlib
import io
import logging
import os
import queue
import socket
import tarfile
import tempfile
import threading
import time
import traceback
import uuid
import warnings
from collections.abc import Callable, Iterable, Iterator
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
from gpsim.files import disk_errors, files_below, tells_of_full_disk
from gpsim.launchers.launcher import Dask, Slurm
from gpsim.launchers.running import JobFailedError, LostSchedulerError, Outcome, Progress, Task, Update
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
AGAIN = "run the same command to carry on"


class DaskWorkers:
    """At most a few tasks a thread are on their way at a time, the others wait here."""

    def __init__(
        self, client: Client, mark: str, launcher: Dask | Slurm, update: Update, upkeep: Upkeep | None
    ) -> None:
        self.executor = client.get_executor(pure=False)
        self.client, self._mark, self._launcher = client, mark, launcher
        self._update, self._upkeep = update, upkeep
        self._told: queue.SimpleQueue[tuple[str, int, int, str]] = queue.SimpleQueue()
        self._threads, self._looked = 0, -LOOK
        self._seen, self._patience = time.monotonic(), ALONE
        client.subscribe_topic(TOPIC, lambda event: self._told.put(tuple(event[1])))

    def room(self) -> int:
        """Twice the threads of all workers, and some for those that come."""
        now = time.monotonic()
        if now - self._looked > LOOK:
            self._looked = now
            with suppress(OSError, ValueError, TimeoutError):
                self._threads = sum(self.client.nthreads().values())
            self._say_if_alone(now)
        return AHEAD * self._threads + SPARE

    def sent(self, task: Task) -> Callable[[], Any]:
        """With what it needs where no file system is shared."""
        parcel = None
        if not self._launcher.shared:
            for folder in task.writes:
                _check_inside(folder)
            parcel = packed(task.needs())
        return partial(
            carry_out,
            Errand(task.label, task.work, str(Path.cwd()), self._mark, PATIENCE, lent(), parcel, task.writes),
        )

    def look(self, unfinished: int) -> None:
        """So many workers are enough. Raises LostSchedulerError where nobody knows what became of the tasks."""
        with suppress(queue.Empty):
            while True:
                self._update(*self._told.get_nowait())
        if self.client.status != "running":
            raise LostSchedulerError(f"the Dask scheduler is gone; {AGAIN}")
        if self._upkeep is not None:
            self._upkeep.tasks = unfinished
            if self._upkeep.why is not None:
                raise UsageError(self._upkeep.why)

    def outcome(self, task: Task, done: Future[Any]) -> Outcome:
        """As its report says, or why there is none."""
        error: Exception
        try:
            return _outcome(task, done.result())
        except CancelledError:
            error = LostSchedulerError(f"the Dask scheduler forgot {task.label}; {AGAIN}")
        except KilledWorker as killed:
            last = getattr(killed.last_worker, "address", killed.last_worker)
            error = UsageError(
                f"{task.label}: {DEATHS + 1} workers died of it, the last on {last} (out of memory?); give more "
                f"launcher.memory, or fewer workers a machine, and {AGAIN}"
            )
        except UsageError:
            raise
        except Exception as other:
            error = JobFailedError(f"{task.label}: {type(other).__name__}: {other}")
        return Outcome(task.label, error=error)

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
                why = "the workers that were started here do not come; they are started anew"
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
        stack.enter_context(warnings.catch_warnings())
        warnings.filterwarnings("ignore", "Sending large graph", UserWarning)  # that a parcel is large
        upkeep = None
        to: Any = launcher.address if isinstance(launcher, Dask) else None
        if isinstance(launcher, Slurm):
            to, upkeep = stack.enter_context(slurm_workers(launcher))
        elif to is None:
            to = stack.enter_context(_local_cluster(launcher))
        else:
            check_keys(to)
        client = stack.enter_context(_connected(to))
        launcher.announce(f"Dask's dashboard: {_dashboard(client, launcher)}")
        mark = stack.enter_context(_mark()) if launcher.shared else ""
        workers = DaskWorkers(client, mark, launcher, update, upkeep)
        stack.callback(workers.leave)
        yield workers


def _dashboard(client: Client, launcher: Dask | Slurm) -> str:
    """The dashboard's link. Dask would give that of what is started here the scheduler's address."""
    if isinstance(launcher, Dask) and launcher.address is not None:
        return str(client.dashboard_link)
    return str(format_dashboard_link(launcher.dashboard, client.scheduler_info()["services"]["dashboard"]))


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


def _outcome(task: Task, report: Report) -> Outcome:
    node, result = report.node, report.result
    if report.refusal is not None:
        return Outcome(task.label, error=UsageError(f"{report.refusal} (on {node})"), node=node)
    if report.crash is not None:
        said = f"{task.label} failed on {node}:\n{report.crash}"
        return Outcome(task.label, error=JobFailedError(said), node=node)
    if report.parcel is not None:
        with tempfile.TemporaryDirectory(prefix="gpsim-back-") as folder:
            unpacked(report.parcel, Path(folder))
            result = task.keep(Path(folder), result)
    return Outcome(task.label, result, node=node)


@dataclass(frozen=True)
class Parcel:
    """An archive of files by their relative paths."""

    content: bytes
    sha256: str


def packed(paths: Iterable[Path], without: Iterable[str] = ()) -> Parcel:
    """The files at and below relative paths; hidden ones, as locks are, and those named in `without` stay.

    Raises UsageError for a path that leads out of this folder: on another machine it would be another's.
    """
    files: dict[str, Path] = {}
    for path in paths:
        _check_inside(path)
        found = files_below(path) if path.is_dir() else [path] if path.is_file() else []
        files |= {p.as_posix(): p for p in found if not any(part.startswith(".") for part in p.parts)}
    stream = io.BytesIO()
    with tarfile.open(fileobj=stream, mode="w") as archive:
        for name in sorted(files.keys() - set(without)):
            archive.add(files[name], name, recursive=False)
    content = stream.getvalue()
    return Parcel(content, hashlib.sha256(content).hexdigest())


def unpacked(parcel: Parcel, folder: Path) -> list[str]:
    """Write a parcel's files below a folder; their names. Raises UsageError where it is not what was sent."""
    if hashlib.sha256(parcel.content).hexdigest() != parcel.sha256:
        raise UsageError(f"a parcel was damaged on its way; {AGAIN}")
    with tarfile.open(fileobj=io.BytesIO(parcel.content)) as archive:
        archive.extractall(folder, filter="data")
        return archive.getnames()


def _check_inside(path: Path) -> None:
    """Raise UsageError for a path that is not below the folder in which the command was started."""
    if path.is_absolute() or ".." in path.parts:
        raise UsageError(
            f"{path}: with launcher.shared=false everything lies below the folder where the command is started; give "
            "a relative path, and start it further up"
        )


_ONE = threading.Lock()  # a worker with several threads has one current folder
_seen: set[str] = set()
_missed: set[str] = set()


@dataclass(frozen=True)
class Errand:
    """A task as it travels.

    folder: where the command was started; mark: a file there, by which a worker sees that it is the same folder, if it
    comes in sight within `patience` seconds; parcel: None where it is shared, else what the task reads; writes: below
    what it writes; trusted: the code that the command may run.
    """

    label: str
    work: Callable[[Progress], Any]
    folder: str
    mark: str
    patience: float
    trusted: Lent
    parcel: Parcel | None = None
    writes: tuple[Path, ...] = ()


@dataclass(frozen=True)
class Report:
    """How an errand ended. refusal: the one line of a UsageError; crash: the traceback of anything else."""

    node: str
    result: Any = None
    refusal: str | None = None
    crash: str | None = None
    parcel: Parcel | None = None


def carry_out(errand: Errand) -> Report:
    """Run a task on this worker."""
    node, back = socket.gethostname(), None
    with _ONE:
        try:
            take(errand.trusted)
            with _its_folder(errand) as known:
                result = errand.work(_teller(errand.label, node))
                if errand.parcel is not None:
                    back = packed([f for f in errand.writes if os.path.lexists(f)], without=known)
            return Report(node, result, parcel=back)
        except UsageError as error:
            return Report(node, refusal=str(error))
        except (Exception, SystemExit) as error:
            if isinstance(error, OSError) and tells_of_full_disk(str(error)):
                said = f"no space left on a disk there ({error}); free some and run again"
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


@contextmanager
def _its_folder(errand: Errand) -> Iterator[list[str]]:
    """Within it the current folder is the command's or, where none is shared, one with what the task needs."""
    with ExitStack() as stack:
        folder, known = errand.folder, list[str]()
        if errand.parcel is None:
            _check_shared(Path(folder), errand.mark, errand.patience)
        else:
            folder = stack.enter_context(tempfile.TemporaryDirectory(prefix="gpsim-job-"))
            known = unpacked(errand.parcel, Path(folder))
        stack.enter_context(chdir(folder))
        yield known


def _check_shared(folder: Path, mark: str, patience: float) -> None:
    """Raise UsageError where this machine does not see the command's folder. It is waited for once a command."""
    until = time.monotonic() + (0.0 if mark in _missed else patience)
    while mark not in _seen:
        if (folder / mark).is_file():
            _seen.add(mark)
        elif time.monotonic() >= until:
            _missed.add(mark)
            raise UsageError(
                f"{folder}: not the folder in which the command was started; give launcher.shared=false where there is "
                "no shared file system"
            )
        else:
            time.sleep(0.2)
