"""ROS 2 bags: folders whose metadata.yaml names storage files, and sqlite3 storage, in file order and nothing written.

rosbags' reader asks sqlite to sort all messages by time; here rows stream in the order in which they were written.
"""

from __future__ import annotations

import shutil
import sqlite3
import weakref
from collections import Counter
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from contextlib import closing, contextmanager
from dataclasses import dataclass, replace
from pathlib import Path, PurePosixPath
from tempfile import mkdtemp
from typing import Annotated, Any

from gpsim.errors import UsageError
from gpsim.recordings.readers.container import (
    LATEST,
    MAX_MESSAGE,
    Budget,
    Catalogue,
    Container,
    DamageError,
    DefinitionFormat,
    Ledger,
    Message,
    Stream,
    expand_file,
    expand_message,
    refusal,
    regular_file,
    topic_name,
    wrong_kind,
)
from gpsim.recordings.values import Sound, one_line, sound
from gpsim.recordings.yaml_data import YamlError, parse_yaml

_MAGIC = b"SQLite format 3\x00"
_FORMATS: dict[str, DefinitionFormat] = {"ros2msg": "msg", "ros2idl": "idl"}
_TOPICS = ("id", "name", "type", "serialization_format")
_MESSAGES = ("topic_id", "timestamp", "data")
_DEFINITIONS = ("topic_type", "encoding", "encoded_message_definition")
_COUNTED = "SELECT topic_id, COUNT(*), MIN(timestamp), MAX(timestamp) FROM messages GROUP BY +topic_id"
_SINGLE_STEPS = 50
_SMALLEST_ROW = 8
_LAST_ROW = 2**62
_FAULTS = (sqlite3.Error, DamageError, OverflowError, MemoryError)


