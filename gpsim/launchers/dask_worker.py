"""What runs on a Dask worker: one task at a time, in the folder of the command or in one that stands for it.

A task ends in a report and never in an exception: Dask would pickle that, and log it with a traceback.
"""

from __future__ import annotations

import os
import socket
import tempfile
import threading
import time
import traceback
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from distributed import get_worker

from gpsim.errors import UsageError
from gpsim.files import tells_of_full_disk
from gpsim.launchers.parcels import Parcel, new_files, unpacked
from gpsim.launchers.tasks import Progress
from gpsim.trust import Lent, take

TOPIC = "gpsim"
BETWEEN = 1.0  # s between two messages of one task
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
    node = socket.gethostname()
    with _ONE:
        try:
            take(errand.trusted)
            with _place(errand) as known:
                result = errand.work(_teller(errand.label, node))
                back = None if errand.parcel is None else new_files(errand.writes, known)
            return Report(node, result, parcel=back)
        except UsageError as error:
            return Report(node, refusal=str(error))
        except OSError as error:
            if tells_of_full_disk(str(error)):
                return Report(
                    node, refusal=f"no space left on a disk there ({error}); free some and run again"
                )
            return Report(node, crash=traceback.format_exc())
        except (Exception, SystemExit):
            return Report(node, crash=traceback.format_exc())


def _teller(label: str, node: str) -> Progress:
    """Messages to the command, not more than one in a while; what of no total is said at once."""
    worker, last = get_worker(), [0.0]

    def tell(done: int, total: int, note: str) -> None:
        if not total or time.monotonic() - last[0] >= BETWEEN:
            last[0] = time.monotonic()
            worker.log_event(TOPIC, (label, done, total, f"{note} on {node}".strip()))

    return tell


@contextmanager
def _place(errand: Errand) -> Iterator[list[str]]:
    """Within it the current folder is the command's or, where none is shared, one with what the task needs."""
    before = Path.cwd()
    try:
        if errand.parcel is None:
            _check_shared(Path(errand.folder), errand.mark, errand.patience)
            os.chdir(errand.folder)
            yield []
            return
        with tempfile.TemporaryDirectory(prefix="gpsim-job-") as folder:
            known = unpacked(errand.parcel, Path(folder))
            os.chdir(folder)
            try:
                yield known
            finally:
                os.chdir(before)
    finally:
        os.chdir(before)


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
