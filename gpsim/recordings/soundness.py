"""Silent damage: rows that were read without complaint and cannot be true are refused, or left out and counted.

Flipped bytes that still decode are looked for by what cannot be true; the limits are wide, so that sound recordings
have no findings, and small flips in a mantissa stay unseen. Angles that wrap and are not said to: a step of a whole
turn from one row to the next.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

import numpy as np
from scipy.ndimage import median_filter

from gpsim.channels import BoolArray, FloatArray, IntArray
from gpsim.errors import UsageError
from gpsim.recordings import clock
from gpsim.recordings import episodes as where
from gpsim.recordings.assembling import Assembled
from gpsim.recordings.clock import TOLERANCE
from gpsim.recordings.mapping import ChannelSource, ImportMapping
from gpsim.recordings.raw import Series
from gpsim.recordings.tracks import Part, samples, stamps

TOO_FAST = "faster than checks.max_rate"
GOES_BACK = "time goes back"
LARGEST, SMALLEST = 1e12, 1e-100  # believable nonzero magnitudes in any SI unit
DELAY = 60.0  # s that a message's delay may lie from the median of those around it (a clock of another pace is sound)
AROUND = 501  # messages among which one that is late stands out
_POSE = ("position", "orientation", "translation", "rotation")
_STAMP_PARTS = ("sec", "nanosec", "seq")
Suspect = tuple[str, str | None, BoolArray, str]
"""(reason, field, rows that cannot be true (N,), what is wrong with them)."""


def find_bad_rows(
    name: str, series: Series, mapping: ImportMapping, *, salvage: bool = False
) -> Mapping[str, IntArray]:
    """Rows of a topic that must not be used, by reason; they count from 0 in file order.

    Empty cells of a table and array elements that a message does not have are missing, not damaged, and none of
    this module's affair. Numbers that are not finite or absurd, quaternions that are no rotations, samples that leave
    their neighbours and come back, stamps far from their arrival, and changes faster than `checks.max_rate` are damage:
    UsageError (log, topic, row, field, what, remedy), or with `salvage` left out and counted. A stamp that leaps is the
    clock's affair: `clock.in_order` drops and counts it, salvage or not.
    """
    out: dict[str, IntArray] = {}

    def note(reason: str, rows: IntArray, said: str) -> None:
        if not salvage:
            raise UsageError(f"{name}: {said}--salvage leaves such rows out and counts them")
        out[reason] = np.union1d(out[reason], rows) if reason in out else rows

    for reason, field, bad, what in (*_values(series, mapping), *_late(series)):
        rows = np.flatnonzero(bad)
        if len(rows):
            place = f"{series.topic}, row {rows[0]}" + ("" if field is None else f", field {field}")
            note(reason, rows, f"{place}: {what} ({len(rows)} of {len(bad)} rows); ")
    back = _going_back(series, mapping)
    if len(back):
        t, place = _clock(series, mapping), f"{series.topic}, row {int(back[0])}"
        early = f"{t[back[0]]:.6g} s behind {np.nanmax(t[: back[0]]):.6g} s"
        said = f"{place}: time goes back, to {early} ({len(back)} such rows); sort the table by its time, or "
        note(GOES_BACK, back, said)
    fast = _too_fast(series, mapping, out)
    if len(fast):
        share = f"{len(fast)} of {len(series.receive)} rows"
        note(TOO_FAST, fast, f"{series.topic}, row {int(fast[0])}: changes {TOO_FAST} ({share}); ")
    return out


def _values(series: Series, mapping: ImportMapping) -> Iterator[Suspect]:
    clocks = mapping.time.fields if mapping.time is not None else ()
    periods = {  # what one turn is in fields of angles
        source.field: 2.0 * np.pi / abs(source.scale)
        for source in (*mapping.state, *mapping.action)
        if source.wraps and source.field is not None and source.scale
    }
    quaternions = {
        tuple(parts): np.stack([series.fields[p] for p in parts]) for parts in _quaternion_parts(series)
    }
    turned: dict[str, FloatArray] = {}  # with one sign throughout: q and -q are the same rotation
    for parts, values in quaternions.items():
        with np.errstate(over="ignore", invalid="ignore"):
            agree = np.sum(values[:, 1:] * values[:, :-1], axis=0)
        sign = np.cumprod(np.concatenate([[1.0], np.where(agree < 0, -1.0, 1.0)]))
        turned |= dict(zip(parts, sign * values, strict=True))
    for name, values in series.fields.items():
        missing = np.isnan(values) & (series.absent.get(name, 0) > 0)
        yield "not finite", name, ~np.isfinite(values) & ~missing, "the value is no finite number"
        size = np.abs(np.where(np.isfinite(values), values, 0.0))
        if name not in clocks:
            strange = (size > LARGEST) | ((size > 0) & (size < SMALLEST))
            yield "absurd magnitude", name, strange, "no sensor or command has this magnitude"
        if any(part in _POSE for part in name.split(".")) and name.split(".")[-1] not in _STAMP_PARTS:
            steady = turned.get(name, values)
            if name in periods:
                steady = np.unwrap(steady, period=periods[name])
            yield "jump", name, _jumps(steady, mapping.checks.outlier), "leaves its neighbours and comes back"
    for parts, values in quaternions.items():
        with np.errstate(over="ignore", invalid="ignore"):
            norm = np.sqrt(np.sum(values**2, axis=0))
        off = np.isfinite(values).all(axis=0) & ~(np.abs(norm - 1.0) <= mapping.checks.quaternion)
        yield "no rotation", parts[-1][:-2], off, "the quaternion's norm is not 1"


def _quaternion_parts(series: Series) -> list[list[str]]:
    found = [[f"{name[:-1]}{axis}" for axis in "xyzw"] for name in series.fields if name.endswith(".w")]
    return [parts for parts in found if all(part in series.fields for part in parts)]


def _jumps(values: FloatArray, factor: float) -> BoolArray:
    """(N,) samples that stand alone: `factor` times the 95th percentile of the usual unevenness from their neighbours.

    Uneven is what a sample differs from the mean of its two neighbours.
    """
    alone = np.zeros(len(values), dtype=np.bool_)
    with np.errstate(over="ignore", invalid="ignore"):
        uneven = np.abs(values[1:-1] - 0.5 * (values[:-2] + values[2:]))
        apart = np.abs(values[2:] - values[:-2])
    known = np.isfinite(uneven)
    if known.sum() < 20:
        return alone
    usual = float(np.quantile(uneven[known], 0.95))
    if usual > 0.0:
        # A sample beside the lone one is uneven too; the lone one is where the neighbours agree with each other.
        alone[1:-1] = known & (uneven > factor * usual) & (apart < 0.2 * uneven)
    return alone


def _late(series: Series) -> Iterator[Suspect]:
    if series.header is None:
        return
    delay = series.receive - series.header
    known = np.isfinite(delay)
    if known.any() and np.ptp(series.header[known]) > 0:  # a stamp that is never set is no clock
        far = np.zeros(len(delay), dtype=np.bool_)
        usual = median_filter(delay[known], AROUND, mode="nearest")
        far[known] = np.abs(delay[known] - usual) > DELAY
        yield "stamp far from arrival", None, far, "the header stamp is far from its arrival"


def _going_back(series: Series, mapping: ImportMapping) -> IntArray:
    """Rows of a table whose time lies behind that of an earlier row: nothing sent them late, as messages are.

    A clock that begins anew has cut the table before; a lone stamp that leaps is left to `clock.in_order`.
    """
    if mapping.time is None or mapping.time.step is not None:
        return np.zeros(0, dtype=np.int64)
    t = _clock(series, mapping)
    rows = np.flatnonzero(np.isfinite(t))
    rows = np.delete(rows, clock.jumping(t[rows], mapping.checks.jump))
    return rows[t[rows] < np.maximum.accumulate(t[rows])] if len(rows) else rows


def _too_fast(series: Series, mapping: ImportMapping, known: Mapping[str, IntArray]) -> IntArray:
    """Rows whose channel leaps away and back faster than believable, among the rows not yet out."""
    count = len(series.receive)
    bad, sound = np.zeros(count, dtype=np.bool_), np.ones(count, dtype=np.bool_)
    for out in known.values():
        sound[out] = False
    t = _clock(series, mapping)
    for source in (*mapping.state, *mapping.action):
        limit = mapping.checks.max_rate.get(source.name)
        if limit is None or source.topic != series.topic or not set(source.fields) <= set(series.fields):
            continue
        there = [np.isfinite(series.fields[field]) for field in source.fields]
        rows = np.flatnonzero(sound & np.logical_and.reduce([*there, np.isfinite(t)]))
        if len(rows) > 2:
            raw = np.stack([series.fields[field][rows] for field in source.fields], axis=1)
            values, wraps = raw[:, 0], source.wraps  # up to sign and offset
            if source.quaternion is not None:  # continuous: every step the short way round
                values, wraps = np.unwrap(clock.euler_angle(raw, source.angle)), False
            bad[rows] |= _leaps(t[rows], source.scale * values, limit, wraps)
    return np.flatnonzero(bad)


def _clock(series: Series, mapping: ImportMapping) -> FloatArray:
    if mapping.time is not None:
        return stamps(series, mapping.time, "auto", "")[0]
    return series.receive if series.header is None or not np.ptp(series.header) > 0 else series.header


def _leaps(t: FloatArray, values: FloatArray, limit: float, wraps: bool) -> BoolArray:
    """Samples that both neighbours disagree with (at the ends: the only neighbour, which agrees with its own)."""
    steps = np.diff(values)
    if wraps:
        steps = (steps + np.pi) % (2.0 * np.pi) - np.pi
    fast = np.abs(steps) > limit * np.maximum(np.abs(np.diff(t)), 1e-9)
    return np.concatenate([[fast[0] and not fast[1]], fast[:-1] & fast[1:], [fast[-1] and not fast[-2]]])


TURN = 2.0 * np.pi
NEAR = 0.1  # a step this near to a turn, as a share of it
ONE_TURN = 1.01 * TURN  # an angle that never leaves so wide a range, with such steps, wraps


def unmarked_wraps(parts: Sequence[Part], built: Sequence[Assembled]) -> tuple[str, ...]:
    """Warnings of the state channels in rad that step by nearly a turn and have no `wraps`.

    UsageError where such an angle stays within one turn and values were made up on the way across: those lie on the
    other side of the circle. Angles from quaternions are continuous and never concerned.
    """
    found: dict[str, str] = {}
    for part, one in zip(parts, built, strict=True):
        for source in part.mapping.state:
            name = source.name
            if source.field is None or source.unit != "rad" or source.wraps or name in found:
                continue
            said = _look(part, one, source)
            if said:
                found[name] = said
    return tuple(found.values())


def _look(part: Part, one: Assembled, source: ChannelSource) -> str | None:
    track = part.tracks[source.track]
    spans = [(float(e.t[0]), float(e.t[-1])) for e in one.episodes]
    rows = np.flatnonzero(where.inside(track.t, spans))
    t, values = track.t[rows], samples(source, track, rows)
    turns = np.abs(np.abs(np.diff(values)) - TURN) <= NEAR * TURN
    # A row and the next must lie in one episode: what lies between episodes is a reset, no step.
    starts = np.array([start for start, _ in spans]) - TOLERANCE
    whole = np.flatnonzero(turns & (np.diff(np.searchsorted(starts, t, side="right")) == 0))
    if not len(whole):
        return None
    name = source.name
    first = (
        f"{part.name}: {name} steps by {values[whole[0] + 1] - values[whole[0]]:.3g} rad from one row to the next "
        f"({len(whole)} time(s), first at {t[whole[0]]:.6g} s), nearly a turn"
    )
    at = np.concatenate([episode.t for episode in one.episodes])
    behind = np.searchsorted(at, t[whole] + TOLERANCE, side="right")
    before = np.searchsorted(at, t[whole + 1] - TOLERANCE, side="left")
    between = bool((before > behind).any())  # a sample lies between the two rows of a step, and not on either
    if np.ptp(values) <= ONE_TURN and (part.mapping.filters(name) or between):
        raise UsageError(
            f"{first}, and values in between would lie on the other side; say state.{name}.wraps=true"
        )
    return f"{first}; if it is an angle that wraps, say state.{name}.wraps=true"
