"""From a log to tracks: what a mapping wants is bound to topics, read, cut, and put in order on one clock."""

from __future__ import annotations

import itertools
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.ndimage import median_filter

from gpsim.channels import BoolArray, FloatArray, IntArray, wrap_angle
from gpsim.errors import UsageError
from gpsim.recordings import clock
from gpsim.recordings.mapping import ChannelSource, ImportMapping, StampChoice, TimeColumns, track_name
from gpsim.recordings.raw import NamedLog, Series, Topic

MISSING = "value missing"
LASTING = 501  # messages whose median delay is one that lasts
# transforms[child_frame_id=cart].transform...: every element that matches makes a row of its own
_SELECTION = re.compile(r"([\w.]+\[[^\]=]+=[^\]]*\])\.")
BadRows = Mapping[str, IntArray]
Inspector = Callable[[str, Series, ImportMapping], BadRows]
"""Looks for silent damage: (log name, series, mapping) -> rows to leave out, by reason; may refuse."""


@dataclass(frozen=True)
class TopicCount:
    """One topic of one log. read = kept + sum(dropped); noticed: kept, but odd.

    clock: which stamps are used, in words; kept: rows inside an episode (for commands: rows that stood at some moment
    of one). delay: median, 5 % and 95 % of receive minus header [s], None without a header; drift: least and largest of
    its running median [s]. part: the channels that are counted, where not all of the topic are found in the same rows.
    """

    source: str
    topic: str
    type: str
    clock: str
    read: int
    kept: int
    dropped: Mapping[str, int]
    noticed: Mapping[str, int]
    delay: tuple[float, float, float] | None = None
    drift: tuple[float, float] | None = None
    part: str = ""

    @property
    def name(self) -> str:
        """The topic, and which part of it."""
        return track_name(self.topic, self.part)

    def __post_init__(self) -> None:
        if self.read != self.kept + sum(self.dropped.values()):
            raise AssertionError(
                f"{self.source} {self.topic}: {self.read} rows read, but {self.kept} kept and {self.dropped}"
            )


@dataclass(frozen=True)
class Track:
    """Rows of one topic in the order of time. t: (K,) s; fields: (K,) each; count: what became of all its rows."""

    count: TopicCount
    t: FloatArray
    fields: Mapping[str, FloatArray]

    def shifted(self, seconds: float) -> Track:
        """The same track with `seconds` added to its stamps."""
        return replace(self, t=self.t + seconds) if seconds else self


@dataclass(frozen=True)
class Bound(ImportMapping):
    """A mapping whose channels know their topic and part; flag: the field that `episodes` goes by, as a channel."""

    flag: ChannelSource | None = None

    @property
    def roles(self) -> Mapping[str, Sequence[ChannelSource]]:
        """What is read, by what it is for; one role needs all of its fields in one row."""
        flag = () if self.flag is None else (self.flag,)
        return {"state": self.measured, "action": self.action, "flag": flag}

    def changed(self, change: Callable[[ChannelSource, str], ChannelSource]) -> Bound:
        """The same with every source as `change(source, role)` makes it."""
        state = tuple(change(source, "state") for source in self.state)
        action = tuple(change(source, "action") for source in self.action)
        return replace(
            self, state=state, action=action, flag=None if self.flag is None else change(self.flag, "flag")
        )


@dataclass(frozen=True)
class Part:
    """One piece of a log on one unbroken clock, its channels bound to tracks. tracks: by the names of their counts."""

    name: str
    mapping: Bound
    tracks: dict[str, Track]
    epoch: float


@dataclass(frozen=True)
class _Group:
    """Channels of one track that are found in the same rows.

    part: what the rows are called beside the topic; fields: what they hold; missing: rows where some of it is
    absent; is_state: whether state is among it.
    """

    part: str
    fields: tuple[str, ...]
    missing: IntArray
    is_state: bool


def read_parts(named: NamedLog, mapping: ImportMapping, inspect: Inspector) -> list[Part]:
    """Read one log: once, or once a variant; a table whose clock was set back becomes several parts."""
    if not mapping.episodes.variants:
        return _whole_log(named, mapping, inspect)
    parts = []
    for label, fields in mapping.episodes.variants.items():
        state, action = (
            tuple(replace(s, field=fields.get(s.name, s.field)) for s in sources)
            for sources in (mapping.state, mapping.action)
        )
        variant = NamedLog(f"{named.name} [{label}]", named.log)
        parts += _whole_log(variant, replace(mapping, state=state, action=action), inspect)
    return parts


