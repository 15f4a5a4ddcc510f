"""Artifacts: immutable versions on disk, written whole or not at all, verified when read.

runs/<experiment>/<stage>/v0001/ holds the stage's files, manifest.json (what it was made from and the sha256 of every
file) and timings.json (wall-clock facts, outside every hash, so that the same seed gives the same bytes).
"""

from __future__ import annotations

import errno
import fcntl
import hashlib
import json
import math
import os
import re
import shutil
import time
import uuid
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from itertools import count
from pathlib import Path
from typing import Any

from gpsim.errors import UsageError
from gpsim.provenance import git_commit, package_versions

MANIFEST, TIMINGS = "manifest.json", "timings.json"
SCHEMA = "gpsim.artifact/1"
_VERSION = re.compile(r"v(\d{4,})")
_LOCK = re.compile(r"(\.tmp-[0-9a-f]{12})\.lock")
Json = dict[str, Any]


@dataclass(frozen=True)
class Artifact:
    """A finished version on disk.

    `digest` is the sha256 of what it is: stage, configuration, seeds, parents and the sha256 of every file. Which
    commit and which packages made it stands in its manifest beside that: equal contents are one artifact.
    """

    path: Path
    manifest: Json
    digest: str

    @property
    def stage(self) -> str:
        """The stage that made it."""
        return str(self.manifest["stage"])

    @property
    def key(self) -> str:
        """Identity of stage, configuration and parents: equal keys mean equal contents."""
        return str(self.manifest["key"])


@dataclass(frozen=True)
class Recipe:
    """What an artifact is made from: everything that decides its bytes.

    format, code: which state of gpsim's own code makes it, as the stage says; they decide what is made anew, and are
    no part of what an artifact is.
    """

    stage: str
    config: Json
    parents: Mapping[str, Artifact]
    seeds: Json
    format: int = 1
    code: str = ""

    @property
    def key(self) -> str:
        """sha256 of stage, format, code, configuration, seeds and the parents' digests."""
        content = {
            "stage": self.stage,
            "format": self.format,
            "code": self.code,
            "config": self.config,
            "seeds": self.seeds,
            "parents": {role: parent.digest for role, parent in sorted(self.parents.items())},
        }
        try:
            return hashlib.sha256(canonical(content)).hexdigest()
        except ValueError as error:
            raise UsageError(
                f"{self.stage}: a setting is not finite; give a number, or null where that is a choice"
            ) from error
        except TypeError as error:  # YAML knows dates, JSON does not
            raise UsageError(
                f"{self.stage}: a setting is neither number, text, list nor mapping ({error}); "
                "quote dates, as '2026-01-31'"
            ) from error


def canonical(content: Any) -> bytes:
    """JSON bytes that are equal for equal content; NaN and infinity are refused."""
    return json.dumps(content, sort_keys=True, separators=(",", ":"), allow_nan=False).encode()


def write_json(path: Path, content: Any) -> None:
    """Readable JSON with a stable byte order."""
    path.write_text(json.dumps(content, indent=2, sort_keys=False, allow_nan=False) + "\n", encoding="utf-8")


def plain(content: Any) -> Any:
    """JSON without NumPy's numbers; what is not finite is null."""
    if isinstance(content, Mapping):
        return {str(k): plain(v) for k, v in content.items()}
    if isinstance(content, list | tuple):
        return [plain(v) for v in content]
    if hasattr(content, "item"):  # a NumPy scalar
        content = content.item()
    return None if isinstance(content, float) and not math.isfinite(content) else content


@contextmanager
def written_whole(path: Path, ending: str = "") -> Iterator[Path]:
    """A name beside `path`, to make a file or a folder there: renamed to `path` if the block ends well, else removed.

    A file that is there is replaced; a folder that holds something is not: remove it as the block's last act. ending:
    of the name, where a writer chooses its format by that.
    """
    temporary = path.with_name(f".{path.name}.{os.getpid()}{ending}")
    _remove(temporary)
    try:
        yield temporary
        temporary.replace(path)
    finally:
        _remove(temporary)


def _remove(path: Path) -> None:
    if path.is_dir():
        shutil.rmtree(path, ignore_errors=True)
    else:
        path.unlink(missing_ok=True)


def file_digest(path: Path) -> str:
    """sha256 of a file, read in chunks; raises UsageError where it cannot be read."""
    try:
        with path.open("rb") as stream:
            return hashlib.file_digest(stream, "sha256").hexdigest()
    except OSError as error:
        raise _unreadable(path, error) from error


