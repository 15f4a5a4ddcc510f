"""Removing artifacts: none that something is being made of, and out of sight at once, so that no half of one is read.

A stage that makes something holds the folders of all its parents; who removes one must have it for itself. The locks
are the kernel's, on the folders, and end with their process: nothing is written, and none is left behind. On a disk
that knows no such locks nobody waits.
"""

from __future__ import annotations

import fcntl
import os
import uuid
from collections.abc import Iterable, Iterator, Sequence
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path

from gpsim.artifacts.artifact import MANIFEST
from gpsim.artifacts.leftovers import erase
from gpsim.errors import UsageError


@contextmanager
def needed(paths: Iterable[Path]) -> Iterator[None]:
    """Within it gpsim removes none of these artifacts; raises UsageError where one is gone already."""
    with ExitStack() as stack:
        for path in dict.fromkeys(paths):
            try:
                descriptor = os.open(path, os.O_RDONLY)
            except FileNotFoundError as error:
                raise _gone(path) from error
            stack.callback(os.close, descriptor)
            with suppress(OSError):  # no locks here
                fcntl.flock(descriptor, fcntl.LOCK_SH)  # waits for the moment that a removal takes
            if not _still(path, descriptor) or not (path / MANIFEST).is_file():
                raise _gone(path)
        yield


@contextmanager
def unneeded(paths: Iterable[Path]) -> Iterator[frozenset[Path]]:
    """Those of the artifacts of which nobody makes something; within the block nobody can begin to.

    Look again, within it, at what has been made of them meanwhile.
    """
    mine: set[Path] = set()
    with ExitStack() as stack:
        for path in paths:
            try:
                descriptor = os.open(path, os.O_RDONLY)
            except FileNotFoundError:
                continue
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

    Give what rests on others first: cut off in between, whatever is left has all of its parents.
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


def _still(path: Path, descriptor: int) -> bool:
    """Whether the path is the open folder yet."""
    try:
        return os.path.samestat(path.stat(), os.fstat(descriptor))
    except FileNotFoundError:
        return False


def _gone(path: Path) -> UsageError:
    return UsageError(f"{path}: removed while something was to be made of it; run again")