def _whole_log(named: NamedLog, mapping: ImportMapping, inspect: Inspector) -> list[Part]:
    whole = _bind(named.name, mapping, {topic.name: topic for topic in named.log.topics()})
    log_epoch = 1e-9 * named.log.epoch_ns
    read: dict[str, Series] = {}
    for reading in _wanted_fields(whole):
        series = named.log.series({topic: fields for topic, (_, fields) in reading.items()})
        read |= {track: series[topic] for topic, (track, _) in reading.items()}
    pieces, parts = _unbroken(named.name, read, whole, log_epoch), []
    for number, piece in enumerate(pieces):
        name = named.name if len(pieces) == 1 else f"{named.name} [{number + 1}]"
        bound, tracks = whole, dict[str, Track]()
        for key, one in piece.items():  # one track, or several where not all channels are in the same rows
            bad = inspect(name, one, bound)
            bound, groups = _groups(key, one, bound)
            for group in groups:
                track = _build_track(one, group, bad, bound, name, log_epoch)
                tracks[track.count.name] = track
        first = [float(track.t[0]) for track in tracks.values() if len(track.t)]
        epoch = float(np.floor(min(first))) if first else 0.0
        tracks = {key: track.shifted(-epoch) for key, track in tracks.items()}
        parts.append(Part(name, bound, tracks, log_epoch + epoch))
    return parts


def _bind(name: str, mapping: ImportMapping, topics: Mapping[str, Topic]) -> Bound:
    """Bind unnamed topics to the only one there is, and channels to the part of a topic that selects their element.

    name: of the log. Raises UsageError where a topic is not there, not named, or a channel's column holds text.
    """
    only = next(iter(topics)) if len(topics) == 1 else None
    rule = mapping.episodes
    bound = Bound(**vars(mapping))
    if rule.column is not None:
        bound = replace(bound, flag=ChannelSource(rule.column, "", topic=rule.topic, field=rule.column))
    bound = bound.changed(lambda source, _: replace(source, topic=source.topic or only))
    sources = [source for role in bound.roles.values() for source in role]
    if any(source.topic is None for source in sources):
        raise UsageError("mapping: the log has several topics, so every channel must name its topic")
    selections: dict[str, dict[str, None]] = {}
    for source in sources:
        name_of = source.topic or ""
        if name_of not in topics:
            raise UsageError(f"{name}: no topic '{name_of}'; there are: {', '.join(topics) or 'none'}")
        topic = topics[name_of]
        for field in source.fields:
            if field in topic.texts and not (rule.by == "column" and field == rule.field):
                raise UsageError(
                    f"{name}: column '{field}' holds text, which only episodes.by=column can use; "
                    f"numeric columns are: {', '.join(topic.fields[:20]) or 'none'}"
                )
        selections.setdefault(name_of, {})[_selection(source)] = None
    several = {topic for topic, found in selections.items() if len(found) > 1}
    # Rows of one selection hold nothing of another: where a topic has several, each is a part.
    return bound.changed(lambda s, _: replace(s, part=_selection(s)) if s.topic in several else s)


def _selection(source: ChannelSource) -> str:
    """The element that the channel's fields are of, as `transforms[child_frame_id=cart]`; empty without one."""
    found = _SELECTION.match(source.fields[0]) if source.fields else None
    return "" if found is None else found[1]


def _wanted_fields(bound: Bound) -> list[dict[str, tuple[str, list[str]]]]:
    """What to read: topic -> (track, fields). Several readings where a topic has several selections.

    A reading makes one row for each element that its fields select, so fields of two selections in one reading would
    leave every row half empty, and nobody could tell an empty row from a damaged one.
    """
    fields: dict[str, dict[str, list[str]]] = {}
    for sources in bound.roles.values():
        for source in sources:
            of_track = fields.setdefault(source.topic or "", {}).setdefault(source.track, [])
            of_track += [field for field in source.fields if field not in of_track]
    if bound.time is not None:
        for tracks in fields.values():
            for of_track in tracks.values():
                of_track += [field for field in bound.time.fields if field not in of_track]
    readings = max((len(tracks) for tracks in fields.values()), default=0)
    return [
        {topic: list(tracks.items())[number] for topic, tracks in fields.items() if number < len(tracks)}
        for number in range(readings)
    ]


