"""Tracks: the wanted rows of a topic, sound and on one clock, and the channel values they hold."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from scipy.ndimage import median_filter

from gpsim.channels import FloatArray, IntArray, wrap_angle
from gpsim.errors import UsageError
from gpsim.recordings import clock
from gpsim.recordings.binding import Group
from gpsim.recordings.clock import in_order
from gpsim.recordings.mapping import ChannelSource, ImportMapping, StampChoice, TimeColumns, track_name
from gpsim.recordings.raw import Series

MISSING = "value missing"
LASTING = 501  # messages whose median delay is one that lasts


@dataclass(frozen=True)
class Track:
    """Rows of one topic in the order of time. t: (K,) s; fields: (K,) each; read: rows before any drop.

    part: which rows, where not all hold the same channels; clock: which stamps t holds, in words; delay: median, 5 %
    and 95 % of receive minus header [s]; drift: least and largest of its running median [s].
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
    drift: tuple[float, float] | None = None
    part: str = ""

    @property
    def name(self) -> str:
        """What the track is called: its topic, and which part of it."""
        return track_name(self.topic, self.part)

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
    group: Group,
    bad: Mapping[str, IntArray],
    mapping: ImportMapping,
    where: str,
    epoch: float = 0.0,
) -> Track:
    """Choose the stamps, leave out the rows that lack the group's fields and the `bad` ones, put the rest in order.

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
    no_stamp = np.flatnonzero(~np.isfinite(t))
    for reason, rows in ((MISSING, group.missing), *bad.items(), ("stamp not finite", no_stamp)):
        fresh = rows[keep[rows]]  # a row is counted under its first fault only
        keep[fresh] = False
        if len(fresh):
            dropped[reason] = dropped.get(reason, 0) + len(fresh)
    rows = np.flatnonzero(keep)
    names = group.fields
    values = (
        np.stack([series.fields[name][rows] for name in names], axis=1) if names else np.zeros((len(rows), 0))
    )
    on_receive = group.is_state and clock.startswith("receive")
    ordered = in_order(t[rows], values, mapping.checks.jump, newest_of_burst=on_receive)
    late = _late(series, epoch)
    return Track(
        topic=series.topic,
        type=series.type,
        clock=clock,
        t=ordered.t + mapping.clock.offsets.get(series.topic, 0.0),
        fields={name: values[ordered.rows, i] for i, name in enumerate(names)},
        read=len(t) + sum(series.dropped.values()),
        dropped=dropped | dict(ordered.dropped),
        noticed=ordered.noticed,
        delay=_delay(late),
        drift=_drift(late),
        part=group.part,
    )


def _never_set(series: Series, epoch: float) -> bool:
    """Whether the messages have no stamp of their own, or one that is 0 in all of them."""
    return series.header is None or not np.any(series.header + epoch > 1e-6)


def _late(series: Series, epoch: float) -> FloatArray | None:
    """How much later than its stamp each message was received [s]; None without stamps."""
    if series.header is None or _never_set(series, epoch):
        return None
    late = series.receive - series.header
    return late[np.isfinite(late)]


def _delay(late: FloatArray | None) -> tuple[float, float, float] | None:
    if late is None:
        return None
    low, middle, high = np.percentile(late, [5, 50, 95]) if len(late) else (0.0, 0.0, 0.0)
    return float(middle), float(low), float(high)


def _drift(late: FloatArray | None) -> tuple[float, float] | None:
    """Least and largest delay that lasted: a median over a tenth of the log forgets what jitters or stands alone."""
    if late is None or len(late) < 10:
        return None
    running = median_filter(late, size=int(np.clip(len(late) // 10, 5, LASTING)), mode="reflect")
    return float(running.min()), float(running.max())


def samples(source: ChannelSource, track: Track, rows: IntArray | slice = slice(None)) -> FloatArray:
    """The channel at the track's own stamps; angles from quaternions come continuous, not wrapped."""
    if source.quaternion is not None:
        raw = clock.unwrapped(clock.euler_angle(_quaternion(source, track)[rows], source.angle))
    else:
        assert source.field is not None
        raw = track.fields[source.field][rows]
    value = source.sign * source.scale * raw + source.offset
    return clock.unwrapped(value) if source.wraps else value


def at_times(source: ChannelSource, track: Track, at: FloatArray) -> FloatArray:
    """The channel interpolated at times inside the track: linear, on the circle, or slerp for quaternions."""
    if source.quaternion is not None:
        turned = clock.slerp(at, track.t, _quaternion(source, track))
        raw = clock.unwrapped(clock.euler_angle(turned, source.angle))
        value = source.sign * source.scale * raw + source.offset
    else:
        value = clock.linear(at, track.t, samples(source, track))
    return wrap_angle(value) if source.wraps else value


def _quaternion(source: ChannelSource, track: Track) -> FloatArray:
    return np.stack([track.fields[name] for name in source.fields], axis=1)
