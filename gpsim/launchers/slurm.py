"""Dask workers as SLURM jobs: as many as there is work for, and a new one for each that is lost; who gives orders."""

from __future__ import annotations

import math
import shutil
import signal
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from distributed import Security
from distributed.deploy.adaptive import Adaptive
from distributed.utils import get_ip

from gpsim.errors import UsageError
from gpsim.files import disk_errors
from gpsim.launchers.running import Slurm
from gpsim.private import write_own

_asked = signal.getsignal(signal.SIGINT)
try:  # dask-jobqueue's import makes Ctrl-C an exit that says nothing went wrong
    from dask_jobqueue import SLURMCluster
    from dask_jobqueue.slurm import SLURMJob
finally:
    signal.signal(signal.SIGINT, _asked)

NAME = "gpsim"  # of the SLURM jobs
LOOK = 5.0  # s between two looks at the queue
FRUITLESS = 3  # jobs in a row that may end before a worker came of them
LOOPBACK = "127.0.0.1"
"""The address that only this machine reaches."""


def own_keys() -> Security:
    """A key and a certificate for this command, in memory.

    Scheduler, workers and client show them: whoever has not the command's key is sent away. A Dask scheduler runs what
    it is sent, as its owner; one that a command starts takes orders from that command alone.
    """
    return Security.temporary()


@contextmanager
def cluster_keys(folder: Path) -> Iterator[Security]:
    """Keys as files, which workers on other machines read: those that Dask's own configuration names, if it does.

    Else new ones, in a folder below `folder` that this user alone can enter; they go with the block.
    """
    if _configured():
        yield Security(require_encryption=True)
        return
    made = own_keys()
    with TemporaryDirectory(prefix=".tls-", dir=folder.absolute(), ignore_cleanup_errors=True) as place:
        certificate, key = Path(place, "certificate.pem"), Path(place, "key.pem")
        write_own(certificate, made.tls_ca_file.encode())
        write_own(key, made.tls_client_key.encode())
        files = {"tls_ca_file": str(certificate)}
        for role in ("client", "scheduler", "worker"):
            files |= {f"tls_{role}_cert": str(certificate), f"tls_{role}_key": str(key)}
        yield Security(require_encryption=True, **files)


def check_keys(address: str) -> None:
    """Raise UsageError where a scheduler asks for a certificate and Dask's configuration names none."""
    if address.startswith("tls://") and not _configured():
        raise UsageError(
            f"launcher.address={address} needs a certificate; name it in Dask's configuration, as "
            "distributed.comm.tls.ca-file, .client.cert and .client.key"
        )


def _configured() -> bool:
    known = Security()
    return bool(known.tls_ca_file and known.tls_client_cert)


class Job(SLURMJob):  # type: ignore[misc]
    """A SLURM job that remembers what `sbatch` said."""

    refusal = ""

    async def start(self) -> None:
        """Submit it."""
        try:
            await super().start()
        except Exception as error:
            said = [line for line in str(error).splitlines() if line.startswith("sbatch:")]
            self.refusal = said[-1] if said else " ".join(str(error).split())[:200]
            raise


class Cluster(SLURMCluster):  # type: ignore[misc]
    """A cluster of such jobs."""

    job_cls = Job


