"""Raw logs: topics with numeric fields over time, before one clock is made of them, and the files they lie in."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from fnmatch import fnmatch
from pathlib import Path
from typing import Literal, Protocol

from gpsim.channels import FloatArray
from gpsim.errors import UsageError, near_path
from gpsim.recordings.values import check_name, one_line


@dataclass(frozen=True)
class Topic:
    """One topic (or one table) of a log: what `gpsim import --inspect` lists.

    fields: dotted paths of the numeric fields, as `pose.position.x`; count: messages or rows;
    start, end: receive time of the first and the last message [s], None when empty; has_header: stamps of its own;
    texts: columns of text, read as 0, 1, 2 ... in the order in which their words first appear; fault: why nothing of
    it can be read, empty where it can.
    """

    name: str
    type: str
    count: int
    fields: tuple[str, ...]
    start: float | None
    end: float | None
    has_header: bool
    texts: tuple[str, ...] = ()
    fault: str = ""


@dataclass(frozen=True)
class Series:
    """The wanted fields of one topic in file order.

    receive: (N,) s, when the logger wrote it; header: (N,) s, the message's own stamp, None where it has none;
    fields: dotted path to (N,) values; read, dropped: messages decoded and messages that could not be, by reason;
    absent: by field, the rows whose message has no such element (an array too short, another element selected):
    NaN there is no damage.
    """

    topic: str
    type: str
    receive: FloatArray
    header: FloatArray | None
    fields: Mapping[str, FloatArray]
    read: int
    dropped: Mapping[str, int] = field(default_factory=dict)
    absent: Mapping[str, int] = field(default_factory=dict)


class RawLog(Protocol):
    """A log file of any format.

    epoch_ns: what all its stamps are counted from [ns since 1970]; 0 in tables. losses: pieces of the file that a
    log opened for salvage could not read, by reason.
    """

    epoch_ns: int

    @property
    def losses(self) -> Mapping[str, int]:
        """Pieces of the file that could not be read, by reason."""
        ...

    def topics(self) -> Sequence[Topic]:
        """What is inside."""
        ...

    def series(self, wanted: Mapping[str, Sequence[str]]) -> Mapping[str, Series]:
        """Read the wanted dotted fields by topic, message by message, in bounded memory.

        Raises UsageError (file, offset or row, reason, remedy) at damage; a log opened for salvage returns what was
        readable instead and counts the rest in `Series.dropped`.
        """
        ...


@dataclass(frozen=True)
class NamedLog:
    """A log with the name the report uses for it; is_table: rows of a table, not messages of a bag."""

    name: str
    log: RawLog


SUFFIXES = (".bag", ".db3", ".mcap", ".csv", ".parquet", ".mat")
"""Endings of the files that are logs wherever they lie; who names another file says what it is."""
MOST = 10_000  # files below one folder; more is a mistaken path
Opener = Callable[[Path], RawLog]


@dataclass
class FolderLog:
    """The tables of one folder as the topics of one log, each named by its file without the ending."""

    files: Mapping[str, Path]
    opener: Opener
    epoch_ns: int = 0
    _lost: dict[str, Counter[str]] = field(default_factory=dict)

    @property
    def losses(self) -> Mapping[str, int]:
        """Pieces of the files that could not be read (salvage only), by reason; lost rows the series count."""
        return sum(self._lost.values(), Counter())

    def topics(self) -> Sequence[Topic]:
        """One topic a file; a file that cannot be read is at fault by itself."""
        found = []
        for name, path in self.files.items():
            try:
                found.append(replace(self._only(name, self.opener(path)), name=name))
            except UsageError as error:
                found.append(Topic(name, "table", 0, (), None, None, has_header=False, fault=str(error)))
        return found

    def series(self, wanted: Mapping[str, Sequence[str]]) -> Mapping[str, Series]:
        """Read the wanted files only."""
        out = {}
        for name, fields in wanted.items():
            log = self.opener(self.files[name])
            inner = self._only(name, log).name
            out[name] = replace(log.series({inner: fields})[inner], topic=name)
            self._lost[name] = Counter({f"{name}: {why}": count for why, count in log.losses.items()})
        return out

    def _only(self, name: str, log: RawLog) -> Topic:
        topics = log.topics()
        if len(topics) != 1:
            raise UsageError(
                f"{self.files[name]}: layout=folder needs tables with one topic, this one has {len(topics)}"
            )
        return topics[0]


def find_logs(
    paths: Sequence[Path], layout: Literal["files", "folder"], pattern: str, opener: Opener
) -> list[NamedLog]:
    """The logs below the given paths, each path's sorted by name with numbers in numeric order.

    layout files: every log file (or ROS 2 bag folder) is a log; folder: every folder with tables is one.
    """
    found: list[NamedLog] = []
    for path in paths:
        try:
            there = path.exists()
        except OSError as error:
            raise UsageError(f"{one_line(path)}: cannot be read ({error.strerror or error})") from error
        if not there:
            raise UsageError(f"{one_line(path)}: does not exist{near_path(path)}")
        check_name(path.name or ".", one_line(path.parent))
        if layout == "folder":
            found += _folders(path, pattern, opener)
        elif path.is_file() or is_bag_folder(path):
            found.append(NamedLog(path.name, opener(path)))
        else:
            logs = [p for p in _walk(path) if fnmatch(p.name, pattern) and (is_bag_folder(p) or _is_log(p))]
            if not logs:
                kinds = ", ".join(SUFFIXES)
                raise UsageError(f"{path}: no log files named {pattern} ({kinds}) in this folder")
            found += [NamedLog(p.relative_to(path).as_posix(), opener(p)) for p in logs]
    names = [log.name for log in found]
    if len(set(names)) != len(names):  # the same file name from two paths
        found = [NamedLog(f"{number + 1}: {log.name}", log.log) for number, log in enumerate(found)]
    return found


def _folders(path: Path, pattern: str, opener: Opener) -> list[NamedLog]:
    if not path.is_dir():
        raise UsageError(f"{path}: layout=folder needs a folder of tables, not a file")
    groups: dict[Path, dict[str, Path]] = {}
    for file in _walk(path):
        if _is_log(file) and fnmatch(file.name, pattern):
            topics = groups.setdefault(file.parent, {})
            if file.stem in topics:
                raise UsageError(
                    f"{file.parent}: {topics[file.stem].name} and {file.name} would both be the topic '{file.stem}'; "
                    f"select the files, as files='*{file.suffix}'"
                )
            topics[file.stem] = file
    if not groups:
        raise UsageError(f"{path}: no tables named {pattern} in this folder")
    named = {g.relative_to(path).as_posix() if g != path else path.name: files for g, files in groups.items()}
    return [NamedLog(name, FolderLog(files, opener)) for name, files in named.items()]


def is_bag_folder(path: Path) -> bool:
    """Whether this is a ROS 2 bag: a folder with metadata.yaml beside its storage files."""
    return path.is_dir() and (path / "metadata.yaml").is_file()


def _is_log(path: Path) -> bool:
    return path.is_file() and path.suffix.lower() in SUFFIXES


def _walk(folder: Path) -> Iterator[Path]:
    """Files and bag folders below, sorted; a bag folder is not entered, links to folders are not followed."""
    seen = 0
    waiting = [folder]
    while waiting:
        here = waiting.pop(0)
        try:
            children = sorted(here.iterdir(), key=natural)
        except OSError as error:
            raise UsageError(f"{here}: cannot be read ({error.strerror}); name a folder of logs") from error
        seen += len(children)
        if seen > MOST:
            raise UsageError(f"{folder}: more than {MOST} files below; name a folder of logs")
        for child in children:
            if _is_log(child):
                check_name(child.name, one_line(here))
            if child.is_dir() and not is_bag_folder(child):
                if not child.is_symlink():
                    waiting.append(child)
            else:
                yield child


def natural(path: Path) -> list[tuple[int, int, str]]:
    """Sort key that puts Experiment-33 before Experiment-132."""
    parts = re.findall(r"\d+|\D+", path.name)
    return [(0, int(part), "") if part.isdecimal() and part.isascii() else (1, 0, part) for part in parts]
