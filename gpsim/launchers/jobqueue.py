"""dask-jobqueue's classes, without what its import does: it makes Ctrl-C an exit that says nothing went wrong."""

from __future__ import annotations

import signal
from collections.abc import Iterator
from contextlib import contextmanager

__all__ = ["SLURMCluster", "SLURMJob"]


@contextmanager
def _interrupts_kept() -> Iterator[None]:
    asked = signal.getsignal(signal.SIGINT)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, asked)


with _interrupts_kept():
    from dask_jobqueue import SLURMCluster
    from dask_jobqueue.slurm import SLURMJob