def _groups(track: str, series: Series, bound: Bound) -> tuple[Bound, list[_Group]]:
    """Part a track whose state, action and flag are not missing in the same rows.

    An empty state must not take the command of its row with it, nor the other way round. Where all are found in the
    same rows they stay together, under the track's own name.
    """
    clock = () if bound.time is None else bound.time.fields
    together: dict[bytes, tuple[BoolArray, dict[str, list[ChannelSource]]]] = {}
    for role, every in bound.roles.items():
        own = [source for source in every if source.track == track]
        if own:  # rows that hold nothing where something was asked for, and are known to be so
            missing = np.zeros(len(series.receive), dtype=np.bool_)
            for field in (*(field for source in own for field in source.fields), *clock):
                if series.absent.get(field):
                    missing |= np.isnan(series.fields[field])
            together.setdefault(missing.tobytes(), (missing, {}))[1][role] = own
    found: list[_Group] = []
    parts: dict[str, str] = {}
    for missing, roles in together.values():
        first = next(iter(roles.values()))[0]
        part = first.part if len(together) == 1 else ", ".join([*filter(None, [first.part]), *roles])
        parts |= dict.fromkeys(roles, part)
        held = [field for sources in roles.values() for source in sources for field in source.fields]
        fields = tuple(dict.fromkeys([*held, *clock]))
        found.append(_Group(part, fields, np.flatnonzero(missing), "state" in roles))

    def moved(source: ChannelSource, role: str) -> ChannelSource:
        return replace(source, part=parts[role]) if source.track == track and role in parts else source

    return bound.changed(moved), found


def finds_all(mapping: ImportMapping, topics: Sequence[Topic]) -> bool:
    """Whether every topic and field that the mapping names is there; channels without a topic want a single one."""
    only = topics[0].name if len(topics) == 1 else None
    held = {topic.name: {*topic.fields, *topic.texts} for topic in topics if not topic.fault}
    wanted = [
        (source.topic or only, source.fields) for source in (*mapping.state, *mapping.action) if source.fields
    ]
    if mapping.episodes.column is not None:
        wanted.append((mapping.episodes.topic or only, (mapping.episodes.column,)))
    for fields in mapping.episodes.variants.values():
        wanted += [(only, (field,)) for field in fields.values()]
    if mapping.time is not None:
        wanted += [(topic, mapping.time.fields) for topic, _ in tuple(wanted)]
    return all(topic in held and held[topic].issuperset(fields) for topic, fields in wanted)


def _unbroken(
    name: str, series: Mapping[str, Series], mapping: ImportMapping, epoch: float
) -> list[Mapping[str, Series]]:
    """Cut a single table where its clock was set back; with several topics nobody can tell what is whose."""
    rule = mapping.episodes
    for track, one in series.items():
        choice = mapping.clock.topics.get(one.topic, mapping.clock.stamps)
        t, _ = stamps(one, mapping.time, choice, name, epoch)
        finite = np.flatnonzero(np.isfinite(t))
        sound = np.delete(finite, clock.jumping(t[finite], mapping.checks.jump))
        if np.isfinite(one.receive[sound]).all():
            # A log that was read twice in part is no clock set back; rows of a table have no arrival to tell copies by.
            table = np.stack([one.receive[sound], *(values[sound] for values in one.fields.values())], axis=1)
            sound = sound[np.sort(np.unique(table, axis=0, return_index=True)[1])]
        if mapping.time is not None:
            _refuse_descending(name, one.topic, t, sound)
        cuts = {*sound[clock.restarts(t[sound])].tolist()}
        if rule.by == "column" and rule.field is not None and rule.field in one.fields:
            # Another episode begins, and the clock begins anew: however short they are.
            with np.errstate(invalid="ignore"):
                begins = (np.diff(one.fields[rule.field]) != 0) & (np.diff(t) < 0)
            cuts |= {*(np.flatnonzero(begins) + 1).tolist()}
        if not cuts:
            continue
        if len(series) > 1:
            raise UsageError(
                f"{name}: the clock of {one.topic} was set back at row {min(cuts)}; choose another clock with "
                "clock.topics, or split the log there"
            )
        edges = [0, *sorted(cuts), len(t)]
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


def stamps(
    series: Series, time: TimeColumns | None, choice: StampChoice, where: str, epoch: float = 0.0
) -> tuple[FloatArray, str]:
    """The stamps (N,) s of every row and the clock they are of, in words; epoch: the log's, in s."""
    count = len(series.receive)
    if time is not None:
        if time.step is not None:
            return time.step * np.arange(count, dtype=np.float64), f"every {time.step:g} s"
        if time.seconds is not None:
            parts = time.seconds + (f" + {time.nanoseconds}" if time.nanoseconds else "")
            fine = series.fields[time.nanoseconds] * 1e-9 if time.nanoseconds else 0.0
            return series.fields[time.seconds] + fine, f"column {parts}"
        return time.scale * series.fields[str(time.field)], f"column {time.field}"
    if series.header is None and count and not np.any(np.isfinite(series.receive)):
        raise UsageError(f"{where}: a table has no clock; name its time column, as time.field=t")
    unset = _never_set(series, epoch)
    if choice == "header" and unset:
        why = "has no header" if series.header is None else "never sets its header stamp"
        raise UsageError(f"{where}: {series.topic} {why}; use clock.topics with {series.topic}: receive")
    if series.header is None or choice == "receive" or unset:
        return (
            series.receive,
            "receive (header never set)" if series.header is not None and unset else "receive",
        )
    return series.header, "header"


