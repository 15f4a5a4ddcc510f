"""Every artifact below a folder, those elsewhere that they name as parents, and what is left over beside them."""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from datetime import datetime
from functools import cached_property
from pathlib import Path

from gpsim import artifacts
from gpsim.artifacts import MANIFEST, SCHEMA, VERSION, Artifact, Leftover, read_manifest
from gpsim.errors import UsageError
from gpsim.files import MOST_JSON, Json, files_below, regular_bytes, unreadable

PARTS = 3
"""<experiment>/<stage>/<version>"""


@dataclass(frozen=True)
class Need:
    """A parent of an artifact, by what it is: its digest, or, of a recording that was given, the sha256 of its files.

    path: where it lay when it was used; None where the artifact does not say.
    """

    role: str
    stage: str | None = None
    digest: str | None = None
    files: Mapping[str, str] = field(default_factory=dict)
    path: str | None = None


@dataclass(frozen=True)
class Entry:
    """An artifact on disk, or a version's folder that is none any more.

    name: experiment/stage/version below the runs folder, elsewhere the path; number: that of the version, None
    elsewhere; bytes: of all its files; artifact: None where the manifest is damaged; damage: in words, None where the
    manifest is whole and every file it names is there; timings: wall-clock facts, {} where they are lost.
    """

    path: Path
    name: str
    experiment: str | None
    stage: str
    number: int | None
    bytes: int
    artifact: Artifact | None
    damage: str | None
    timings: Json

    @property
    def whole(self) -> bool:
        """Whether it can be read, as far as was looked."""
        return self.damage is None

    @property
    def made(self) -> str | None:
        """When it was finished, ISO 8601 with the maker's offset."""
        text = self.timings.get("finished")
        return text if isinstance(text, str) and _moment(text) is not None else None

    @property
    def age_key(self) -> tuple[float, int]:
        """Orders artifacts from the oldest to the newest: by the clock, then by the version's number."""
        return _moment(str(self.timings.get("finished"))) or 0.0, self.number or 0

    @property
    def manifest(self) -> Json:
        """Its manifest; {} where that is damaged."""
        return self.artifact.manifest if self.artifact is not None else {}

    @cached_property
    def needs(self) -> tuple[Need, ...]:
        """What it was made from, as its manifest says."""
        paths = self.timings.get("parents", {})
        found = [
            Need(role, parent.get("stage"), parent.get("sha256"), path=paths.get(role))
            for role, parent in self.manifest.get("parents", {}).items()
        ]
        config = self.manifest.get("config", {})
        given = config.get("recording")
        if isinstance(given, dict) and given:  # a recording that was given by its folder: known by its files
            found.append(Need("recording", files={str(name): str(digest) for name, digest in given.items()}))
        for one in config.get("recordings") or ():  # judged together; a fleet names diagnoses
            if isinstance(one, dict) and isinstance(one.get("files"), dict):
                found.append(Need(f"recording {one.get('name')}", files=one["files"]))
        return tuple(found)

    def serves(self, need: Need) -> bool:
        """Whether this is the parent that is needed, or its twin: equal contents are one artifact."""
        if self.artifact is None or not self.whole:
            return False
        if need.digest is not None:
            return self.artifact.digest == need.digest
        return bool(need.files) and need.files.items() <= self.manifest["files"].items()


@dataclass(frozen=True)
class Catalogue:
    """All that was found: artifacts by experiment, stage and age, and what is left over.

    root: the runs folder; what lies elsewhere is read, too, where an artifact names it as a parent.
    """

    root: Path
    entries: tuple[Entry, ...]
    leftovers: tuple[Leftover, ...]

    def providers(self, need: Need) -> tuple[Entry, ...]:
        """Every artifact that is the needed parent."""
        if need.digest is None:
            return tuple(entry for entry in self.entries if entry.serves(need))
        return tuple(entry for entry in self._by_digest.get(need.digest, ()) if entry.whole)

    @cached_property
    def _by_digest(self) -> Mapping[str, list[Entry]]:
        found: dict[str, list[Entry]] = {}
        for entry in self.entries:
            if entry.artifact is not None:
                found.setdefault(entry.artifact.digest, []).append(entry)
        return found


