"""Silent damage: rows that were read without complaint and cannot be true are refused, or left out and counted.

Angles that wrap and are not said to: a step of a whole turn from one row to the next.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from gpsim.channels import BoolArray, FloatArray, IntArray
from gpsim.errors import UsageError
from gpsim.recordings import clock
from gpsim.recordings import episodes as where
from gpsim.recordings.assembling import Assembled
from gpsim.recordings.clock import TOLERANCE
from gpsim.recordings.mapping import ChannelSource, ImportMapping
from gpsim.recordings.raw import Series
from gpsim.recordings.readers.checks import Limits, find_silent_damage
from gpsim.recordings.sources import Part
from gpsim.recordings.tracks import samples, stamps

TOO_FAST = "faster than checks.max_rate"
GOES_BACK = "time goes back"
# A stamp that leaps is the clock's affair: `clock.in_order` drops and counts it, salvage or not.
_LEFT_TO_THE_CLOCK = "stamp leaps"


def find_bad_rows(
    name: str, series: Series, mapping: ImportMapping, *, salvage: bool = False
) -> Mapping[str, IntArray]:
    """Rows of a topic that must not be used, by reason.

    Empty cells of a table and array elements that a message does not have are missing, not damaged, and none of
    this module's affair. What the readers' checks find (numbers that are not finite or absurd, quaternions that
    are no rotations, samples that leave their neighbours and come back, stamps far from their arrival) and
    changes faster than `checks.max_rate` are damage: UsageError (log, topic, row, field, what, remedy), or with
    `salvage` left out and counted.
    """
    limits = Limits(
        quaternion=mapping.checks.quaternion,
        jump=mapping.checks.outlier,
        clocks=mapping.time.fields if mapping.time is not None else (),
        periods={
            source.field: 2.0 * np.pi / abs(source.scale)
            for source in (*mapping.state, *mapping.action)
            if source.wraps and source.field is not None and source.scale
        },
    )
    out: dict[str, IntArray] = {}

    def note(reason: str, rows: IntArray, said: str) -> None:
        if not salvage:
            raise UsageError(f"{name}: {said}--salvage leaves such rows out and counts them")
        out[reason] = np.union1d(out[reason], rows) if reason in out else rows

    for finding in find_silent_damage(series, limits):
        if finding.kind != _LEFT_TO_THE_CLOCK:
            note(finding.kind, finding.rows, f"{finding.message}; ")
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
            values, wraps = _limited(source, series, rows)
            bad[rows] |= _leaps(t[rows], values, limit, wraps)
    return np.flatnonzero(bad)


def _limited(source: ChannelSource, series: Series, rows: IntArray) -> tuple[FloatArray, bool]:
    """The channel at the rows, up to sign and offset, and whether it is to be taken modulo 2 pi."""
    raw = np.stack([series.fields[field][rows] for field in source.fields], axis=1)
    if source.quaternion is not None:  # continuous: every step the short way round
        return source.scale * clock.unwrapped(clock.euler_angle(raw, source.angle)), False
    return source.scale * raw[:, 0], source.wraps


def _clock(series: Series, mapping: ImportMapping) -> FloatArray:
    """When the rows were taken [s], as far as it is known here."""
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
    """The warning about one channel of one piece of a log."""
    track = part.tracks[source.track]
    spans = [(float(e.t[0]), float(e.t[-1])) for e in one.episodes]
    rows = np.flatnonzero(where.inside(track.t, spans))
    t, values = track.t[rows], samples(source, track, rows)
    turns = np.abs(np.abs(np.diff(values)) - TURN) <= NEAR * TURN
    whole = np.flatnonzero(turns & _same_episode(t, spans))
    if not len(whole):
        return None
    name = source.name
    first = (
        f"{part.name}: {name} steps by {values[whole[0] + 1] - values[whole[0]]:.3g} rad from one row to the next "
        f"({len(whole)} time(s), first at {t[whole[0]]:.6g} s), nearly a turn"
    )
    if np.ptp(values) <= ONE_TURN and (part.mapping.filters(name) or _between(t, whole, one)):
        raise UsageError(
            f"{first}, and values in between would lie on the other side; say state.{name}.wraps=true"
        )
    return f"{first}; if it is an angle that wraps, say state.{name}.wraps=true"


def _same_episode(t: FloatArray, spans: Sequence[where.Interval]) -> BoolArray:
    """(N - 1,) whether a row and the next lie in one episode: what lies between episodes is a reset, no step."""
    starts = np.array([start for start, _ in spans]) - TOLERANCE
    return np.asarray(np.diff(np.searchsorted(starts, t, side="right")) == 0, dtype=np.bool_)


def _between(t: FloatArray, whole: IntArray, one: Assembled) -> bool:
    """Whether a sample of the recording lies between the two rows of one of the steps, and not on either."""
    at = np.concatenate([episode.t for episode in one.episodes])
    first = np.searchsorted(at, t[whole] + TOLERANCE, side="right")
    past = np.searchsorted(at, t[whole + 1] - TOLERANCE, side="left")
    return bool((past > first).any())