def folder_digests(folder: Path) -> dict[str, str]:
    """POSIX path to sha256 for every file below `folder` but the manifest and the timings, sorted.

    Raises UsageError for a file or a folder that cannot be read: what it holds would pass for missing.
    """
    relative = {p.relative_to(folder).as_posix(): p for p in _files_below(folder)}
    return {name: file_digest(p) for name, p in sorted(relative.items()) if name not in (MANIFEST, TIMINGS)}


def _files_below(folder: Path) -> Iterator[Path]:
    try:
        for root, _, names in os.walk(folder, onerror=_raise):
            yield from (path for name in names if (path := Path(root, name)).is_file())
    except OSError as error:
        raise _unreadable(folder, error) from error


def _raise(error: OSError) -> None:
    raise error


def _unreadable(path: Path, error: OSError) -> UsageError:
    where = path if error.filename is None else error.filename
    return UsageError(
        f"{where}: cannot be read ({error.strerror or error}); make it readable, or name another"
    )


def read_artifact(path: Path, stage: str | None = None) -> Artifact:
    """Open and verify an artifact; a changed, missing or added byte is a UsageError."""
    artifact = _read_manifest(path)
    expected, made_by = artifact.manifest["files"], artifact.stage
    if stage is not None and made_by != stage:
        raise UsageError(f"{path}: made by '{made_by}', expected an artifact of '{stage}'")
    actual = folder_digests(path)
    for name in sorted(set(expected) | set(actual)):
        if expected.get(name) != actual.get(name):
            problem = "missing" if name not in actual else "added" if name not in expected else "changed"
            cure = "remove that file" if problem == "added" else "delete the folder and make it again"
            raise UsageError(f"{path / name}: {problem} after it was written; {cure}")
    return artifact


def _read_manifest(path: Path) -> Artifact:
    """An artifact whose manifest is whole; its files are not looked at."""
    try:
        manifest = json.loads((path / MANIFEST).read_bytes())
        recorded = manifest.pop("sha256", None)
        whole = recorded == hashlib.sha256(canonical(manifest)).hexdigest()
    except (FileNotFoundError, NotADirectoryError) as error:
        raise UsageError(f"{path}: not an artifact (no {MANIFEST})") from error
    except OSError as error:
        raise _unreadable(path / MANIFEST, error) from error
    except (ValueError, TypeError, AttributeError) as error:
        raise UsageError(
            f"{path / MANIFEST}: damaged ({type(error).__name__}); delete the folder and make it again"
        ) from error
    if not whole or not {"files", "stage", "key"} <= set(manifest):
        raise UsageError(
            f"{path / MANIFEST}: changed after it was written; delete the folder and make it again"
        )
    return Artifact(path, manifest, _identity(manifest))


IDENTITY = ("stage", "config", "seeds", "parents", "files")
"""What an artifact is, of what its manifest says: commit and packages are where it comes from."""


def _identity(manifest: Json) -> str:
    return hashlib.sha256(canonical({key: manifest.get(key) for key in IDENTITY})).hexdigest()


@dataclass(frozen=True)
class Store:
    """All artifacts of one experiment: <root>/<experiment>/<stage>/vNNNN."""

    root: Path
    experiment: str

    def versions(self, stage: str) -> Iterator[Path]:
        """Finished versions of a stage, newest first."""
        folder = self.root / self.experiment / stage
        if not os.path.isdir(folder):  # noqa: PTH112 - a name that cannot be is no folder, and no error here
            return
        try:
            found = [p for p in folder.iterdir() if _VERSION.fullmatch(p.name) and p.is_dir()]
        except OSError as error:
            raise _unreadable(folder, error) from error
        yield from sorted(found, key=lambda p: int(p.name[1:]), reverse=True)

    def find(self, recipe: Recipe) -> Artifact | None:
        """The artifact with the same key, verified; None when there is none yet.

        A version whose manifest is damaged may be the one: it is refused, not passed over.
        """
        key = recipe.key
        for path in self.versions(recipe.stage):
            if _read_manifest(path).key == key:
                return read_artifact(path, recipe.stage)
        return None

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
        shelf = out.parent if out else self.root / self.experiment / recipe.stage
        with _disk_errors(shelf):
            _make_folder(shelf)
            if out is not None and out.exists():
                raise UsageError(
                    f"{out}: exists already; artifacts are never overwritten, choose another --out"
                )
            _sweep(shelf)
            with _temporary(shelf) as temporary:
                started = time.time()
                facts = write(temporary) or {}
                _seal(temporary, recipe, facts | {"seconds": round(time.time() - started, 3)})
                path = _place(temporary, shelf, out, number)
        return _read_manifest(path)

    def free_numbers(self, stage: str) -> Iterator[int]:
        """Version numbers that no finished artifact holds, ascending."""
        taken = {int(path.name[1:]) for path in self.versions(stage)}
        number = 1
        while True:
            if number not in taken:
                yield number
            number += 1


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
    manifest["content_sha256"] = _identity(manifest)
    write_json(folder / MANIFEST, manifest | {"sha256": hashlib.sha256(canonical(manifest)).hexdigest()})
    lineage = {role: str(parent.path) for role, parent in sorted(recipe.parents.items())}
    write_json(
        folder / TIMINGS, {"finished": time.strftime("%Y-%m-%dT%H:%M:%S%z"), "parents": lineage} | facts
    )
    for path in sorted(folder.rglob("*")):
        _fsync(path)
    _fsync(folder)


