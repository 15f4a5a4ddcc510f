"""Which version of a shelf has which key: reading thousands of manifests takes longer than the work.

Without a look through the shelf a small file a key says it, RUNS/.keys/EXPERIMENT/STAGE/KEY. It is a hint: it is
written just before its version is put in place, so that what is finished has one, and it may point to nothing, where
the writer was cut off or the version removed. Who follows one reads the version's manifest. Versions that older
releases made have none.
"""

from __future__ import annotations

import os
import re
import uuid
from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from pathlib import Path

from gpsim.artifacts.artifact import read_manifest
from gpsim.errors import UsageError
from gpsim.files import regular_bytes, unreadable

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
    found: list[Entry] = []
    if os.path.isdir(shelf):  # noqa: PTH112 - a name that cannot be is no folder, and no error here
        try:
            with os.scandir(shelf) as listing:
                for item in listing:
                    if VERSION.fullmatch(item.name) and item.is_dir():
                        status = item.stat()
                        found.append((item.name, status.st_ino, status.st_mtime_ns))
        except OSError as error:
            raise unreadable(shelf, error) from error
    found.sort(key=lambda entry: int(entry[0][1:]), reverse=True)
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


FOLDER = ".keys"
MOST_BYTES = 256  # of a marker: the name of a folder


def marked(shelf: Path, key: str) -> Path | None:
    """The version that the key's marker names, if it is there."""
    try:
        name = _said(_folder(shelf) / key)
    except (OSError, ValueError, UsageError):
        return None
    return shelf / name if os.sep not in name and (shelf / name).is_dir() else None


def mark(shelf: Path, key: str, name: str) -> None:
    """Say that the version `name` will have the key; raises OSError."""
    folder = _folder(shelf)
    folder.mkdir(parents=True, exist_ok=True)
    written = folder / f".{uuid.uuid4().hex[:12]}"
    written.write_text(name, encoding="ascii")
    written.replace(folder / key)


def all_marked(shelf: Path, names: list[str]) -> bool:
    """Whether each of these versions has a marker."""
    if not names:
        return True
    try:
        found = {_said(path) for path in _folder(shelf).iterdir()}
    except (OSError, ValueError, UsageError):
        return False
    return found.issuperset(names)


def _said(marker: Path) -> str:
    return regular_bytes(marker, MOST_BYTES).decode("ascii")


def _folder(shelf: Path) -> Path:
    return shelf.parent.parent / FOLDER / shelf.parent.name / shelf.name
