"""Artifacts: immutable versions on disk, verified when read; and what went wrong beside a result that is there already.

runs/<experiment>/<stage>/v0001/ holds the stage's files, manifest.json (what it was made from and the sha256 of every
file) and timings.json (wall-clock facts, outside every hash, so that the same seed gives the same bytes).
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from gpsim.errors import UsageError, near_path
from gpsim.files import (
    FULL,
    MOST_JSON,
    REFUSED,
    Json,
    canonical,
    everything_below,
    file_digest,
    read_json,
    regular_bytes,
    tells_of_full_disk,
    unreadable,
    write_json,
)

MANIFEST, TIMINGS = "manifest.json", "timings.json"


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
                f"{self.stage}: a setting is not finite; give a number, or null where allowed"
            ) from error
        except TypeError as error:  # YAML knows dates, JSON does not
            raise UsageError(
                f"{self.stage}: a setting must be a number, text, list or mapping ({error}); quote dates, as "
                "'2026-01-31'"
            ) from error


NO_FILE = "no file"
"""Stands for the sha256 of what is none: a link to a folder or to nothing, a pipe, a socket."""


def folder_digests(folder: Path) -> dict[str, str]:
    """POSIX path to sha256 for everything below `folder` but the manifest and the timings, sorted.

    What is no file is never opened. Raises UsageError for a file or a folder that cannot be read: what it holds would
    pass for missing.
    """
    relative = {p.relative_to(folder).as_posix(): p for p in everything_below(folder)}
    return {
        name: file_digest(p) if p.is_file() else NO_FILE
        for name, p in sorted(relative.items())
        if name not in (MANIFEST, TIMINGS)
    }


def read_artifact(path: Path, stage: str | None = None) -> Artifact:
    """Open and verify an artifact; a changed, missing or added byte is a UsageError."""
    artifact = read_manifest(path, stage)
    expected, made_by = artifact.manifest["files"], artifact.stage
    if stage is not None and made_by != stage:
        give = f"give a folder made by `gpsim {stage}`"
        raise UsageError(f"{path}: made by '{made_by}', expected an artifact of '{stage}'; {give}")
    actual = folder_digests(path)
    for name in sorted(set(expected) | set(actual)):
        if expected.get(name) != actual.get(name):
            problem = "missing" if name not in actual else "added" if name not in expected else "changed"
            cure = "remove that file" if problem == "added" else "delete the folder and make it again"
            raise UsageError(f"{path / name}: {problem} after it was written; {cure}")
    return artifact


def read_manifest(path: Path, stage: str | None = None) -> Artifact:
    """An artifact whose manifest is whole, else UsageError; its files are not looked at. stage: that is to be given."""
    try:
        manifest = json.loads(regular_bytes(path / MANIFEST, MOST_JSON))
        recorded = manifest.pop("sha256", None)
        whole = recorded == hashlib.sha256(canonical(manifest)).hexdigest()
    except (FileNotFoundError, NotADirectoryError) as error:
        why = f"no {MANIFEST}" if path.exists() else f"no such folder{near_path(path)}"
        give = f"give a folder made by `gpsim {stage or 'STAGE'}`; `gpsim runs list` names those in runs/"
        raise UsageError(f"{path}: not an artifact ({why}); {give}") from error
    except OSError as error:
        raise unreadable(path / MANIFEST, error) from error
    except (ValueError, TypeError, AttributeError, RecursionError) as error:
        raise UsageError(
            f"{path / MANIFEST}: damaged ({type(error).__name__}); delete the folder and make it again"
        ) from error
    if not whole or not _sound(manifest):
        raise UsageError(
            f"{path / MANIFEST}: changed after it was written; delete the folder and make it again"
        )
    return Artifact(path, manifest, identity(manifest))


def _sound(manifest: Json) -> bool:
    """Whether the parts of a manifest that are read are there, and of their kinds."""
    maps = ("config", "seeds", "parents", "packages", "files")
    return (
        all(isinstance(manifest.get(name), str) for name in ("stage", "key"))
        and all(isinstance(manifest.get(name, {}), dict) for name in maps)
        and "files" in manifest
        and all(isinstance(digest, str) for digest in manifest["files"].values())
        and all(isinstance(parent, dict) for parent in manifest.get("parents", {}).values())
    )


def read_timings(folder: Path) -> Json:
    """Facts of the clock; they are no part of the artifact, and what is lost or of another kind is left out."""
    try:
        found = read_json(folder / TIMINGS)
    except (OSError, UsageError):
        return {}
    if not isinstance(found, dict):
        return {}
    parents = found.get("parents")
    lineage = {r: p for r, p in parents.items() if isinstance(p, str)} if isinstance(parents, dict) else {}
    sound = {
        name: found[name] for name, kind in KINDS.items() if name in found and isinstance(found[name], kind)
    }
    return {k: v for k, v in found.items() if k not in KINDS} | sound | {"parents": lineage}


KINDS = {"finished": str, "seconds": int | float}
"""Of the facts of the clock that every artifact has."""
IDENTITY = ("stage", "config", "seeds", "parents", "files")
"""What an artifact is, of what its manifest says: commit and packages are where it comes from."""


def identity(manifest: Json) -> str:
    """sha256 of what an artifact is."""
    return hashlib.sha256(canonical({key: manifest.get(key) for key in IDENTITY})).hexdigest()


WARNINGS = "warnings.json"
"""A file of an artifact, there only where something went wrong: a list of lines."""


class WarningLog:
    """Lines about what went wrong, in the order in which it did."""

    def __init__(self, lines: Iterable[str] = ()) -> None:
        self.lines = list(lines)

    @contextmanager
    def contained(self, what: str) -> Iterator[None]:
        """An error within the block becomes the line "WHAT: error".

        What is the user's to mend, bad input or a disk that is full, ends the program as ever.
        """
        try:
            yield
        except UsageError:
            raise
        except Exception as error:  # drawing, and fitting what comes beside the result, may raise anything
            if isinstance(error, OSError) and (
                error.errno in (*FULL, *REFUSED) or tells_of_full_disk(str(error))
            ):
                raise
            self.lines.append(f"{what}: {in_short(error)}")

    def write(self, folder: Path) -> None:
        """To the artifact's folder, if there are any."""
        if self.lines:
            write_json(folder / WARNINGS, self.lines)


def read_warnings(folder: Path) -> list[str]:
    """What went wrong when a finished artifact was made."""
    path = folder / WARNINGS
    if not path.is_file():
        return []
    lines = read_json(path)
    return [str(line) for line in lines] if isinstance(lines, list) else []


def in_short(error: BaseException) -> str:
    """An error in one line."""
    return f"{type(error).__name__}: {' '.join(str(error).split())[:160]}".removesuffix(": ")
