"""Which version has a key, without a look through the shelf: a small file a key, RUNS/.keys/EXPERIMENT/STAGE/KEY.

A marker is a hint: it is written just before its version is put in place, so that what is finished has one, and it may
point to nothing, where the writer was cut off or the version removed. Who follows one reads the version's manifest.
Versions that older releases made have none.
"""

from __future__ import annotations

import os
import uuid
from pathlib import Path

from gpsim.errors import UsageError
from gpsim.files import regular_bytes

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
