"""Read what a mapping wants from a log, find what is damaged, and put every topic on one clock."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np

from gpsim.channels import FloatArray, IntArray
from gpsim.errors import UsageError
from gpsim.recordings import clock
from gpsim.recordings.binding import Bound, bind, groups, wanted_fields
from gpsim.recordings.mapping import EpisodeRule, ImportMapping, with_fields
from gpsim.recordings.raw import NamedLog, RawLog, Series
from gpsim.recordings.tracks import Track, build_track, stamps

BadRows = Mapping[str, IntArray]
Inspector = Callable[[str, Series, ImportMapping], BadRows]
"""Looks for silent damage: (log name, series, mapping) -> rows to leave out, by reason; may refuse."""


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
