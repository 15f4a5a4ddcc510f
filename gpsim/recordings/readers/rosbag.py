"""Bags of ROS 1 and ROS 2 as a raw log: rosbags parses the definitions and decodes, the containers only fetch bytes."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from gpsim.errors import UsageError
from gpsim.limits import TOPICS, allowed, more
from gpsim.recordings.raw import Series, Topic
from gpsim.recordings.readers.damage import DamageError, Ledger, one_line
from gpsim.recordings.readers.definitions import DISTROS, MAX_NODES_OF_A_LOG, Decoder, decoder
from gpsim.recordings.readers.extract import NO_STAMP, Columns, Row, Rows, row_maker, seconds
from gpsim.recordings.readers.fields import PathError, has_sequences, numeric_fields, stamp_path
from gpsim.recordings.readers.source import LATEST, Container, Stream

DEFAULT_DISTRO = "humble"
_SAMPLES = 100
_SAMPLE_MESSAGES = 5_000
_YEAR_NS = 366 * 86_400 * 10**9
MISSING = "announced by the index, not found"


@dataclass(slots=True)
class _Reading:
    """How one stream's messages become rows, and how many came."""

    stream: Stream
    decode: Callable[[bytes, str], object]
    rows: Rows
    append: Callable[[int, Row], None]
    found: int = 0
    lost: int = 0


class BagLog:
    """A bag. Times are seconds after `epoch_ns`, the whole second before its first message (nanoseconds survive)."""

    def __init__(self, path: Path, container: Container, *, salvage: bool, distro: str | None) -> None:
        self.path = path
        self._container = container
        self._ledger = Ledger(path, salvage=salvage)
        self._streams = tuple(container.streams(self._ledger))
        if len(self._streams) > allowed(TOPICS):
            raise UsageError(
                f"{path}: it has {len(self._streams)} topics, the limit is {allowed(TOPICS)}; "
                f"{more(len(self._streams), TOPICS)}"
            )
        said = container.distro if container.distro in DISTROS else None
        self.distro = distro or said or DEFAULT_DISTRO
        self._decoders: dict[int, Decoder] = {}
        self._nodes = 0
        self.epoch_ns = _epoch([s.start for s in self._streams if s.start is not None])

    @property
    def losses(self) -> Mapping[str, int]:
        """Pieces of the file that could not be read (salvage only), by reason; messages are in Series.dropped."""
        return self._ledger.pieces()

    def topics(self) -> Sequence[Topic]:
        """What is inside, from the index; arrays are listed as long as in the first messages."""
        samples = self._samples()
        names = sorted({stream.topic for stream in self._streams})
        return tuple(self._topic(name, samples) for name in names)

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
            fields |= dict.fromkeys(numeric_fields(known.types, known.name, samples.get(stream.id, [])))
            stamped = stamped or stamp_path(known.types, known.name) is not None
        starts = [s.start for s in streams if s.start is not None]
        ends = [s.end for s in streams if s.end is not None]
        return Topic(
            name=name,
            type=_types(streams),
            count=sum(s.count or 0 for s in streams),
            fields=tuple(fields),
            start=(min(starts) - self.epoch_ns) / 1e9 if starts else None,
            end=(max(ends) - self.epoch_ns) / 1e9 if ends else None,
            has_header=stamped,
            fault=fault,
        )

    def _samples(self) -> dict[int, list[Any]]:
        """The first messages of the streams whose arrays have no fixed length."""
        wanted = {}
        for stream in self._streams:
            try:
                if has_sequences(self._decoder(stream).types):
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

    def _decoder(self, stream: Stream, *, wanted: bool = False) -> Decoder:
        """wanted: its messages are asked for; what is only listed must not cost more than a log is worth."""
        if stream.id not in self._decoders:
            if self._nodes > MAX_NODES_OF_A_LOG and not wanted:
                raise DamageError(
                    f"the log's message types have more than {MAX_NODES_OF_A_LOG} fields together"
                )
            self._decoders[stream.id] = decoder(stream, self.distro)
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
        read = dict.fromkeys(columns, 0)
        for reading in readings.values():
            read[reading.stream.topic] += reading.found - reading.lost
        return {topic: self._series(topic, kept, read[topic], ledger) for topic, kept in columns.items()}

    def _prepare(self, topic: str, kept: Columns, ledger: Ledger) -> dict[int, _Reading]:
        streams = [s for s in self._streams if s.topic == topic]
        if not streams:
            there = ", ".join(sorted({s.topic for s in self._streams})[:20]) or "none"
            raise UsageError(f"{self.path}: no topic '{one_line(topic)}'; there are: {there}")
        if not kept.names:
            raise UsageError(f"{self.path}: no field of {topic} is asked for; name one, as pose.position.x")
        readings = {}
        for stream in streams:
            try:
                known = self._decoder(stream, wanted=True)
                rows = row_maker(known, kept.names, kept.absent)
                readings[stream.id] = _Reading(stream, known.decode_raw, rows, kept.append)
            except DamageError as error:
                ledger.lost(error.reason, "definitions", topic, max(1, stream.count or 0))
            except PathError as error:
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
            if reading.stream.count is not None and reading.found != reading.stream.count:
                self._compare(reading.stream, reading.found, ledger)

    def _compare(self, stream: Stream, found: int, ledger: Ledger) -> None:
        announced = stream.count or 0
        if found < announced:
            where = f"index announces {announced} messages, {found} are there"
            ledger.lost(MISSING, where, stream.topic, announced - found)
        else:
            ledger.lost(f"{found} messages where the index announces {announced}", "index", None)

    def _series(self, topic: str, kept: Columns, read: int, ledger: Ledger) -> Series:
        receive, stamps, values = kept.receive_ns(), kept.stamp_ns(), kept.values()
        known = stamps != NO_STAMP
        header = np.full(len(stamps), np.nan)
        header[known] = seconds(stamps[known], self.epoch_ns)
        return Series(
            topic=topic,
            type=_types([s for s in self._streams if s.topic == topic]),
            receive=seconds(receive, self.epoch_ns),
            header=header if known.any() else None,
            fields=values,
            read=read,
            dropped=ledger.of(topic),
            absent=dict(kept.absent),
        )


def _types(streams: Sequence[Stream]) -> str:
    return " | ".join(sorted({one_line(s.type, 80) for s in streams}))


def _epoch(starts: Sequence[int]) -> int:
    """The whole second before the first message; stamps more than a year from the others do not count."""
    starts = [start for start in starts if 0 <= start < LATEST]
    if not starts:
        return 0
    middle = sorted(starts)[len(starts) // 2]
    first = min(start for start in starts if abs(start - middle) < _YEAR_NS)
    return first // 10**9 * 10**9
