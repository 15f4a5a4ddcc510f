"""Folders of one's own: nobody else may put a file there, so what lies in them may be run or believed."""

from __future__ import annotations

import grp
import os
import pwd
import stat
from contextlib import suppress
from pathlib import Path

SHARED = stat.S_IWGRP | stat.S_IWOTH


class ExposedError(Exception):
    """A folder or a file that somebody else made, or can change; the message says which, and why."""


def own_folder(path: Path) -> Path:
    """`path` without links, made if need be; raises ExposedError where others can write there, else OSError.

    The folder itself must be this user's. Those above it may also be root's, and others may write to them where the
    sticky bit keeps them from moving what is not theirs, as in /tmp.
    """
    path = path.absolute()
    there = next(above for above in path.parents if above.exists())
    place = there.resolve()
    for above in (place, *place.parents):
        _check(above, above.lstat(), owners=(0, os.getuid()), sticky=True)
    for name in path.relative_to(there).parts:
        place /= name
        with suppress(FileExistsError):
            place.mkdir(mode=0o700)
        found = place.lstat()
        if not stat.S_ISDIR(found.st_mode):
            raise ExposedError(f"{place} is a link or a file, not a folder")
        _check(place, found, owners=(os.getuid(),))
    return place


def read_own(path: Path) -> bytes:
    """The content of a file in a folder of one's own; raises ExposedError where it is another's, else OSError."""
    with os.fdopen(os.open(path, os.O_RDONLY | os.O_NOFOLLOW), "rb") as stream:
        _check(path, os.fstat(stream.fileno()), owners=(os.getuid(),))
        return stream.read()


def write_own(path: Path, content: bytes) -> None:
    """Write a file that only this user can read, whole or not at all."""
    temporary = path.with_name(f".{path.name}.{os.getpid()}")
    temporary.unlink(missing_ok=True)
    made = os.open(temporary, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_NOFOLLOW, 0o600)
    with os.fdopen(made, "wb") as stream:
        stream.write(content)
    temporary.replace(path)


def _check(path: Path, found: os.stat_result, owners: tuple[int, ...], sticky: bool = False) -> None:
    if found.st_uid not in owners:
        raise ExposedError(f"{path} is another user's")
    writers = found.st_mode & SHARED
    if writers == stat.S_IWGRP and _is_own_group(found.st_gid):
        return
    if writers and not (sticky and found.st_mode & stat.S_ISVTX):
        raise ExposedError(f"others may write to {path}")


def _is_own_group(group: int) -> bool:
    """Whether a group is this user's alone: where each has one, folders are often writable by the group."""
    try:
        known, user = grp.getgrgid(group), pwd.getpwuid(os.getuid())
    except KeyError:
        return False
    return known.gr_name == user.pw_name and group == user.pw_gid and not set(known.gr_mem) - {user.pw_name}
