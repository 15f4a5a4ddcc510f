"""Bags as a raw log: rosbags decodes the messages, containers fetch bytes, fields become columns of float64."""

from __future__ import annotations

from array import array
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import chain
from operator import attrgetter, itemgetter
from pathlib import Path
from typing import Any

import numpy as np

from gpsim.channels import FloatArray, IntArray
from gpsim.errors import UsageError
from gpsim.recordings.raw import Series, Topic
from gpsim.recordings.readers import messages
from gpsim.recordings.readers.container import LATEST, Container, DamageError, Ledger, Stream, check_topics
from gpsim.recordings.values import one_line

DEFAULT_DISTRO = "humble"
MISSING = "listed in the index, but not found"
BLOCK = 4096
NAN, NO_STAMP = float("nan"), -(2**63)
Row = Sequence[Any]
_SAMPLES, _SAMPLE_MESSAGES = 100, 5_000
_YEAR_NS = 366 * 86_400 * 10**9


class Columns:
    """Grows as rows come: receive time [ns], stamp [ns] and values, each in one flat array.

    Python objects live for one block of 4096 rows only. The arrays grow in place (array.array, which reallocates by
    a sixteenth), so that a column's memory is 8 bytes a value, with no second copy at the end.
    """

    def __init__(self, names: tuple[str, ...]) -> None:
        self.names = names
        self.absent: dict[str, int] = {}
        self._receive: list[int] = []
        self._rows: list[Row] = []
        self._times = (array("q"), array("q"))
        self._values = [array("d") for _ in names]

    def append(self, receive: int, row: Row) -> None:
        """Add one row: the values in the order of `names`, then the stamp's seconds and nanoseconds."""
        self._receive.append(receive)
        self._rows.append(row)
        if len(self._rows) >= BLOCK:
            self._flush()

    def _flush(self) -> None:
        width = len(self.names) + 2
        flat = np.fromiter(chain.from_iterable(self._rows), dtype=np.float64, count=len(self._rows) * width)
        *columns, seconds, nanoseconds = flat.reshape(-1, width).T
        known = np.isfinite(seconds)
        stamp = np.full(len(known), NO_STAMP, dtype=np.int64)
        stamp[known] = seconds[known].astype(np.int64) * 10**9 + nanoseconds[known].astype(np.int64)
        self._times[0].extend(self._receive)
        self._times[1].frombytes(stamp.tobytes())
        for kept, column in zip(self._values, columns, strict=True):
            kept.frombytes(column.tobytes())
        self._receive.clear()
        self._rows.clear()

    def finished(self) -> tuple[IntArray, IntArray, dict[str, FloatArray]]:
        """(receive times [ns], header stamps [ns] or NO_STAMP, values by field), each (N,); no row may come after."""
        self._flush()
        receive, stamp = (np.frombuffer(times, dtype=np.int64) for times in self._times)
        values = (np.frombuffer(kept, dtype=np.float64) for kept in self._values)
        return receive, stamp, dict(zip(self.names, values, strict=True))


@dataclass(slots=True)
class _Reading:
    stream: Stream
    decode: Callable[[bytes, str], object]
    rows: Callable[[Any], Sequence[Row]]
    append: Callable[[int, Row], None]
    found: int = 0
    lost: int = 0


