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


def _read_metadata(path: Path) -> _Information:
    if not path.is_file():
        raise DamageError("the folder has no metadata.yaml")
    if path.stat().st_size > _MAX_METADATA:
        raise DamageError(f"{path.stat().st_size} bytes of metadata")
    try:
        raw = parse_yaml(path.read_text(encoding="utf-8"))
        info: _Information = sound(_File, raw, METADATA).rosbag2_bagfile_information
    except (UsageError, YamlError, OSError, ValueError) as error:
        raise DamageError(one_line(error, 160)) from error
    if not 1 <= info.version <= _NEWEST:
        raise DamageError(f"version is {info.version}; 1 to {_NEWEST} are known")
    mode, form = (info.compression_mode or "none").lower(), info.compression_format
    if mode not in ("none", "file", "message") or (mode != "none" and form != "zstd"):
        raise DamageError(f"compression {one_line(mode, 40)} in {one_line(form, 40)}")
    return replace(info, compression_mode=mode)


@dataclass
class Folder:
    """A ROS 2 bag folder; `openers` makes a container of a storage file by its suffix."""

    path: Path
    openers: Mapping[str, Callable[[Path], Container]]
    distro: str | None = None
    size: int = 0
    _parts: list[Container] = field(default_factory=list)
    _part: int = 0
    _compressed: bool = False
    _unpacked: Path | None = None

    @property
    def where(self) -> str:
        """The place being read in the storage file being read."""
        return self._parts[self._part].where if self._parts else METADATA

    def streams(self, ledger: Ledger) -> Sequence[Stream]:
        """The streams of all storage files, ids made unique."""
        try:
            metadata = _read_metadata(self.path / METADATA)
        except DamageError as error:
            names = sorted(p.name for p in self.path.iterdir() if p.suffix in self.openers and p.is_file())
            if not names:
                reason = f"{error.reason}, and the folder contains no .db3 or .mcap"
                raise refusal(self.path, METADATA, reason) from error
            ledger.lost(f"{error.reason} (storage files there: {', '.join(names[:5])})", METADATA)
            metadata = _Information(_NEWEST, tuple(names), [])
        self.distro = metadata.ros_distro if isinstance(metadata.ros_distro, str) else None
        self._compressed = metadata.compression_mode == "message"
        found: list[Stream] = []
        for name in metadata.relative_file_paths:
            part = self._open(name, metadata.compression_mode == "file", ledger)
            if part is not None:
                base = len(self._parts) << _SHIFT
                self._parts.append(part)
                found += [replace(s, id=base + s.id) for s in self._streams_of(part, name, ledger)]
        if not self._parts or (ledger.file and not found):
            reasons = "; ".join(ledger.file)
            raise refusal(self.path, "storage files", f"none of them can be read: {reasons}")
        return self._compare(found, metadata.topics_with_message_count)

    def messages(self, wanted: Collection[int], ledger: Ledger) -> Iterator[Message]:
        """Messages of the wanted streams, file by file."""
        for index, part in enumerate(self._parts):
            self._part, base = index, index << _SHIFT
            own = [i - base for i in wanted if base <= i < base + (1 << _SHIFT)]
            budget = Budget(self.path, part.size)
            for identity, stamp, data in part.messages(own, ledger) if own else ():
                if self._compressed:
                    try:
                        data = expand_message(data, MAX_MESSAGE)
                    except DamageError as error:
                        ledger.lost(error.reason, self.where)
                        continue
                    budget.chunk(len(data))
                yield base + identity, stamp, data

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
            if path.suffix not in self.openers:
                raise DamageError(f"{one_line(name, 80)} is neither .db3 nor .mcap")
            return self.openers[path.suffix](path)
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

    def _compare(self, found: list[Stream], counts: Sequence[_Count]) -> list[Stream]:
        """Streams that count what metadata.yaml announces, so that reading them tells what is missing."""
        announced: Counter[str] = Counter()
        for entry in counts:
            announced[entry.topic_metadata.name] += entry.message_count
        for stream in found:
            announced[stream.topic] -= stream.count or 0
        for topic, missing in announced.items():
            last = next((i for i in reversed(range(len(found))) if found[i].topic == topic), None)
            if last is not None and missing and counts:
                found[last] = replace(found[last], count=max(0, (found[last].count or 0) + missing))
            elif missing > 0:
                name, fault = topic_name(topic)
                lost = f"{METADATA} announces {missing} messages, but the storage files have no such topic"
                stream = Stream(-1 - len(found), name, "unknown", "", "none", "", count=missing)
                found.append(replace(stream, fault=fault or lost))
        return found
