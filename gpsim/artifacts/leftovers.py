"""What work in progress, and work that was cut off, leaves on a shelf: their locks, which end with them, tell which."""

from __future__ import annotations

import fcntl
import os
import re
import shutil
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Literal

from gpsim.errors import UsageError

Kind = Literal["making", "unfinished", "claimed", "removing"]
_LOCK = re.compile(r"(\.tmp-[0-9a-f]{12})\.lock")
_TEMPORARY = re.compile(r"\.tmp-[0-9a-f]{12}")
_CLAIM = re.compile(r"\.making-[0-9a-f]{16}\.lock")
_REMOVED = re.compile(r"\.removed-[0-9a-f]{12}")


@dataclass(frozen=True)
class Leftover:
    """A file or folder on a shelf that is no artifact.

    kind: `making`, an artifact that a process writes now; `claimed`, the note of one that makes or waits; `unfinished`,
    what a process left that is no more; `removing`, an artifact whose removal was cut off, or is under way.
    """

    path: Path
    kind: Kind


def leftovers(shelf: Path) -> Iterator[Leftover]:
    """What lies on a shelf beside its artifacts, in the order of its names; other programs' files are left out."""
    for path in sorted(shelf.glob(".*")):
        if _REMOVED.fullmatch(path.name):
            yield Leftover(path, "removing")
        elif _CLAIM.fullmatch(path.name):
            yield Leftover(path, "claimed" if _locked(path) else "unfinished")
        elif _TEMPORARY.fullmatch(path.name):
            lock = path.with_name(f"{path.name}.lock")
            yield Leftover(path, "making" if _locked(lock) else "unfinished")
        elif (made := _LOCK.fullmatch(path.name)) and not path.with_name(made[1]).exists():
            yield Leftover(path, "making" if _locked(path) else "unfinished")


def sweep(shelf: Path) -> None:
    """Remove what processes that are no more left half-made: their locks can be had.

    Not what a removal left: its owner may be at it, and nobody takes it for an artifact.
    """
    for lock in shelf.glob(".tmp-*.lock"):
        if (made := _LOCK.fullmatch(lock.name)) is None:  # `--out` may lie among other programs' files
            continue
        with suppress(OSError), _free(lock):
            shutil.rmtree(lock.with_name(made[1]), ignore_errors=True)
            lock.unlink()
    for claim in shelf.glob(".making-*.lock"):
        if _CLAIM.fullmatch(claim.name):
            with suppress(OSError), _free(claim):  # its own claim fails here, too
                claim.unlink()


def sweep_all(shelf: Path) -> None:
    """Remove everything that is left over, of cut-off removals too; raises UsageError for what cannot be removed."""
    sweep(shelf)
    for left in list(leftovers(shelf)):
        if left.kind in ("removing", "unfinished"):
            erase(left.path)


def erase(path: Path) -> None:
    """Remove a file or a folder with all that it holds; raises UsageError where something stays."""
    if path.is_dir() and not path.is_symlink():
        shutil.rmtree(path, ignore_errors=True)
    else:
        with suppress(OSError):
            path.unlink()
    if path.exists() or path.is_symlink():
        raise UsageError(f"{path}: cannot be removed whole; make what it holds writable, then: gpsim runs gc")


@contextmanager
def _free(lock: Path) -> Iterator[None]:
    """Hold a lock file; raises OSError where another process does."""
    with _opened(lock, os.O_RDWR) as stream:
        fcntl.flock(stream, fcntl.LOCK_EX | fcntl.LOCK_NB)
        yield


def _opened(lock: Path, how: int) -> IO[bytes]:
    """A lock file, and no link's target; what is a pipe is not waited for."""
    return os.fdopen(os.open(lock, how | os.O_NONBLOCK | os.O_NOFOLLOW | os.O_CLOEXEC), "rb", buffering=0)


def _locked(lock: Path) -> bool:
    """Whether a process holds a lock file; nothing is written. On a disk that knows no locks, whether it is there."""
    try:
        with _opened(lock, os.O_RDONLY) as stream:
            fcntl.flock(stream, fcntl.LOCK_SH | fcntl.LOCK_NB)
    except FileNotFoundError:
        return False
    except OSError:
        return True
    return False
