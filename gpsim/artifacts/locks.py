"""One process at a time: a lock that ends with its owner, whatever ends that one."""

from __future__ import annotations

import fcntl
import os
import socket
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import IO

from gpsim.errors import UsageError
from gpsim.files import disk_errors


@contextmanager
def held(path: Path, waiting: Callable[[str], None]) -> Iterator[None]:
    """Hold the lock file `path` during the block; `waiting(who)` is called once if another process has it.

    The lock is the kernel's, on the open file: it ends with the process that holds it, and a file that a killed one
    left behind is nobody's. The file goes with the block. On a disk that knows no locks nobody waits. Raises UsageError
    where the file cannot be made.
    """
    with _locked(path, waiting) as stream:
        _sign(stream)
        try:
            yield
        finally:
            path.unlink(missing_ok=True)  # while it is locked: who waits for it sees that it is gone


@contextmanager
def _locked(path: Path, waiting: Callable[[str], None]) -> Iterator[IO[bytes]]:
    """The file, locked; anew where the one that was waited for has been removed by its owner."""
    told = False
    while True:
        with _opened(path) as stream:
            try:
                fcntl.flock(stream, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError:
                if not told:
                    waiting(_signature(stream))
                told = True
                fcntl.flock(stream, fcntl.LOCK_EX)
            except OSError:  # no locks here
                yield stream
                return
            if _still(path, stream):
                yield stream
                return


def _opened(path: Path) -> IO[bytes]:
    try:
        with disk_errors(path.parent):
            descriptor = os.open(
                path, os.O_RDWR | os.O_APPEND | os.O_CREAT | os.O_NOFOLLOW | os.O_CLOEXEC, 0o666
            )
            return os.fdopen(descriptor, "r+b", buffering=0)
    except FileNotFoundError as error:
        raise UsageError(f"{path.parent}: removed while something was written there; run again") from error


def _still(path: Path, stream: IO[bytes]) -> bool:
    """Whether the path is the open file yet."""
    try:
        return os.path.samestat(path.stat(), os.fstat(stream.fileno()))
    except FileNotFoundError:
        return False


def _sign(stream: IO[bytes]) -> None:
    stream.truncate(0)
    stream.write(f"{os.getpid()} {socket.gethostname()}".encode())
    stream.flush()


def _signature(stream: IO[bytes]) -> str:
    """Who holds the file, in words."""
    stream.seek(0)
    number, _, host = stream.read().decode(errors="replace").partition(" ")
    if not number.isdecimal():
        return "another process"  # which has not signed yet
    return f"process {number}" if host == socket.gethostname() else f"process {number} on {host}"