class BagLog:
    """A bag. Times are seconds after `epoch_ns`, the whole second before its first message (nanoseconds survive)."""

    def __init__(self, path: Path, container: Container, *, salvage: bool) -> None:
        self.path = path
        self._container = container
        self._ledger = Ledger(path, salvage=salvage)
        self._streams = tuple(container.streams(self._ledger))
        check_topics(path, len(self._streams))
        # Of an old sqlite3 bag without definitions: the message types of the ROS 2 that its metadata name.
        self.distro = container.distro if container.distro in messages.DISTROS else DEFAULT_DISTRO
        self._decoders: dict[int, messages.Decoder] = {}
        self._nodes = 0
        self.epoch_ns = _epoch([s.start for s in self._streams if s.start is not None])

    @property
    def losses(self) -> Mapping[str, int]:
        """Pieces of the file that could not be read (salvage only), by reason; messages are in Series.dropped."""
        return self._ledger.pieces()

    def topics(self) -> Sequence[Topic]:
        """What is inside, from the index; arrays are listed as long as in the first messages."""
        samples = self._samples()
        return tuple(self._topic(name, samples) for name in sorted({s.topic for s in self._streams}))

    def _topic(self, name: str, samples: Mapping[int, list[Any]]) -> Topic:
        streams = [s for s in self._streams if s.topic == name]
        fields: dict[str, None] = {}
        stamped, fault = False, ""
        for stream in streams:
            try:
                known = self._decoder(stream)
            except DamageError as error:
                fault = one_line(error.reason)
                continue
            found = messages.numeric_fields(known.types, known.name, samples.get(stream.id, []))
            fields |= dict.fromkeys(found)
            stamped = stamped or messages.stamp_path(known.types, known.name) is not None
        starts = [s.start for s in streams if s.start is not None]
        ends = [s.end for s in streams if s.end is not None]
        start = (min(starts) - self.epoch_ns) / 1e9 if starts else None
        end = (max(ends) - self.epoch_ns) / 1e9 if ends else None
        count = sum(s.count or 0 for s in streams)
        return Topic(name, _types(streams), count, tuple(fields), start, end, stamped, fault=fault)

    def _samples(self) -> dict[int, list[Any]]:
        """The first messages of the streams whose arrays have no fixed length."""
        wanted = {}
        for stream in self._streams:
            try:
                if messages.has_sequences(self._decoder(stream).types):
                    wanted[stream.id] = self._decoder(stream)
            except DamageError:
                continue
        found: dict[int, list[Any]] = {identity: [] for identity in wanted}
        missing = {s.id for s in self._streams if s.id in wanted and s.count}
        for seen, (identity, _, data) in enumerate(self._container.messages(wanted, self._ledger.silent())):
            if len(found[identity]) < _SAMPLES:
                try:
                    found[identity].append(wanted[identity].decode(data))
                except DamageError:
                    continue
                missing.discard(identity)
            if seen >= _SAMPLE_MESSAGES or (not missing and seen >= _SAMPLES * len(wanted)):
                break
        return found

    def _decoder(self, stream: Stream, *, wanted: bool = False) -> messages.Decoder:
        """wanted: its messages are asked for; what is only listed must not cost more than a log is worth."""
        if stream.id not in self._decoders:
            most = messages.MAX_NODES_OF_A_LOG
            if self._nodes > most and not wanted:
                raise DamageError(f"the log's message types have more than {most} fields together")
            self._decoders[stream.id] = messages.decoder(stream, self.distro)
            self._nodes += self._decoders[stream.id].nodes
        return self._decoders[stream.id]

    def series(self, wanted: Mapping[str, Sequence[str]]) -> Mapping[str, Series]:
        """The wanted fields by topic; see RawLog. Rows come in file order."""
        ledger = self._ledger.same()
        columns = {topic: Columns(tuple(dict.fromkeys(fields))) for topic, fields in wanted.items()}
        readings: dict[int, _Reading] = {}
        for topic, kept in columns.items():
            readings |= self._prepare(topic, kept, ledger)
        self._read(readings, ledger)
        return {
            topic: self._series(
                topic, kept, [r for r in readings.values() if r.stream.topic == topic], ledger
            )
            for topic, kept in columns.items()
        }

    def _prepare(self, topic: str, kept: Columns, ledger: Ledger) -> dict[int, _Reading]:
        streams = [s for s in self._streams if s.topic == topic]
        if not streams:
            there = ", ".join(sorted({s.topic for s in self._streams})[:20]) or "none"
            raise UsageError(f"{self.path}: no topic '{one_line(topic)}'; there are: {there}")
        if not kept.names:
            raise UsageError(f"{self.path}: no field of {topic} is given; name one, as pose.position.x")
        readings = {}
        for stream in streams:
            try:
                known = self._decoder(stream, wanted=True)
                rows = _row_maker(known, kept.names, kept.absent)
                readings[stream.id] = _Reading(stream, known.decode_raw, rows, kept.append)
            except DamageError as error:
                ledger.lost(error.reason, "definitions", topic, max(1, stream.count or 0))
            except messages.PathError as error:
                raise UsageError(f"{self.path}: topic {topic}: {error}") from error
        return readings

    def _read(self, readings: Mapping[int, _Reading], ledger: Ledger) -> None:
        """Message by message into the columns; the loop that an import's time goes into."""
        for identity, receive, data in self._container.messages(readings, ledger):
            reading = readings[identity]
            reading.found += 1
            try:
                rows = reading.rows(reading.decode(data, reading.stream.type))
            except Exception as error:
                # rosbags lets a dozen kinds through: SerdeError, MemoryError, TypeError ...
                reading.lost += 1
                where = f"{self._container.where}, message {reading.found}"
                reason = f"not a {reading.stream.type}: {one_line(error, 120)}"
                ledger.lost(reason, where, reading.stream.topic)
                continue
            for row in rows:
                reading.append(receive, row)
        for reading in readings.values():
            announced, found = reading.stream.count, reading.found
            if announced is not None and found < announced:
                where = f"index announces {announced} messages, {found} are there"
                ledger.lost(MISSING, where, reading.stream.topic, announced - found)
            elif announced is not None and found > announced:
                ledger.lost(f"{found} messages where the index announces {announced}", "index", None)

    def _series(self, topic: str, kept: Columns, readings: Sequence[_Reading], ledger: Ledger) -> Series:
        receive, stamps, values = kept.finished()
        known = stamps != NO_STAMP
        header = np.full(len(stamps), np.nan)
        header[known] = self._seconds(stamps[known])
        return Series(
            topic=topic,
            type=_types([s for s in self._streams if s.topic == topic]),
            receive=self._seconds(receive),
            header=header if known.any() else None,
            fields=values,
            read=sum(reading.found - reading.lost for reading in readings),
            dropped=ledger.of(topic),
            absent=dict(kept.absent),
        )

    def _seconds(self, nanoseconds: IntArray) -> FloatArray:
        """Integer nanoseconds to seconds after the epoch; exact to 1 ns within 100 days of it."""
        return np.asarray((nanoseconds - self.epoch_ns) / 1e9, dtype=np.float64)


