"""Tracks: the wanted rows of a topic, sound and on one clock, and the channel values they hold."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from gpsim.channels import FloatArray, IntArray, wrap_angle
from gpsim.errors import UsageError
from gpsim.recordings import resample
from gpsim.recordings.clock import in_order
from gpsim.recordings.mapping import ChannelSource, ImportMapping, StampChoice, TimeColumns
from gpsim.recordings.raw import Series


@dataclass(frozen=True)
class Track:
    """Rows of one topic in the order of time. t: (K,) s; fields: (K,) each; read: rows before any drop.

    clock: which stamps t holds, in words; delay: median, 5 % and 95 % of receive minus header [s].
    """

    topic: str
    type: str
    clock: str
    t: FloatArray
    fields: Mapping[str, FloatArray]
    read: int
    dropped: Mapping[str, int]
    noticed: Mapping[str, int]
    delay: tuple[float, float, float] | None = None

    def shifted(self, seconds: float) -> Track:
        """The same track with `seconds` added to its stamps."""
        return replace(self, t=self.t + seconds) if seconds else self


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
        assert time.field is not None
        return time.scale * series.fields[time.field], f"column {time.field}"
    if series.header is None and count and not np.any(np.isfinite(series.receive)):
        raise UsageError(f"{where}: a table has no clock; name its time column, as time.field=t")
    unset = _never_set(series, epoch)
    if choice == "header" and unset:
        why = "has no header" if series.header is None else "never sets its header stamp"
        raise UsageError(f"{where}: {series.topic} {why}; use clock.topics with {series.topic}: receive")
    if choice == "receive" or unset:
        return (
            series.receive,
            "receive" if series.header is None or not unset else "receive (header never set)",
        )
    assert series.header is not None
    return series.header, "header"


def build_track(
    series: Series,
    bad: Mapping[str, IntArray],
    mapping: ImportMapping,
    is_state: bool,
    where: str,
    epoch: float = 0.0,
) -> Track:
    """Choose the stamps, leave out the `bad` rows (by reason), put the rest in order.

    Raises UsageError when nothing is left or a chosen clock does not exist.
    """
    if mapping.time is not None and mapping.time.step is not None and series.dropped:
        raise UsageError(
            f"{where}: {series.topic}: rows are missing of a table whose time is told by counting them; "
            "name a column that tells the time"
        )
    choice = mapping.clock.topics.get(series.topic, mapping.clock.stamps)
    t, clock = stamps(series, mapping.time, choice, where, epoch)
    keep = np.ones(len(t), dtype=np.bool_)
    dropped = dict(series.dropped)
    for reason, rows in (*bad.items(), ("stamp not finite", np.flatnonzero(~np.isfinite(t)))):
        fresh = rows[keep[rows]]  # a row is counted under its first fault only
        keep[fresh] = False
        if len(fresh):
            dropped[reason] = dropped.get(reason, 0) + len(fresh)
    rows = np.flatnonzero(keep)
    names = list(series.fields)
    values = (
        np.stack([series.fields[name][rows] for name in names], axis=1) if names else np.zeros((len(rows), 0))
    )
    on_receive = is_state and clock.startswith("receive")
    ordered = in_order(t[rows], values, mapping.checks.jump, newest_of_burst=on_receive)
    return Track(
        topic=series.topic,
        type=series.type,
        clock=clock,
        t=ordered.t + mapping.clock.offsets.get(series.topic, 0.0),
        fields={name: values[ordered.rows, i] for i, name in enumerate(names)},
        read=len(t) + sum(series.dropped.values()),
        dropped=dropped | dict(ordered.dropped),
        noticed=ordered.noticed,
        delay=_delay(series, epoch),
    )


def _never_set(series: Series, epoch: float) -> bool:
    """Whether the messages have no stamp of their own, or one that is 0 in all of them."""
    return series.header is None or not np.any(series.header + epoch > 1e-6)


def _delay(series: Series, epoch: float) -> tuple[float, float, float] | None:
    if series.header is None or _never_set(series, epoch):
        return None
    late = series.receive - series.header
    late = late[np.isfinite(late)]
    low, middle, high = np.percentile(late, [5, 50, 95]) if len(late) else (0.0, 0.0, 0.0)
    return float(middle), float(low), float(high)


def samples(source: ChannelSource, track: Track, rows: IntArray | slice = slice(None)) -> FloatArray:
    """The channel at the track's own stamps; angles from quaternions come continuous, not wrapped."""
    if source.quaternion is not None:
        raw = resample.unwrapped(resample.euler_angle(_quaternion(source, track)[rows], source.angle))
    else:
        assert source.field is not None
        raw = track.fields[source.field][rows]
    value = source.sign * source.scale * raw + source.offset
    return resample.unwrapped(value) if source.channel.wraps else value


def at_times(source: ChannelSource, track: Track, at: FloatArray) -> FloatArray:
    """The channel interpolated at times inside the track: linear, on the circle, or slerp for quaternions."""
    if source.quaternion is not None:
        turned = resample.slerp(at, track.t, _quaternion(source, track))
        raw = resample.unwrapped(resample.euler_angle(turned, source.angle))
        value = source.sign * source.scale * raw + source.offset
    else:
        value = resample.linear(at, track.t, samples(source, track))
    return wrap_angle(value) if source.channel.wraps else value


def _quaternion(source: ChannelSource, track: Track) -> FloatArray:
    return np.stack([track.fields[name] for name in source.fields], axis=1)


def fields_by_topic(
    sources: Sequence[ChannelSource], extra: Sequence[tuple[str | None, Sequence[str]]], only: str | None
) -> dict[str, list[str]]:
    """Which fields of which topic to read. extra: (topic, fields); `only` stands in for an unnamed topic."""
    wanted: dict[str, list[str]] = {}
    for topic, names in (*((s.topic, s.fields) for s in sources if s.derivative_of is None), *extra):
        name = topic if topic is not None else only
        if name is None:
            raise UsageError("mapping: the log has several topics, so every channel must name its topic")
        wanted.setdefault(name, [])
        wanted[name] += [f for f in names if f not in wanted[name]]
    return wanted
