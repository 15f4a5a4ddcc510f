"""The store: where artifacts are kept, found again and published, whole or not at all.

Which version of a shelf has which key: reading thousands of manifests takes longer than the work. Without a look
through the shelf a small file a key says it, RUNS/.keys/EXPERIMENT/STAGE/KEY. It is a hint: it is written just before
its version is put in place, so that what is finished has one, and it may point to nothing, where the writer was cut off
or the version removed. Who follows one reads the version's manifest. Versions that older releases made have none.
"""

from __future__ import annotations

import errno
import fcntl
import hashlib
import os
import platform
import re
import shutil
import subprocess
import time
import uuid
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from contextvars import ContextVar
from dataclasses import dataclass
from functools import cache
from importlib import metadata
from itertools import count
from pathlib import Path

from gpsim.artifacts.artifact import (
    MANIFEST,
    TIMINGS,
    Artifact,
    Recipe,
    folder_digests,
    identity,
    read_artifact,
    read_manifest,
)
from gpsim.artifacts.locks import held, needed, sweep
from gpsim.errors import UsageError
from gpsim.files import Json, canonical, disk_errors, regular_bytes, unreadable, write_json

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


def _markers(shelf: Path) -> Path:
    return shelf.parent.parent / FOLDER / shelf.parent.name / shelf.name


def _said(marker: Path) -> str | None:
    """The version that a marker names; None where it is none."""
    try:
        return regular_bytes(marker, MOST_BYTES).decode("ascii")
    except (OSError, ValueError, UsageError):
        return None


def mark(shelf: Path, key: str, name: str) -> None:
    """Say that the version `name` will have the key; raises OSError."""
    folder = _markers(shelf)
    folder.mkdir(parents=True, exist_ok=True)
    written = folder / f".{uuid.uuid4().hex[:12]}"
    written.write_text(name, encoding="ascii")
    written.replace(folder / key)


SCHEMA = "gpsim.artifact/1"
PACKAGES = (
    "gpsim", "gymnasium", "numpy", "pandas", "pyarrow", "rosbags", "scipy", "stable-baselines3", "torch",
)  # fmt: skip


@cache
def package_versions() -> dict[str, str]:
    """Versions of Python and of the packages that decide an artifact's bytes."""
    versions = {"python": platform.python_version()}
    for name in PACKAGES:
        try:
            versions[name] = metadata.version(name)
        except metadata.PackageNotFoundError:
            versions[name] = "absent"
    return versions


@cache
def git_commit() -> str | None:
    """The commit of the checkout that gpsim runs from; None outside a checkout of gpsim itself."""
    root = Path(__file__).resolve().parents[2]
    if not (root / ".git").exists():
        return None
    command = ["git", "-C", str(root), "rev-parse", "HEAD"]
    try:
        found = subprocess.run(command, capture_output=True, text=True, timeout=10, check=True)
    except (OSError, subprocess.SubprocessError):
        return None
    return found.stdout.strip()


@dataclass(frozen=True)
class Store:
    """All artifacts of one experiment: <root>/<experiment>/<stage>/vNNNN."""

    root: Path
    experiment: str

    def shelf(self, stage: str) -> Path:
        """Where the versions of a stage lie."""
        return self.root / self.experiment / stage

    def versions(self, stage: str) -> Iterator[Path]:
        """Finished versions of a stage, newest first."""
        yield from (self.shelf(stage) / name for name, _, _ in entries(self.shelf(stage)))

    def find(self, recipe: Recipe, *, looked: bool = False) -> Artifact | None:
        """The artifact with the same key, verified; None when there is none yet.

        A version whose manifest is damaged may be the one: it is refused, not passed over. looked: somebody has
        looked through the shelf, so only what was made since counts: it has a marker.
        """
        shelf, key = self.shelf(recipe.stage), recipe.key
        name = _said(_markers(shelf) / key)
        if name and os.sep not in name and (shelf / name).is_dir():
            found = read_artifact(shelf / name, recipe.stage)
            if found.key == key:
                return found
        path = None if looked else next(of_key(shelf, key), None)
        return None if path is None else read_artifact(path, recipe.stage)

    def all_marked(self, stage: str) -> bool:
        """Whether every version of a stage can be found by its marker."""
        shelf = self.shelf(stage)
        names = {name for name, *_ in entries(shelf)}
        with suppress(OSError):
            return not names or names <= {_said(path) for path in _markers(shelf).iterdir()}
        return False

    @contextmanager
    def claimed(self, recipe: Recipe, waiting: Callable[[str], None]) -> Iterator[None]:
        """Within it no other process makes the same: look again with `find` before you do.

        `waiting(who)` is called where another process has it, which this one then waits for.
        """
        shelf = self.shelf(recipe.stage)
        with disk_errors(shelf):
            _make_folder(shelf)
        with held(shelf / f".making-{recipe.key[:16]}.lock", waiting):
            yield

    def publish(
        self,
        recipe: Recipe,
        write: Callable[[Path], Json | None],
        *,
        out: Path | None = None,
        number: int | None = None,
    ) -> Artifact:
        """Run `write(folder)` in a temporary folder, seal it with a manifest and rename it into place.

        `write` may return facts that go to timings.json. `out` names the folder instead of the next version;
        `number` asks for a version, the next free one is taken when it is gone. A crash leaves only a temporary
        folder, which the next publication of that stage removes.
        """
        shelf = out.parent if out else self.shelf(recipe.stage)
        with disk_errors(shelf):
            _make_folder(shelf)
            if out is not None and out.exists():
                raise UsageError(
                    f"{out}: exists already; artifacts are never overwritten, choose another --out"
                )
            sweep(shelf)
            with needed(parent.path for parent in recipe.parents.values()), _temporary(shelf) as temporary:
                started = time.time()
                facts = write(temporary) or {}
                _seal(temporary, recipe, facts | {"seconds": round(time.time() - started, 3)})
                path = _place(temporary, shelf, out, number, recipe.key)
        return read_manifest(path)

    def free_numbers(self, stage: str) -> Iterator[int]:
        """Version numbers that no finished artifact holds, ascending."""
        taken = {int(path.name[1:]) for path in self.versions(stage)}
        yield from (number for number in count(1) if number not in taken)


