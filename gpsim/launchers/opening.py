"""The executor of a launcher, while it is needed."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from gpsim.launchers.launcher import Launcher, Local
from gpsim.launchers.local import pool_executor
from gpsim.launchers.tasks import Executor


@contextmanager
def opened(launcher: Launcher) -> Iterator[Executor]:
    """The launcher's executor; all that it started ends with the block."""
    if isinstance(launcher, Local):
        with pool_executor(launcher.processes) as pool:
            yield pool
        return
    from gpsim.launchers.dask_client import dask_executor  # Dask is no part of a plain installation

    with dask_executor(launcher) as executor:
        yield executor