class Sqlite(Container):
    """One .db3 file."""

    @contextmanager
    def _open(self, *, salvage: bool) -> Iterator[sqlite3.Connection]:
        with self.path.open("rb") as file:
            if file.read(len(_MAGIC)) != _MAGIC:
                raise wrong_kind(self.path, "a sqlite3 file", "it does not begin with SQLite format 3")
        # immutable: no journal, no lock, no write; a write-ahead log beside the file is looked for in `streams`.
        uri = f"{self.path.resolve().as_uri()}?immutable=1"
        with closing(sqlite3.connect(uri, uri=True, isolation_level=None)) as base:
            base.text_factory = bytes
            base.setlimit(sqlite3.SQLITE_LIMIT_LENGTH, MAX_MESSAGE)
            base.setlimit(sqlite3.SQLITE_LIMIT_ATTACHED, 0)
            base.execute("PRAGMA trusted_schema=OFF")
            if salvage:
                # sqlite's own recovery mode: the only way it opens a file that is shorter than its header says.
                base.execute("PRAGMA writable_schema=ON")
            # A page tree can be bent so that one page counts a billion times: no honest file needs more steps.
            left = [100 + self.size // 20_000]

            def spend() -> int:
                left[0] -= 1
                return int(left[0] < 0)

            base.set_progress_handler(spend, 100_000)
            yield base

    def streams(self, ledger: Ledger) -> Sequence[Stream]:
        """The rows of the table `topics`, counted in the table `messages`."""
        unwritten = self.path.with_name(f"{self.path.name}-wal")
        if unwritten.is_file() and unwritten.stat().st_size:
            what = f"messages in {unwritten.name} were never written into the bag (sqlite3 would do it)"
            ledger.lost(what, "byte 0")
        found = Catalogue()
        try:
            with self._open(salvage=ledger.salvage) as base:
                self._check_tables(base)
                known = _definitions(base, ledger)
                rows = base.execute(f"SELECT {', '.join(_TOPICS)} FROM topics ORDER BY +id").fetchall()
        except _FAULTS as error:
            reason = f"sqlite3 bag cannot be read: {one_line(error)}"
            ledger.lost(reason, "table topics")
            # Salvage has nothing to offer where the schema or the topics cannot be read.
            raise refusal(self.path, "table topics", reason) from error
        for row in rows:
            try:
                stream = _stream(row, known)
                found.streams[stream.id] = stream
            except DamageError as error:
                ledger.lost(error.reason, "table topics")
        try:
            with self._open(salvage=ledger.salvage) as base:
                for topic, count, start, end in base.execute(_COUNTED).fetchall():
                    found.tally(topic, count, _time(start), _time(end))
        except _FAULTS as error:
            ledger.lost(f"messages cannot be counted: {one_line(error)}", "table messages")
            found.tallies.clear()
            for topic, stamp, _ in self._rows("", ledger.silent()):
                found.tally(topic, 1, stamp, stamp)
        orphans = sum(tally[0] for topic, tally in found.tallies.items() if topic not in found.streams)
        if orphans:
            ledger.lost(f"{orphans} messages belong to no topic", "table messages")
        return found.result()

    def _check_tables(self, base: sqlite3.Connection) -> None:
        tables = {_text(n) for (n,) in base.execute("SELECT name FROM sqlite_master WHERE type='table'")}
        for table, columns in (("topics", _TOPICS), ("messages", _MESSAGES)):
            if table not in tables or not set(columns) <= _columns(base, table):
                what = f"it has no table {table} with {', '.join(columns)}"
                raise wrong_kind(self.path, "a ROS 2 bag", what)

    def messages(self, wanted: Collection[int], ledger: Ledger) -> Iterator[Message]:
        """Messages of the wanted topics in file order."""
        return self._rows(f"AND +topic_id IN ({', '.join(str(int(i)) for i in sorted(wanted))})", ledger)

    def _rows(self, chosen: str, ledger: Ledger) -> Iterator[Message]:
        """Rows in order of their numbers; behind a damaged page the search goes on (salvage only)."""
        query = (
            f"SELECT rowid, topic_id, timestamp, data FROM messages WHERE rowid > ? {chosen} ORDER BY rowid"
        )
        last, failures, left = -1, 0, 100 + self.size // _SMALLEST_ROW
        with self._open(salvage=ledger.salvage) as base:
            while last < _LAST_ROW:
                try:
                    for row, topic, stamp, data in base.execute(query, (last,)):
                        left -= 1
                        if row <= last or left < 0:
                            raise sqlite3.DatabaseError(f"row {row} comes behind row {last}")
                        last, failures, self.where = row, 0, f"row {row}"
                        if isinstance(data, bytes) and isinstance(stamp, int) and 0 <= stamp < LATEST:
                            yield topic, stamp, data
                        else:
                            ledger.lost("a message's time or data are no time or no data", self.where)
                    return
                except (sqlite3.Error, OverflowError, MemoryError) as error:
                    if failures == 0:
                        ledger.lost(f"rows cannot be read: {one_line(error)}", f"behind row {last}")
                    failures += 1
                    # Rows of a damaged page are few and close together; a damaged branch of the tree is wide.
                    last += 1 if failures < _SINGLE_STEPS else 2 ** (failures - _SINGLE_STEPS)


def _columns(base: sqlite3.Connection, table: str) -> set[str]:
    return {_text(row[1]) for row in base.execute(f"PRAGMA table_xinfo({table})") if row[6] == 0}


def _stream(row: Sequence[object], known: dict[str, tuple[str, DefinitionFormat]]) -> Stream:
    identity, name, kind, encoding = row
    if not isinstance(identity, int) or not 0 <= identity < 2**31:
        raise DamageError(f"a topic's number is {one_line(identity, 40)!r}")
    topic, fault = topic_name(name if isinstance(name, bytes) else b"")
    try:
        spelled, encoded = _text(kind), _text(encoding)
    except DamageError as error:
        return Stream(identity, topic, fault=fault or error.reason)
    return Stream(identity, topic, spelled, *known.get(spelled, ("", "none")), encoded, fault=fault)


def _definitions(base: sqlite3.Connection, ledger: Ledger) -> dict[str, tuple[str, DefinitionFormat]]:
    """Definitions by type, which bags hold since ROS 2 Iron; empty in older ones."""
    known: dict[str, tuple[str, DefinitionFormat]] = {}
    if not set(_DEFINITIONS) <= _columns(base, "message_definitions"):
        return known
    try:
        for row in base.execute(f"SELECT {', '.join(_DEFINITIONS)} FROM message_definitions"):
            try:
                kind, form, definition = (_text(value) for value in row)
            except DamageError:  # concerns the topics of this type only: they have no definition
                continue
            if form in _FORMATS and definition:
                known[kind] = (definition, _FORMATS[form])
    except sqlite3.Error as error:
        ledger.lost(f"definitions cannot be read: {one_line(error)}", "table message_definitions")
    return known


def _text(value: object) -> str:
    try:
        if isinstance(value, bytes):
            return value.decode()
    except UnicodeDecodeError as error:
        raise DamageError(f"text expected, found {one_line(error.object[:40])}") from error
    raise DamageError(f"text expected, found {one_line(value, 40)!r}")


def _time(value: object) -> int:
    if not isinstance(value, int) or not 0 <= value < LATEST:
        raise DamageError(f"a message's time is {one_line(value, 40)!r}")
    return value


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


class Folder(Container):
    """A ROS 2 bag folder; `openers` makes a container of a storage file by its suffix."""

    def __init__(self, path: Path, openers: Mapping[str, Callable[[Path], Container]]) -> None:
        self.path, self.openers, self.where, self.distro = path, openers, METADATA, None
        self._parts: list[Container] = []
        self._compressed = False
        self._unpacked: Path | None = None

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
            base, where = len(self._parts) << _SHIFT, METADATA
            try:
                self._parts.append(self._open(name, metadata.compression_mode == "file", ledger))
                where = name
                found += [replace(s, id=base + s.id) for s in self._parts[-1].streams(ledger)]
            except DamageError as error:
                ledger.lost(error.reason, METADATA)
            except (
                UsageError
            ) as error:  # of one that cannot be read at all, which keeps salvage from no other
                # The person knows the file by its own name, not by that of its unpacked copy.
                reason = str(error).replace(f"{self._unpacked}/", "")
                if not ledger.salvage:
                    raise UsageError(
                        reason if str(self.path) in reason else f"{self.path}: {reason}"
                    ) from error
                ledger.lost(reason, where)
        if not self._parts or (ledger.file and not found):
            reasons = "; ".join(ledger.file)
            raise refusal(self.path, "storage files", f"none of them can be read: {reasons}")
        return self._compare(found, metadata.topics_with_message_count)

    def messages(self, wanted: Collection[int], ledger: Ledger) -> Iterator[Message]:
        """Messages of the wanted streams, file by file."""
        for index, part in enumerate(self._parts):
            base = index << _SHIFT
            own = [i - base for i in wanted if base <= i < base + (1 << _SHIFT)]
            budget = Budget(self.path, part.size)
            for identity, stamp, data in part.messages(own, ledger) if own else ():
                self.where = part.where
                if self._compressed:
                    try:
                        data = expand_message(data)
                    except DamageError as error:
                        ledger.lost(error.reason, self.where)
                        continue
                    budget.chunk(len(data))
                yield base + identity, stamp, data

    def _open(self, name: str, compressed: bool, ledger: Ledger) -> Container:
        path = self.path / name
        regular_file(path)
        if compressed:
            if self._unpacked is None:
                self._unpacked = Path(mkdtemp(prefix="gpsim-bag-"))
                weakref.finalize(self, shutil.rmtree, self._unpacked, ignore_errors=True)
            target = self._unpacked / path.stem
            reason = expand_file(path, target)
            if reason is not None:
                ledger.lost(reason, METADATA)
            if not target.is_file() or target.stat().st_size == 0:
                raise DamageError(f"nothing of {one_line(name, 80)} can be decompressed")
            path = target
        if path.suffix not in self.openers:
            raise DamageError(f"{one_line(name, 80)} is neither .db3 nor .mcap")
        return self.openers[path.suffix](path)

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
                found.append(Stream(-1 - len(found), name, count=missing, fault=fault or lost))
        return found
