"""Readers of raw logs: one registry from kind of file to reader, one door.

`open_log` finds the kind by the file's name (a folder is a ROS 2 bag) and gives a RawLog. Every fault of a file ends
in one UsageError: file, place, reason, what to do.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path

from gpsim.errors import UsageError
from gpsim.recordings.raw import RawLog
from gpsim.recordings.readers.bags import BagLog
from gpsim.recordings.readers.container import Container
from gpsim.recordings.readers.matlab import open_matlab
from gpsim.recordings.readers.rosbag2 import Folder, Sqlite
from gpsim.recordings.readers.tables import open_csv, open_parquet
from gpsim.recordings.readers.walks import Bag1, Mcap
from gpsim.recordings.values import one_line

_STORAGE: Mapping[str, Callable[[Path], Container]] = {".db3": Sqlite, ".mcap": Mcap}
_TABLES: Mapping[str, Callable[[Path, bool], RawLog]] = {
    ".csv": open_csv,
    ".tsv": open_csv,
    ".txt": open_csv,
    ".parquet": open_parquet,
    ".mat": open_matlab,
}
KINDS = (".bag", *_STORAGE, *_TABLES)


def open_log(path: Path, *, salvage: bool = False) -> RawLog:
    """Open a log of any kind.

    salvage: go on behind damage and count what is lost, instead of raising UsageError at the first.
    """
    try:
        folder = path.is_dir()
        suffix = path.suffix.lower()
    except (OSError, ValueError) as error:
        raise UsageError(f"{one_line(path)}: cannot be opened: {one_line(error)}; check the path") from error
    if suffix in _TABLES and not folder:
        return _TABLES[suffix](path, salvage)
    openers: Mapping[str, Callable[[Path], Container]] = {".bag": Bag1, **_STORAGE}
    if folder or suffix in openers:
        container = Folder(path, _STORAGE) if folder else openers[suffix](path)
        return BagLog(path, container, salvage=salvage)
    raise UsageError(f"{path}: unknown kind of log; supported are {', '.join(KINDS)} and ROS 2 bag folders")
