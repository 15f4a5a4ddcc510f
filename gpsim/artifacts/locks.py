"""Locks that end with their owner, whatever ends that one; what work that was cut off leaves on a shelf; removal.

The locks are the kernel's, on open files and folders: a file that a killed process left behind is nobody's. On a disk
that knows no such locks nobody waits.
"""

from __future__ import annotations

import fcntl
import os
import re
import shutil
import socket
import uuid
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Literal

from gpsim.artifacts.artifact import MANIFEST
from gpsim.errors import UsageError
from gpsim.files import disk_errors

TEMPORARY, CLAIM = re.compile(r"(\.tmp-[0-9a-f]{12})(\.lock)?"), re.compile(r"\.making-[0-9a-f]{16}\.lock")
REMOVED = re.compile(r"\.removed-[0-9a-f]{12}")


@contextmanager
def held(path: Path, waiting: Callable[[str], None]) -> Iterator[None]:
    """Hold the lock file `path` during the block; `waiting(who)` is called once if another process has it.

    The file goes with the block. Raises UsageError where it cannot be made.
    """
    told = False
    while True:
        with _made(path) as stream:
            try:
                fcntl.flock(stream, fcntl.LOCK_EX | fcntl.LOCK_NB)
                mine = _still(path, stream.fileno())
            except BlockingIOError:
                if not told:
                    waiting(_signature(stream))
                told = True
                fcntl.flock(stream, fcntl.LOCK_EX)
                mine = _still(path, stream.fileno())
            except OSError:  # no locks here
                mine = True
            if not mine:  # it was waited for, and removed by its owner
                continue
            stream.truncate(0)
            stream.write(f"{os.getpid()} {socket.gethostname()}".encode())
            try:
                yield
            finally:
                path.unlink(missing_ok=True)  # while it is locked: who waits for it sees that it is gone
            return


def _made(path: Path) -> IO[bytes]:
    how = os.O_RDWR | os.O_APPEND | os.O_CREAT | os.O_NOFOLLOW | os.O_CLOEXEC
    try:
        with disk_errors(path.parent):
            return os.fdopen(os.open(path, how, 0o666), "r+b", buffering=0)
    except FileNotFoundError as error:
        raise UsageError(f"{path.parent}: removed while something was written there; run again") from error


def _signature(stream: IO[bytes]) -> str:
    stream.seek(0)
    number, _, host = stream.read().decode(errors="replace").partition(" ")
    if not number.isdecimal():
        return "another process"  # which has not signed yet
    return f"process {number}" if host == socket.gethostname() else f"process {number} on {host}"


def _still(path: Path, descriptor: int) -> bool:
    """Whether the path is the open file or folder yet."""
    try:
        return os.path.samestat(path.stat(), os.fstat(descriptor))
    except FileNotFoundError:
        return False


@dataclass(frozen=True)
class Leftover:
    """A file or folder on a shelf that is no artifact.

    kind: `making`, an artifact that a process writes now; `claimed`, the note of one that makes or waits; `unfinished`,
    what a process left that is no more; `removing`, an artifact whose removal was cut off, or is under way.
    """

    path: Path
    kind: Literal["making", "unfinished", "claimed", "removing"]


def leftovers(shelf: Path) -> Iterator[Leftover]:
    """What lies on a shelf beside its artifacts, in the order of its names; other programs' files are left out."""
    for path in sorted(shelf.glob(".*")):
        if REMOVED.fullmatch(path.name):
            yield Leftover(path, "removing")
        elif CLAIM.fullmatch(path.name):
            yield Leftover(path, "claimed" if _locked(path) else "unfinished")
        elif found := TEMPORARY.fullmatch(path.name):
            if found[2] and path.with_name(found[1]).exists():  # the folder is told of
                continue
            lock = path.with_name(f"{found[1]}.lock")
            yield Leftover(path, "making" if _locked(lock) else "unfinished")


def sweep(shelf: Path) -> None:
    """Remove what processes that are no more left half-made: their locks can be had.

    Not what a removal left: its owner may be at it, and nobody takes it for an artifact. Other programs' files, among
    which `--out` may lie, stay.
    """
    for lock in (*shelf.glob(".tmp-*.lock"), *shelf.glob(".making-*.lock")):
        made = TEMPORARY.fullmatch(lock.name)
        if made is None and not CLAIM.fullmatch(lock.name):
            continue
        with suppress(OSError), _opened(lock, os.O_RDWR) as stream:
            fcntl.flock(stream, fcntl.LOCK_EX | fcntl.LOCK_NB)  # of its own claim, too, that fails
            if made is not None:
                shutil.rmtree(lock.with_name(made[1]), ignore_errors=True)
            lock.unlink()


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
        raise UsageError(
            f"{path}: cannot be removed completely; make its contents writable, then: gpsim runs gc"
        )


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


@contextmanager
def needed(paths: Iterable[Path]) -> Iterator[None]:
    """Within it gpsim removes none of these artifacts; raises UsageError where one is gone already.

    A stage that makes something holds the folders of all its parents; who removes one must have it for itself.
    """
    with ExitStack() as stack:
        for path in dict.fromkeys(paths):
            gone = UsageError(f"{path}: removed before it could be used; run again")
            try:
                descriptor = os.open(path, os.O_RDONLY)
            except FileNotFoundError as error:
                raise gone from error
            stack.callback(os.close, descriptor)
            with suppress(OSError):  # no locks here
                fcntl.flock(descriptor, fcntl.LOCK_SH)  # waits for the moment that a removal takes
            if not _still(path, descriptor) or not (path / MANIFEST).is_file():
                raise gone
        yield


@contextmanager
def unneeded(paths: Iterable[Path]) -> Iterator[frozenset[Path]]:
    """Those of the artifacts of which nobody makes something; within the block nobody can begin to.

    Look again, within it, at what has been made of them meanwhile.
    """
    mine: set[Path] = set()
    with ExitStack() as stack:
        for path in paths:
            with suppress(FileNotFoundError):
                descriptor = os.open(path, os.O_RDONLY)
                stack.callback(os.close, descriptor)
                try:
                    fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
                except BlockingIOError:
                    continue
                except OSError:  # no locks here
                    pass
                if _still(path, descriptor):
                    mine.add(path)
        yield frozenset(mine)


def hide(paths: Sequence[Path]) -> list[Path]:
    """Rename artifacts to names that nobody reads, in this order; returns the new ones, for `erase`.

    Out of sight at once, so that no half of one is read. Give what rests on others first: cut off in between, whatever
    is left has all of its parents.
    """
    hidden: list[Path] = []
    for path in paths:
        name = path.with_name(f".removed-{uuid.uuid4().hex[:12]}")
        try:
            path.rename(name)
        except OSError as error:
            for done in hidden:
                erase(done)
            raise UsageError(
                f"{path}: cannot be removed ({error.strerror}); make {path.parent} writable"
            ) from error
        hidden.append(name)
    return hidden
