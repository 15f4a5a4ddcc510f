"""Which version of a shelf has which key: reading thousands of manifests takes longer than the work."""

from __future__ import annotations

import os
import re
from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from pathlib import Path

from gpsim.artifacts.artifact import read_manifest
from gpsim.files import unreadable

VERSION = re.compile(r"v(\d{4,})")
Entry = tuple[str, int, int]
"""Name of a version, its number on the disk, and the time of its making [ns]."""
_KEYS: dict[tuple[str, Entry], str] = {}
"""Of each version that was looked at, its key: it is immutable, and another in its place is another entry."""
_LISTED: ContextVar[dict[str, list[Entry]] | None] = ContextVar("listed", default=None)


def entries(shelf: Path) -> list[Entry]:
    """Finished versions of a shelf, newest first; raises UsageError where it cannot be listed."""
    listed, place = _LISTED.get(), os.path.abspath(shelf)  # noqa: PTH100 - links keep their names
    if listed is not None and place in listed:
        return listed[place]
    found = _listed(shelf)
    if listed is not None:
        listed[place] = found
    return found


def of_key(shelf: Path, key: str) -> Iterator[Path]:
    """Versions with a key, newest first; raises UsageError for one whose manifest is damaged: it may be the one."""
    place = os.path.abspath(shelf)  # noqa: PTH100
    for entry in entries(shelf):
        known = _KEYS.get((place, entry))
        if known is None:
            known = _KEYS[place, entry] = read_manifest(shelf / entry[0]).key
        if known == key:
            yield shelf / entry[0]


@contextmanager
def listed_once() -> Iterator[None]:
    """Within it a shelf is listed once, however often something is looked for: what others make meanwhile is not seen.

    For a plan of thousands of jobs, each of which is looked for again before it is made.
    """
    token = _LISTED.set({})
    try:
        yield
    finally:
        _LISTED.reset(token)


def _listed(shelf: Path) -> list[Entry]:
    if not os.path.isdir(shelf):  # noqa: PTH112 - a name that cannot be is no folder, and no error here
        return []
    found: list[Entry] = []
    try:
        with os.scandir(shelf) as listing:
            for item in listing:
                if VERSION.fullmatch(item.name) and item.is_dir():
                    status = item.stat()
                    found.append((item.name, status.st_ino, status.st_mtime_ns))
    except OSError as error:
        raise unreadable(shelf, error) from error
    return sorted(found, key=lambda entry: int(entry[0][1:]), reverse=True)