def _place(temporary: Path, shelf: Path, out: Path | None, number: int | None) -> Path:
    """Rename into place; another process may take a number at the same moment, so try until one is ours."""
    taken = [int(p.name[1:]) for p in shelf.iterdir() if _VERSION.fullmatch(p.name)]
    wanted = number if number is not None and number not in taken else max(taken, default=0) + 1
    # Somebody may have made `out` meanwhile: the work goes beside it rather than nowhere.
    names = _names(out.name) if out is not None else (f"v{i:04d}" for i in count(wanted))
    for path in (shelf / name for name in names):
        try:
            temporary.rename(path)  # fails when the folder exists, as a version never is empty
        except OSError as error:
            if error.errno not in (errno.ENOTEMPTY, errno.EEXIST):
                raise
            continue
        _fsync(shelf)
        return path
    raise AssertionError("there is always a next name")


def _names(name: str) -> Iterator[str]:
    """The name, then the same with numbers."""
    yield name
    yield from (f"{name}-{i}" for i in count(2))


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
    """A new folder to write in, gone after the block unless it was renamed; locked meanwhile against `_sweep`.

    The lock is the kernel's: it ends with the process, whichever container or user that lives in, and is the same for
    all who share the disk, as the number of a process is not.
    """
    temporary = shelf / f".tmp-{uuid.uuid4().hex[:12]}"
    lock = temporary.with_name(f"{temporary.name}.lock")
    try:
        stream = lock.open("xb")
    except FileNotFoundError as error:
        raise _removed(shelf) from error
    with stream:
        with suppress(OSError):  # a disk without locks: nobody can take it, and nobody sweeps
            fcntl.flock(stream, fcntl.LOCK_EX)
        try:
            temporary.mkdir()
            yield temporary
        except FileNotFoundError as error:
            if temporary.is_dir():  # something else is missing, which is no matter of this folder
                raise
            raise _removed(shelf) from error
        finally:
            shutil.rmtree(temporary, ignore_errors=True)
            lock.unlink(missing_ok=True)


def _removed(shelf: Path) -> UsageError:
    return UsageError(f"{shelf}: removed while something was written there; run again")


def _sweep(shelf: Path) -> None:
    """Remove what processes that are no more left half-made: their locks can be had."""
    for lock in shelf.glob(".tmp-*.lock"):
        if (made := _LOCK.fullmatch(lock.name)) is None:  # `--out` may lie among other programs' files
            continue
        with suppress(OSError), lock.open("rb+") as stream:
            fcntl.flock(stream, fcntl.LOCK_EX | fcntl.LOCK_NB)
            shutil.rmtree(lock.with_name(made[1]), ignore_errors=True)
            lock.unlink()


@contextmanager
def _disk_errors(shelf: Path) -> Iterator[None]:
    """A full or read-only disk is the user's to mend: one line, and nothing half-written."""
    try:
        yield
    except OSError as error:
        if error.errno in (errno.ENOSPC, errno.EDQUOT, errno.EFBIG):
            raise UsageError(
                f"{shelf}: no space left on the device; finished artifacts are whole, free space and run again"
            ) from error
        if error.errno in (errno.EACCES, errno.EROFS, errno.EPERM, errno.ENOTDIR, errno.EEXIST):
            raise UsageError(
                f"{shelf}: cannot write here ({error.strerror}); choose another runs_dir or --out"
            ) from error
        raise