class Upkeep(Adaptive):  # type: ignore[misc]
    """Dask's own scaling after the number of tasks left instead of their durations, which nobody knows before.

    Dask replaces a worker that it has seen and lost. A job that SLURM refused, or that ended before a worker came of
    it, it would wait for without end: these are forgotten here, and so replaced, too. tasks: so many are not finished
    yet; why: no worker comes, once that is sure enough.
    """

    tasks = 0
    logs = Path()
    why: str | None = None
    _looked = -math.inf
    _fruitless = 0

    async def target(self) -> int:
        """As many workers as there is work for; minimum and maximum are Dask's to heed."""
        return self.tasks

    async def workers_to_close(self, target: int) -> list[str]:
        """Workers of jobs that are wholly idle: Dask's own choice may fall on one that works."""
        workers = list(self.cluster.scheduler.workers.values())
        jobs = {str(w.name): self._job_of(str(w.name)) for w in workers}
        busy = {jobs[str(w.name)] for w in workers if w.processing}
        idle = [name for name, job in jobs.items() if job not in busy]
        return idle[: max(0, len(workers) - target)]

    def _job_of(self, worker: str) -> str:
        """Of a job with several processes each worker has the job's name and a number."""
        return worker if worker in self.cluster.workers else worker.rpartition("-")[0]

    async def recommendations(self, target: int) -> Any:
        """Dask's own, after the queue was looked at."""
        if time.monotonic() - self._looked > LOOK:
            self._looked = time.monotonic()
            await self._forget_lost()
        return await super().recommendations(target)

    async def _forget_lost(self) -> None:
        if self.observed:
            self._fruitless = 0
        waiting = {n: job for n, job in self.cluster.workers.items() if not self._arrived(n)}
        if not waiting:
            return
        queued = None  # numbers of the user's jobs that wait or run, where SLURM answers
        with suppress(RuntimeError, OSError):
            asked = ["squeue", "--me", "--noheader", "--format=%A", "--states=PD,CF,R,S,CG"]
            queued = set((await Job._call(asked)).split())
        for name, job in waiting.items():
            if job.job_id is not None and (queued is None or job.job_id in queued):
                continue
            self._fruitless += 1
            del self.cluster.workers[name]
            if self._fruitless >= FRUITLESS and not self.observed:
                self.why = self._said(job)

    def _arrived(self, job: str) -> bool:
        return any(str(seen) == job or str(seen).startswith(f"{job}-") for seen in self.observed)

    def _said(self, job: Any) -> str:
        if job.job_id is None:
            return (
                f"SLURM takes no jobs: {job.refusal}; see launcher.queue, launcher.account, launcher.walltime"
            )
        words = [f"SLURM jobs end before a worker starts, the last was {job.job_id}"]
        log = self.logs / f"{NAME}-{job.job_id}.err"
        with suppress(OSError):
            lines = log.read_text(encoding="utf-8", errors="replace").strip().splitlines()
            words += [lines[-1][:200]] if lines else []
        return ": ".join(words) + f"; see {log} and launcher.setup"


@contextmanager
def slurm_workers(launcher: Slurm) -> Iterator[tuple[Cluster, Upkeep]]:
    """A scheduler in this process, and SLURM jobs whose workers connect to it; they are cancelled with the block."""
    if shutil.which("sbatch") is None:
        raise UsageError("launcher=slurm: no sbatch found; start gpsim where SLURM's commands are available")
    logs = Path(launcher.logs)
    with ExitStack() as stack:
        with disk_errors(logs, "launcher.logs"):
            logs.mkdir(parents=True, exist_ok=True)
            keys = stack.enter_context(cluster_keys(logs))
        cluster = _cluster(launcher, keys)
        stack.callback(_close, cluster)
        upkeep = cluster.adapt(
            Adaptive=Upkeep,
            minimum_jobs=launcher.minimum,
            maximum_jobs=launcher.maximum,
            interval="1s",
            wait_count=10,
        )
        upkeep.logs = logs
        yield cluster, upkeep


def _close(cluster: Cluster) -> None:
    with suppress(Exception):  # SLURM may be away: its jobs end when they miss their scheduler
        cluster.close(timeout=20)


def _cluster(launcher: Slurm, keys: Security) -> Cluster:
    """Dask's cluster, which takes orders from whoever has the keys."""
    # One address, which workers are told; without a host it would listen on all that the machine has.
    reached = {"interface": launcher.interface} if launcher.interface else {"host": get_ip()}
    try:
        return Cluster(
            queue=launcher.queue,
            account=launcher.account,
            walltime=launcher.walltime,
            memory=launcher.memory,
            cores=launcher.cores,
            processes=launcher.cores,
            job_script_prologue=list(launcher.setup),
            job_extra_directives=list(launcher.directives),
            job_directives_skip=list(launcher.skip),
            interface=launcher.interface,
            python=launcher.python,
            log_directory=launcher.logs,
            job_name=NAME,
            silence_logs="critical",
            worker_extra_args=["--no-dashboard"],
            security=keys,
            scheduler_options={"dashboard_address": f"{launcher.dashboard}:0", **reached},
        )
    except (ValueError, OSError, RuntimeError) as error:
        raise UsageError(f"launcher=slurm: {' '.join(str(error).split())[:300]}") from error
