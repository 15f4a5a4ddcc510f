"""Whose fault it is when a process ends in the middle of a stage: a user's own simulator is the likely cause."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from gpsim.errors import Terminated, UsageError
from gpsim.simulators import source_file
from gpsim.workers import WorkerDiedError


@contextmanager
def blamed(simulator: object) -> Iterator[None]:
    """Within it what ends this process or crashes a worker is one line that names the file of a user's simulator."""
    file = source_file(simulator) if isinstance(simulator, str) else None
    try:
        yield
    except Terminated:
        raise
    except SystemExit as error:
        if file is None:
            raise
        raise UsageError(
            f"{file}: ended the program (exit code {error.code}); a simulator only returns: take exit() out of it"
        ) from error
    except WorkerDiedError as error:
        if file is None or error.killed:
            raise
        raise UsageError(
            f"{file}: a worker process {error.how}, most likely in the code of this file; fix it, then run again"
        ) from error
