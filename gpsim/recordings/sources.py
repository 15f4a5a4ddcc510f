"""Read what a mapping wants from a log, find what is damaged, and put every topic on one clock."""

from __future__ import annotations

import itertools
import re
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from fnmatch import fnmatch
from pathlib import Path
from typing import Literal

import numpy as np

from gpsim.channels import FloatArray, IntArray
from gpsim.errors import UsageError
from gpsim.recordings import clock
from gpsim.recordings.binding import Bound, bind, groups, wanted_fields
from gpsim.recordings.mapping import EpisodeRule, ImportMapping, with_fields
from gpsim.recordings.raw import RawLog, Series, Topic
from gpsim.recordings.tracks import Track, build_track, stamps
from gpsim.recordings.values import check_name, one_line

BadRows = Mapping[str, IntArray]
Inspector = Callable[[str, Series, ImportMapping], BadRows]
"""Looks for silent damage: (log name, series, mapping) -> rows to leave out, by reason; may refuse."""


@dataclass(frozen=True)
class NamedLog:
    """A log with the name the report uses for it; is_table: rows of a table, not messages of a bag."""

    name: str
    log: RawLog


@dataclass(frozen=True)
class Part:
    """One piece of a log on one unbroken clock, its channels bound to tracks. tracks: by `Track.name`."""

    name: str
    mapping: ImportMapping
    tracks: dict[str, Track]
    flag: Track | None
    epoch: float


def read_parts(named: NamedLog, mapping: ImportMapping, inspect: Inspector) -> list[Part]:
    """Read one log: once, or once a variant; a table whose clock was set back becomes several parts."""
    if not mapping.episodes.variants:
        return _whole_log(named, mapping, inspect)
    parts = []
    for label, fields in mapping.episodes.variants.items():
        state, action = with_fields(mapping.state, fields), with_fields(mapping.action, fields)
        variant = NamedLog(f"{named.name} [{label}]", named.log)
        parts += _whole_log(variant, replace(mapping, state=state, action=action), inspect)
    return parts


def _whole_log(named: NamedLog, mapping: ImportMapping, inspect: Inspector) -> list[Part]:
    bound = bind(named.name, mapping, {topic.name: topic for topic in named.log.topics()})
    log_epoch = 1e-9 * named.log.epoch_ns
    pieces = _unbroken(named.name, _read(named.log, bound), bound.mapping, log_epoch)
    parts = []
    for number, piece in enumerate(pieces):
        name = named.name if len(pieces) == 1 else f"{named.name} [{number + 1}]"
        held, tracks = _tracks(name, piece, bound, inspect, log_epoch)
        first = [float(track.t[0]) for track in tracks.values() if len(track.t)]
        epoch = float(np.floor(min(first))) if first else 0.0
        tracks = {key: track.shifted(-epoch) for key, track in tracks.items()}
        flag = None if held.flag is None else tracks[held.flag.track]
        parts.append(Part(name, held.mapping, tracks, flag, log_epoch + epoch))
    return parts


def _read(log: RawLog, bound: Bound) -> Mapping[str, Series]:
    """What the mapping wants, by track."""
    found: dict[str, Series] = {}
    for reading in wanted_fields(bound):
        series = log.series({topic: fields for topic, (_, fields) in reading.items()})
        found |= {track: series[topic] for topic, (track, _) in reading.items()}
    return found


def _tracks(
    name: str, series: Mapping[str, Series], bound: Bound, inspect: Inspector, epoch: float
) -> tuple[Bound, dict[str, Track]]:
    """One track a series, or several where not all channels are found in the same rows."""
    made: dict[str, Track] = {}
    for key, one in series.items():
        bad = inspect(name, one, bound.mapping)
        bound, found = groups(key, one, bound)
        for group in found:
            track = build_track(one, group, bad, bound.mapping, name, epoch)
            made[track.name] = track
    return bound, made


def _unbroken(
    name: str, series: Mapping[str, Series], mapping: ImportMapping, epoch: float
) -> list[Mapping[str, Series]]:
    """Cut a single table where its clock was set back; with several topics nobody can tell what is whose."""
    for track, one in series.items():
        choice = mapping.clock.topics.get(one.topic, mapping.clock.stamps)
        t, _ = stamps(one, mapping.time, choice, name, epoch)
        finite = np.flatnonzero(np.isfinite(t))
        sound = np.delete(finite, clock.jumping(t[finite], mapping.checks.jump))
        sound = sound[_first_time(one, sound)]
        if mapping.time is not None:
            _refuse_descending(name, one.topic, t, sound)
        cuts = sorted({*sound[clock.restarts(t[sound])].tolist(), *_new_episodes(one, t, mapping.episodes)})
        if not cuts:
            continue
        if len(series) > 1:
            raise UsageError(
                f"{name}: the clock of {one.topic} was set back at row {cuts[0]}; choose another clock with "
                "clock.topics, or split the log there"
            )
        edges = [0, *cuts, len(t)]
        return [{track: _rows(one, a, b)} for a, b in itertools.pairwise(edges)]
    return [series]