def _types(streams: Sequence[Stream]) -> str:
    return " | ".join(sorted({one_line(s.type, 80) for s in streams}))


def _epoch(starts: Sequence[int]) -> int:
    """The whole second before the first message; stamps more than a year from the others do not count."""
    starts = [start for start in starts if 0 <= start < LATEST]
    if not starts:
        return 0
    middle = sorted(starts)[len(starts) // 2]
    return min(start for start in starts if abs(start - middle) < _YEAR_NS) // 10**9 * 10**9


def _row_maker(
    decoder: messages.Decoder, wanted: Sequence[str], absent: dict[str, int]
) -> Callable[[Any], Sequence[Row]]:
    """A function from message to rows (values in the order of `wanted`, stamp seconds, stamp nanoseconds).

    Paths that share a selection are found in the same rows, where the others' columns are absent. absent counts, by
    field, the rows whose message has no such element. Raises messages.PathError.
    """
    types = decoder.types
    paths = [messages.parse_path(text, types, decoder.name) for text in wanted]
    selections = list(dict.fromkeys(path.selection for path in paths))
    own = messages.stamp_path(types, decoder.name)
    if selections == [None] and own and all(isinstance(s, str) for p in paths for s in p.steps):
        dotted = [".".join(map(str, p.steps)) for p in paths]  # one call a message
        get = attrgetter(*dotted, f"{'.'.join(own)}.sec", f"{'.'.join(own)}.nanosec")
        return lambda message: (get(message),)
    outer = _stamp(own)

    def rows_of(selection: messages.Selection | None) -> Callable[[Any], Sequence[Row]]:
        getters = [_getter(path, absent, there=path.selection == selection) for path in paths]
        if selection is None:
            return lambda message: ([*(get(message) for get in getters), *outer(message)],)
        inner = messages.stamp_path(types, selection.element)
        stamp, elements = _stamp(inner), attrgetter(".".join(selection.array))
        keys = [(attrgetter(name), value) for name, value in selection.where]
        return lambda message: [
            [*(get(element) for get in getters), *(outer(message) if inner is None else stamp(element))]
            for element in elements(message)
            if all(str(get(element)) == value for get, value in keys)
        ]

    makers = [rows_of(selection) for selection in selections]
    if len(makers) == 1:
        return makers[0]
    return lambda message: [row for maker in makers for row in maker(message)]


def _stamp(path: tuple[str, ...] | None) -> Callable[[Any], tuple[float, float]]:
    if path is None:
        return lambda _: (NAN, NAN)
    get: Callable[[Any], tuple[float, float]] = attrgetter(
        *(f"{'.'.join(path)}.{p}" for p in ("sec", "nanosec"))
    )
    return get


def _getter(path: messages.FieldPath, absent: dict[str, int], *, there: bool) -> Callable[[Any], float]:
    """Follow attributes and indices; an index beyond the array's end, or a name not there, is NaN and counted."""
    if there and all(isinstance(step, str) for step in path.steps):
        return attrgetter(".".join(map(str, path.steps)))
    steps: list[Callable[[Any], Any]] = [
        attrgetter(step)
        if isinstance(step, str)
        else step.beside()
        if isinstance(step, messages.Named)
        else itemgetter(step)
        for step in path.steps
    ]

    def get(value: Any) -> float:
        try:
            if not there:
                raise IndexError
            for step in steps:
                value = step(value)
        except (IndexError, ValueError):  # an array too short, a name that is not there
            absent[path.text] = absent.get(path.text, 0) + 1
            return NAN
        return float(value)

    return get
