"""ROS 2 bag folders: metadata.yaml names the storage files, which are read one after the other."""

from __future__ import annotations

import os
import shutil
import weakref
from collections import Counter
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path, PurePosixPath
from tempfile import mkdtemp
from typing import Annotated, Any

from gpsim.errors import UsageError
from gpsim.recordings.readers.damage import (
    MAX_MESSAGE,
    DamageError,
    Ledger,
    expand_file,
    expand_message,
    one_line,
    refusal,
    regular_file,
)
from gpsim.recordings.readers.source import Budget, Container, Message, Stream, topic_name
from gpsim.recordings.values import Sound, sound
from gpsim.recordings.yaml_data import YamlError, parse_yaml

METADATA = "metadata.yaml"
Opener = Callable[[Path], Container]
_MAX_METADATA = 16 << 20
_SHIFT = 40
_NEWEST = 9


def _files(names: object) -> tuple[str, ...]:
    if not isinstance(names, list) or not names or not all(isinstance(name, str) and name for name in names):
        raise ValueError("a list of storage files is expected")
    paths = [PurePosixPath(name) for name in names]
    for path in paths:
        if path.is_absolute() or ".." in path.parts or "\\" in path.name or "\0" in path.name:
            raise ValueError(f"storage file {one_line(path, 80)} lies outside the bag's folder")
    # Bags of ROS 2 before Foxy name the folder in front; the files lie in the folder all the same.
    return tuple(dict.fromkeys(path.name for path in paths))


@dataclass(frozen=True)
class _Topic:
    name: str


@dataclass(frozen=True)
class _Count:
    topic_metadata: _Topic
    message_count: int


@dataclass(frozen=True)
class _Information:
    version: int
    relative_file_paths: Annotated[tuple[str, ...], Sound(_files)]
    topics_with_message_count: list[_Count]
    compression_mode: str | None = None
    compression_format: Any = None
    ros_distro: Any = None


@dataclass(frozen=True)
class _File:
    """What is read of metadata.yaml."""

    rosbag2_bagfile_information: _Information


@dataclass(frozen=True)
class Metadata:
    """What is needed of metadata.yaml. counts: messages by topic; compression: none, message or file."""

    files: tuple[str, ...]
    counts: Mapping[str, int]
    compression: str
    distro: str | None


