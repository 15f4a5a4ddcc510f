"""Files that travel between machines that share no file system: a tar archive and its SHA-256, never a pickle."""

from __future__ import annotations

import hashlib
import io
import os
import shutil
import tarfile
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

from gpsim.errors import UsageError
from gpsim.files import file_digest, files_below, written_whole


@dataclass(frozen=True)
class Parcel:
    """An archive of files by their relative paths."""

    content: bytes
    sha256: str


def packed(paths: Iterable[Path], without: Iterable[str] = ()) -> Parcel:
    """The files at and below relative paths; hidden ones, as locks are, and those named in `without` stay.

    Raises UsageError for a path that leads out of this folder: on another machine it would be another's.
    """
    files: dict[str, Path] = {}
    for path in paths:
        check_inside(path)
        found = files_below(path) if path.is_dir() else [path] if path.is_file() else []
        files |= {p.as_posix(): p for p in found if not any(part.startswith(".") for part in p.parts)}
    for name in without:
        files.pop(name, None)
    stream = io.BytesIO()
    with tarfile.open(fileobj=stream, mode="w") as archive:
        for name in sorted(files):
            archive.add(files[name], name, recursive=False)
    content = stream.getvalue()
    return Parcel(content, hashlib.sha256(content).hexdigest())


def unpacked(parcel: Parcel, folder: Path) -> list[str]:
    """Write a parcel's files below a folder; their names. Raises UsageError where it is not what was sent."""
    if hashlib.sha256(parcel.content).hexdigest() != parcel.sha256:
        raise UsageError("a parcel was damaged on its way; run the same command to carry on")
    with tarfile.open(fileobj=io.BytesIO(parcel.content)) as archive:
        archive.extractall(folder, filter="data")
        return archive.getnames()


def check_inside(path: Path) -> None:
    """Raise UsageError for a path that is not below the folder in which the command was started."""
    if path.is_absolute() or ".." in path.parts:
        raise UsageError(
            f"{path}: with launcher.shared=false everything lies below the folder where the command is started; give "
            "a relative path, and start it further up"
        )


def settle(arrived: Path, out: Path) -> None:
    """Put what came back below `arrived`/OUT in its place, OUT/KIND/NAME, each such file or folder whole."""
    for unit in sorted((arrived / out).glob("*/*")):
        target = out / unit.relative_to(arrived / out)
        if unit.is_file() and target.is_file() and file_digest(unit) == file_digest(target):
            continue
        target.parent.mkdir(parents=True, exist_ok=True)
        with written_whole(target) as made:
            if unit.is_dir():
                shutil.copytree(unit, made)
                shutil.rmtree(target, ignore_errors=True)
            else:
                shutil.copyfile(unit, made)


def new_files(folders: Iterable[Path], known: Iterable[str]) -> Parcel:
    """What lies below folders beside the files that were known."""
    there = [folder for folder in folders if os.path.lexists(folder)]
    return packed(there, without=known)