def _never_set(series: Series, epoch: float) -> bool:
    """Whether the messages have no stamp of their own, or one that is 0 in all of them."""
    return series.header is None or not np.any(series.header + epoch > 1e-6)


def _build_track(
    series: Series, group: _Group, bad: BadRows, mapping: ImportMapping, where: str, epoch: float
) -> Track:
    """Choose the stamps, leave out the rows that lack the group's fields and the `bad` ones, put the rest in order."""
    if mapping.time is not None and mapping.time.step is not None and series.dropped:
        raise UsageError(
            f"{where}: {series.topic}: rows are missing of a table whose time is told by counting them; "
            "name a column that tells the time"
        )
    choice = mapping.clock.topics.get(series.topic, mapping.clock.stamps)
    t, on = stamps(series, mapping.time, choice, where, epoch)
    keep = np.ones(len(t), dtype=np.bool_)
    dropped = dict(series.dropped)
    no_stamp = np.flatnonzero(~np.isfinite(t))
    for reason, rows in ((MISSING, group.missing), *bad.items(), ("stamp not finite", no_stamp)):
        fresh = rows[keep[rows]]  # a row is counted under its first fault only
        keep[fresh] = False
        if len(fresh):
            dropped[reason] = dropped.get(reason, 0) + len(fresh)
    rows = np.flatnonzero(keep)
    values = np.zeros((len(rows), 0))
    if group.fields:
        values = np.stack([series.fields[name][rows] for name in group.fields], axis=1)
    on_receive = group.is_state and on.startswith("receive")
    ordered = clock.in_order(t[rows], values, mapping.checks.jump, newest_of_burst=on_receive)
    delay, drift = None, None
    if series.header is not None and not _never_set(series, epoch):
        late = series.receive - series.header
        late = late[np.isfinite(late)]
        low, middle, high = np.percentile(late, [5, 50, 95]) if len(late) else (0.0, 0.0, 0.0)
        delay = float(middle), float(low), float(high)
        if (
            len(late) >= 10
        ):  # what lasts: a median over a tenth of the log forgets what jitters or stands alone
            size = int(np.clip(len(late) // 10, 5, LASTING))
            running = median_filter(late, size=size, mode="reflect")
            drift = float(running.min()), float(running.max())
    count = TopicCount(
        where,
        series.topic,
        series.type,
        on,
        read=len(t) + sum(series.dropped.values()),
        kept=len(ordered.t),
        dropped=dropped | dict(ordered.dropped),
        noticed=ordered.noticed,
        delay=delay,
        drift=drift,
        part=group.part,
    )
    fields = {name: values[ordered.rows, i] for i, name in enumerate(group.fields)}
    return Track(count, ordered.t + mapping.clock.offsets.get(series.topic, 0.0), fields)


def samples(source: ChannelSource, track: Track, rows: IntArray | slice = slice(None)) -> FloatArray:
    """The channel at the track's own stamps; angles from quaternions come continuous, not wrapped."""
    if source.quaternion is not None:
        raw = np.unwrap(clock.euler_angle(_quaternion(source, track)[rows], source.angle))
    else:
        raw = track.fields[str(source.field)][rows]
    value = source.sign * source.scale * raw + source.offset
    return np.unwrap(value) if source.wraps else value


def at_times(source: ChannelSource, track: Track, at: FloatArray) -> FloatArray:
    """The channel interpolated at times inside the track: linear, on the circle, or slerp for quaternions."""
    if source.quaternion is not None:
        turned = clock.slerp(at, track.t, _quaternion(source, track))
        raw = np.unwrap(clock.euler_angle(turned, source.angle))
        value = source.sign * source.scale * raw + source.offset
    else:
        value = np.interp(at, track.t, samples(source, track))
    return wrap_angle(value) if source.wraps else value


def _quaternion(source: ChannelSource, track: Track) -> FloatArray:
    return np.stack([track.fields[name] for name in source.fields], axis=1)