@dataclass
class Folder:
    """A ROS 2 bag folder; `openers` makes a container of a storage file by its suffix."""

    path: Path
    openers: Mapping[str, Opener]
    distro: str | None = None
    size: int = 0
    _parts: list[Container] = field(default_factory=list)
    _part: int = 0
    _compressed: bool = False
    _unpacked: Path | None = None

    def streams(self, ledger: Ledger) -> Sequence[Stream]:
        """The streams of all storage files, ids made unique."""
        metadata = self._metadata(ledger)
        self.distro = metadata.distro
        self._compressed = metadata.compression == "message"
        found: list[Stream] = []
        for name in metadata.files:
            part = self._open(name, metadata.compression == "file", ledger)
            if part is not None:
                base = len(self._parts) << _SHIFT
                self._parts.append(part)
                found += [replace(s, id=base + s.id) for s in self._streams_of(part, name, ledger)]
        if not self._parts or (ledger.file and not found):
            reasons = "; ".join(ledger.file)
            raise refusal(self.path, "storage files", f"none of them can be read: {reasons}")
        return self._compare(found, metadata, ledger)

    @property
    def where(self) -> str:
        """The place being read in the storage file being read."""
        return self._parts[self._part].where if self._parts else METADATA

    def messages(self, wanted: Collection[int], ledger: Ledger) -> Iterator[Message]:
        """Messages of the wanted streams, file by file."""
        for index, part in enumerate(self._parts):
            self._part, base = index, index << _SHIFT
            own = [i - base for i in wanted if base <= i < base + (1 << _SHIFT)]
            if not own:
                continue
            found = part.messages(own, ledger)
            if self._compressed:
                found = self._expanded(found, ledger, part.size)
            if base:
                found = ((base + identity, stamp, data) for identity, stamp, data in found)
            yield from found

    def _expanded(self, messages: Iterator[Message], ledger: Ledger, size: int) -> Iterator[Message]:
        """The messages of a storage file of `size` bytes, decompressed."""
        budget = Budget(self.path, size)
        for identity, stamp, data in messages:
            try:
                expanded = expand_message(data, MAX_MESSAGE)
            except DamageError as error:
                ledger.lost(error.reason, self.where)
                continue
            budget.chunk(len(expanded))
            yield identity, stamp, expanded

    def _streams_of(self, part: Container, name: str, ledger: Ledger) -> Sequence[Stream]:
        """A storage file's streams; one that cannot be read at all does not keep salvage from the others."""
        try:
            return part.streams(ledger)
        except UsageError as error:
            # The person knows the file by its own name, not by that of its unpacked copy.
            reason = str(error).replace(f"{self._unpacked}{os.sep}", "") if self._unpacked else str(error)
            if not ledger.salvage:
                raise UsageError(reason if str(self.path) in reason else f"{self.path}: {reason}") from error
            ledger.lost(reason, name)
        return ()

    def _open(self, name: str, compressed: bool, ledger: Ledger) -> Container | None:
        path = self.path / name
        try:
            regular_file(path)
            if compressed:
                path = self._unpack(path, ledger)
            opener = self.openers.get(path.suffix)
            if opener is None:
                raise DamageError(f"{one_line(name, 80)} is neither .db3 nor .mcap")
            return opener(path)
        except DamageError as error:
            ledger.lost(error.reason, METADATA)
        except UsageError as error:
            if not ledger.salvage:
                raise
            ledger.lost(str(error), METADATA)
        return None

    def _unpack(self, path: Path, ledger: Ledger) -> Path:
        if self._unpacked is None:
            self._unpacked = Path(mkdtemp(prefix="gpsim-bag-"))
            weakref.finalize(self, shutil.rmtree, self._unpacked, ignore_errors=True)
        target = self._unpacked / path.stem
        reason = expand_file(path, target)
        if reason is not None:
            ledger.lost(reason, METADATA)
        if not target.is_file() or target.stat().st_size == 0:
            raise DamageError(f"nothing of {one_line(path.name, 80)} can be decompressed")
        return target

    def _compare(self, found: list[Stream], metadata: Metadata, ledger: Ledger) -> list[Stream]:
        """Streams that count what metadata.yaml announces, so that reading them tells what is missing."""
        announced = Counter(metadata.counts)
        for stream in found:
            announced[stream.topic] -= stream.count or 0
        for topic, missing in announced.items():
            last = next((i for i in reversed(range(len(found))) if found[i].topic == topic), None)
            if last is not None and missing and metadata.counts:
                found[last] = replace(found[last], count=max(0, (found[last].count or 0) + missing))
            elif missing > 0:
                name, fault = topic_name(topic)
                fault = (
                    fault or f"{METADATA} announces {missing} messages, the storage files have no such topic"
                )
                found.append(
                    Stream(-1 - len(found), name, "unknown", "", "none", "", count=missing, fault=fault)
                )
        return found

    def _metadata(self, ledger: Ledger) -> Metadata:
        try:
            return _read_metadata(self.path / METADATA)
        except DamageError as error:
            files = sorted(p.name for p in self.path.iterdir() if p.suffix in self.openers and p.is_file())
            if not files:
                raise refusal(
                    self.path, METADATA, f"{error.reason}, and the folder holds no .db3 or .mcap"
                ) from error
            ledger.lost(f"{error.reason} (storage files there: {', '.join(files[:5])})", METADATA)
            return Metadata(tuple(files), {}, "none", None)


def _read_metadata(path: Path) -> Metadata:
    if not path.is_file():
        raise DamageError("the folder has no metadata.yaml")
    if path.stat().st_size > _MAX_METADATA:
        raise DamageError(f"{path.stat().st_size} bytes of metadata")
    try:
        raw = parse_yaml(path.read_text(encoding="utf-8"))
    except (YamlError, OSError, ValueError) as error:
        raise DamageError(one_line(error, 160)) from error
    try:
        info = sound(_File, raw, METADATA).rosbag2_bagfile_information
    except UsageError as error:
        raise DamageError(one_line(error, 160)) from error
    if not 1 <= info.version <= _NEWEST:
        raise DamageError(f"version is {info.version}; 1 to {_NEWEST} are known")
    compression = (info.compression_mode or "none").lower()
    if compression not in ("none", "file", "message") or (
        compression != "none" and info.compression_format != "zstd"
    ):
        raise DamageError(
            f"compression {one_line(compression, 40)} in {one_line(info.compression_format, 40)}"
        )
    counts: Counter[str] = Counter()
    for entry in info.topics_with_message_count:
        counts[entry.topic_metadata.name] += entry.message_count
    distro = info.ros_distro if isinstance(info.ros_distro, str) else None
    return Metadata(info.relative_file_paths, dict(counts), compression, distro)