def _refuse_descending(name: str, topic: str, t: FloatArray, rows: IntArray) -> None:
    """A table that is sorted the wrong way, or not at all, is no row of runs whose clocks begin anew."""
    back = np.flatnonzero(np.diff(t[rows]) < 0)
    if 2 * len(back) > len(rows) > 2:
        row, before = int(rows[back[0] + 1]), int(rows[back[0]])
        raise UsageError(
            f"{name}: {topic}, row {row}: time goes back, to {t[row]:.6g} s behind {t[before]:.6g} s "
            f"({len(back)} of {len(rows)} rows do); sort the table by its time"
        )


def _new_episodes(series: Series, t: FloatArray, rule: EpisodeRule) -> list[int]:
    """Rows at which a column says that another episode begins, and the clock begins anew: however short they are."""
    if rule.by != "column" or rule.field is None or rule.field not in series.fields:
        return []
    values = series.fields[rule.field]
    with np.errstate(invalid="ignore"):
        begins = (np.diff(values) != 0) & (np.diff(t) < 0)
    return (np.flatnonzero(begins) + 1).tolist()


def _first_time(series: Series, rows: IntArray) -> IntArray:
    """Which of the rows are no copy of an earlier message; a log read twice in part is no clock set back.

    Rows of a table have no time of arrival to tell copies by: all count.
    """
    if not np.isfinite(series.receive[rows]).all():
        return np.arange(len(rows))
    table = np.stack([series.receive[rows], *(values[rows] for values in series.fields.values())], axis=1)
    return np.sort(np.unique(table, axis=0, return_index=True)[1])


def _rows(series: Series, start: int, stop: int) -> Series:
    """A run of rows; what the reader dropped is booked on the first run."""
    return replace(
        series,
        receive=series.receive[start:stop],
        header=None if series.header is None else series.header[start:stop],
        fields={name: values[start:stop] for name, values in series.fields.items()},
        read=stop - start,
        dropped=series.dropped if start == 0 else {},
    )


SUFFIXES = (".bag", ".db3", ".mcap", ".csv", ".parquet", ".mat")
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
        return [self._topic(name, path) for name, path in self.files.items()]

    def _topic(self, name: str, path: Path) -> Topic:
        try:
            return replace(self._only(name, self.opener(path)), name=name)
        except UsageError as error:
            return Topic(name, "table", 0, (), None, None, has_header=False, fault=str(error))

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
                f"{self.files[name]}: layout=folder takes tables of one topic, this has {len(topics)}"
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
        if not _exists(path):
            raise UsageError(f"{one_line(path)}: does not exist")
        check_name(path.name or ".", one_line(path.parent))
        found += _folders(path, pattern, opener) if layout == "folder" else _files(path, pattern, opener)
    names = [log.name for log in found]
    if len(set(names)) != len(names):  # the same file name from two paths
        found = [NamedLog(f"{number + 1}: {log.name}", log.log) for number, log in enumerate(found)]
    return found


def _exists(path: Path) -> bool:
    try:
        return path.exists()
    except OSError as error:
        raise UsageError(f"{one_line(path)}: cannot be read ({error.strerror or error})") from error


def _files(path: Path, pattern: str, opener: Opener) -> list[NamedLog]:
    if path.is_file() or is_bag_folder(path):
        return [NamedLog(path.name, opener(path))]
    logs = [p for p in _walk(path) if fnmatch(p.name, pattern) and (is_bag_folder(p) or _is_log(p))]
    if not logs:
        raise UsageError(f"{path}: no log files named {pattern} ({', '.join(SUFFIXES)}) in this folder")
    return [NamedLog(p.relative_to(path).as_posix(), opener(p)) for p in logs]


def _folders(path: Path, pattern: str, opener: Opener) -> list[NamedLog]:
    if not path.is_dir():
        raise UsageError(f"{path}: layout=folder wants a folder of tables, not a file")
    groups: dict[Path, dict[str, Path]] = {}
    for file in _walk(path):
        if _is_log(file) and fnmatch(file.name, pattern):
            topics = groups.setdefault(file.parent, {})
            if file.stem in topics:
                raise UsageError(
                    f"{file.parent}: {topics[file.stem].name} and {file.name} would both be the topic "
                    f"'{file.stem}'; say which files to take, as files='*{file.suffix}'"
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