def read_catalogue(root: Path, beside: Iterable[Path] = (), verify: bool = False) -> Catalogue:
    """Every artifact below `root` and the folders `beside`, at any depth, and parents elsewhere that they name.

    verify: look at every byte; else only whether manifests are whole and all files there. Nothing is written. Raises
    UsageError for a folder that cannot be read.
    """
    shelves: list[Path] = []
    seen: set[tuple[int, int]] = set()
    entries = [
        entry_at(path, root, verify)
        for place in (root, *beside)
        if place.is_dir()
        for path in _artifacts_below(place, root, shelves, seen)
    ]
    ahead = list(entries)
    while ahead:  # parents elsewhere, and theirs
        for need in ahead.pop().needs:
            if need.path is None or not (path := Path(need.path)).is_dir() or _seen(path, seen):
                continue
            if _is_artifact(path):
                entries.append(entry_at(path, root, verify))
                ahead.append(entries[-1])
    left = [leftover for shelf in shelves for leftover in artifacts.leftovers(shelf)]
    entries.sort(key=lambda e: (e.experiment or "~", e.stage, e.age_key, e.name))
    return Catalogue(root, tuple(entries), tuple(left))


def entry_at(path: Path, root: Path, verify: bool = False) -> Entry:
    """The artifact in a folder."""
    place = path.relative_to(root).parts if path.is_relative_to(root) else ()
    version = VERSION.fullmatch(path.name) if len(place) == PARTS else None
    artifact, damage = None, None
    try:
        artifact = read_manifest(path)
        lost = [name for name in artifact.manifest["files"] if not (path / name).is_file()]
        damage = f"{path / lost[0]}: missing" if lost else None
        if verify:
            artifacts.read_artifact(path)
    except UsageError as error:
        damage = str(error)
    return Entry(
        path=path,
        name="/".join(place) if version else str(path),
        experiment=place[0] if version else None,
        stage=artifact.stage if artifact is not None else path.parent.name,
        number=int(version[1]) if version else None,
        bytes=size_of(path),
        artifact=artifact,
        damage=damage,
        timings=artifacts.read_timings(path),
    )


def size_of(path: Path) -> int:
    """Bytes of a file, or of all files below a folder; of what goes away meanwhile none, of a link its own."""
    total = 0
    for file in files_below(path) if path.is_dir() and not path.is_symlink() else [path]:
        try:
            total += file.lstat().st_size
        except FileNotFoundError:
            continue
    return total


def _artifacts_below(
    place: Path, root: Path, shelves: list[Path], seen: set[tuple[int, int]]
) -> Iterator[Path]:
    """Folders of artifacts, and version folders that are none any more; other folders are noted as shelves.

    What a link leads to comes last, under its own name elsewhere, and its shelves are nobody's to sweep.
    """
    ahead, links = [place], list[Path]()
    while ahead or links:
        linked = not ahead
        folder = links.pop().resolve() if linked else ahead.pop()
        if _seen(folder, seen):
            continue
        parts = folder.relative_to(root).parts if not linked and folder.is_relative_to(root) else ()
        if _is_artifact(folder) or (len(parts) == PARTS and VERSION.fullmatch(folder.name)):
            yield folder
            continue
        shelves += [] if linked else [folder]
        try:
            below = sorted(Path(e) for e in os.scandir(folder) if e.is_dir() and e.name[0] != ".")
        except OSError as error:
            raise unreadable(folder, error) from error
        for path in below:
            (links if linked or path.is_symlink() else ahead).append(path)


def _seen(folder: Path, seen: set[tuple[int, int]]) -> bool:
    """Whether a folder was met already, under whichever name; notes it."""
    try:
        place = (folder.stat().st_dev, folder.stat().st_ino)
    except OSError as error:
        raise unreadable(folder, error) from error
    known = place in seen
    seen.add(place)
    return known


def _is_artifact(folder: Path) -> bool:
    """Whether a manifest there says that it is one: other programs have files of that name, too."""
    try:
        return SCHEMA.partition("/")[0].encode() in regular_bytes(folder / MANIFEST, MOST_JSON)
    except (FileNotFoundError, NotADirectoryError):
        return False
    except (OSError, UsageError):  # it is there, and cannot be read: `entry_at` says so
        return True


def _moment(text: str) -> float | None:
    try:
        return datetime.strptime(text, "%Y-%m-%dT%H:%M:%S%z").timestamp()
    except ValueError:
        return None
