"""Which files a log is read from, and their digests: the same bytes give the same artifact."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Literal

from gpsim.errors import UsageError
from gpsim.files import file_digest
from gpsim.recordings import FolderLog, Opener, RawLog, find_logs


def digests_read(sources: Sequence[Path], layout: Literal["files", "folder"], pattern: str) -> dict[str, str]:
    """sha256 of every file of the logs below the sources that are called by `pattern`, by its name there."""
    out: dict[str, str] = {}
    for number, source in enumerate(sources):
        for path in _files_read(source, layout, pattern):
            name = path.relative_to(source).as_posix() if source.is_dir() else path.name
            out[name if len(sources) == 1 else f"{number + 1}/{name}"] = file_digest(path)
    return out


def _files_read(source: Path, layout: Literal["files", "folder"], pattern: str) -> list[Path]:
    """The files of the logs below a source, those of a ROS 2 bag's folder one by one."""
    try:
        if not source.exists():
            raise UsageError(f"{source}: no such file or folder")
        return _files_of_logs(source, layout, pattern)
    except OSError as error:  # a folder that may not be entered
        raise UsageError(f"{source}: cannot be read ({error.strerror or error})") from error


def _files_of_logs(source: Path, layout: Literal["files", "folder"], pattern: str) -> list[Path]:
    logs: list[Path] = []
    for found in find_logs([source], layout, pattern, remembering(logs)):
        if isinstance(found.log, FolderLog):
            logs += found.log.files.values()
    return [file for log in logs for file in (_storage_of(log) if log.is_dir() else [log])]


def remembering(paths: list[Path]) -> Opener:
    """An opener that opens nothing and notes what it was asked for."""

    def remember(path: Path) -> RawLog:
        paths.append(path)
        return FolderLog({}, remember)

    return remember


def _storage_of(bag: Path) -> list[Path]:
    stored = (p for p in bag.iterdir() if p.name == "metadata.yaml" or {".db3", ".mcap"} & set(p.suffixes))
    return sorted(path for path in stored if path.is_file())