def _seal(folder: Path, recipe: Recipe, facts: Json) -> None:
    manifest: Json = {
        "schema": SCHEMA,
        "stage": recipe.stage,
        "key": recipe.key,
        "format": recipe.format,
        "code": recipe.code,
        "config": recipe.config,
        "seeds": recipe.seeds,
        "parents": {
            role: {"stage": parent.stage, "sha256": parent.digest}
            for role, parent in sorted(recipe.parents.items())
        },
        "packages": package_versions(),
        "git_commit": git_commit(),
        "files": folder_digests(folder),
    }
    manifest["content_sha256"] = identity(manifest)
    write_json(folder / MANIFEST, manifest | {"sha256": hashlib.sha256(canonical(manifest)).hexdigest()})
    lineage = {role: str(parent.path) for role, parent in sorted(recipe.parents.items())}
    write_json(
        folder / TIMINGS, {"finished": time.strftime("%Y-%m-%dT%H:%M:%S%z"), "parents": lineage} | facts
    )
    for path in sorted(folder.rglob("*")):
        _fsync(path)
    _fsync(folder)


def _place(temporary: Path, shelf: Path, out: Path | None, number: int | None, key: str) -> Path:
    """Rename into place; another process may take a number at the same moment, so try until one is ours.

    The marker comes first: a process that is killed in between leaves one that points to nothing.
    """
    taken = [int(p.name[1:]) for p in shelf.iterdir() if VERSION.fullmatch(p.name)]
    wanted = number if number is not None and number not in taken else max(taken, default=0) + 1
    # Somebody may have made `out` meanwhile: the work goes beside it rather than nowhere.
    names = (f"v{i:04d}" for i in count(wanted))
    if out is not None:
        names = (f"{out.name}-{i}" if i > 1 else out.name for i in count(1))
    for path in (shelf / name for name in names):
        if out is None:
            mark(shelf, key, path.name)
        try:
            temporary.rename(path)  # fails when the folder exists, as a version never is empty
        except OSError as error:
            if error.errno not in (errno.ENOTEMPTY, errno.EEXIST):
                raise
            continue
        _fsync(shelf)
        return path
    raise AssertionError("there is always a next name")


def _fsync(path: Path) -> None:
    descriptor = os.open(path, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


def _make_folder(path: Path) -> None:
    try:
        path.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        if error.errno in (errno.ENOSPC, errno.EDQUOT):
            raise
        raise UsageError(
            f"{path}: cannot be made ({error.strerror}); choose another runs_dir or --out"
        ) from error


@contextmanager
def _temporary(shelf: Path) -> Iterator[Path]:
    """A new folder to write in, gone after the block unless it was renamed; locked meanwhile against `sweep`.

    The lock is the kernel's: it ends with the process, whichever container or user that lives in, and is the same for
    all who share the disk, as the number of a process is not.
    """
    removed = UsageError(f"{shelf}: removed while something was written there; run again")
    with ExitStack() as stack:
        while True:
            lock = shelf / f".tmp-{uuid.uuid4().hex[:12]}.lock"
            try:
                stream = stack.enter_context(lock.open("xb"))
            except FileNotFoundError as error:
                raise removed from error
            with suppress(OSError):  # a disk without locks: nobody can take it, and nobody sweeps
                fcntl.flock(stream, fcntl.LOCK_EX)
            if (
                lock.exists()
            ):  # its name is nobody else's; else it was swept between its making and its locking
                break
        temporary = lock.with_suffix("")
        try:
            temporary.mkdir()
            yield temporary
        except FileNotFoundError as error:
            if temporary.is_dir():  # something else is missing, which is no matter of this folder
                raise
            raise removed from error
        finally:
            shutil.rmtree(temporary, ignore_errors=True)
            lock.unlink(missing_ok=True)
