"""Silent damage: rows that were read without complaint and cannot be true."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

import numpy as np

from gpsim.channels import BoolArray, FloatArray, IntArray
from gpsim.errors import UsageError
from gpsim.recordings.mapping import ChannelSource, ImportMapping
from gpsim.recordings.raw import Series

MISSING = "value missing"
FAR = 366 * 86_400.0  # s; a header stamp a year from its arrival is damage, not delay


def find_bad_rows(
    name: str, series: Series, mapping: ImportMapping, *, salvage: bool = False
) -> Mapping[str, IntArray]:
    """Rows of a topic that must not be used, by reason.

    Empty cells of a table and array elements that a message does not have are missing, not damaged: they are
    left out and counted. Infinite or missing numbers in messages, quaternions that are no rotations, stamps
    a year away and changes faster than `checks.max_rate` are damage: UsageError (log, topic, row, what), or
    with `salvage` left out and counted too.
    """
    missing = _missing(series)
    damaged = {
        "not a finite number": _not_finite(series) & ~_any(missing.values(), series),
        "quaternion is no rotation": _not_unit(series, mapping),
        "header stamp a year from its arrival": _far_stamp(series),
    }
    known = _any([*missing.values(), *damaged.values()], series)
    damaged["impossible jump"] = _too_fast(series, mapping, ~known)
    for reason, rows in damaged.items():
        if rows.any() and not salvage:
            raise UsageError(
                f"{name}: {series.topic}, row {int(np.flatnonzero(rows)[0])}: {reason} ({int(rows.sum())} such "
                f"of {len(rows)} rows); --salvage leaves them out and counts them"
            )
    return {reason: np.flatnonzero(rows) for reason, rows in (missing | damaged).items() if rows.any()}


def _any(masks: Iterable[BoolArray], series: Series) -> BoolArray:
    out = np.zeros(len(series.receive), dtype=np.bool_)
    for mask in masks:
        out |= mask
    return out


def _missing(series: Series) -> dict[str, BoolArray]:
    """Rows that hold nothing where something was asked for, and are known to be so."""
    empty = np.zeros(len(series.receive), dtype=np.bool_)
    for field, values in series.fields.items():
        if series.absent.get(field):
            empty |= np.isnan(values)
    return {MISSING: empty}


def _not_finite(series: Series) -> BoolArray:
    bad = np.zeros(len(series.receive), dtype=np.bool_)
    for values in series.fields.values():
        bad |= ~np.isfinite(values)
    return bad


def _not_unit(series: Series, mapping: ImportMapping) -> BoolArray:
    bad = np.zeros(len(series.receive), dtype=np.bool_)
    for source in _of(series, mapping):
        if source.quaternion is not None:
            parts = np.stack([series.fields[name] for name in source.fields])
            with np.errstate(over="ignore", invalid="ignore"):
                off = np.abs(np.sqrt(np.sum(parts**2, axis=0)) - 1.0)
            bad |= np.isfinite(parts).all(axis=0) & ~(off <= mapping.checks.quaternion)
    return bad


def _far_stamp(series: Series) -> BoolArray:
    """A stamp that was never set (all zero) is no damage: the track falls back to receive time."""
    if series.header is None or not len(series.header):
        return np.zeros(len(series.receive), dtype=np.bool_)
    far = np.abs(series.header - series.receive) > FAR
    usual = float(np.nanmedian(np.abs(series.header - series.receive)))
    return far if usual <= FAR else np.zeros(len(far), dtype=np.bool_)


def _too_fast(series: Series, mapping: ImportMapping, sound: BoolArray) -> BoolArray:
    """Rows whose channel leaps away and back faster than believable: both neighbours disagree with them."""
    bad = np.zeros(len(series.receive), dtype=np.bool_)
    rows = np.flatnonzero(sound)
    if len(rows) < 3:
        return bad
    t = (series.header if series.header is not None else series.receive)[rows]
    for source in _of(series, mapping):
        limit = mapping.checks.max_rate.get(source.channel.name)
        if limit is None or source.field is None:
            continue
        bad[rows] |= _leaps(t, source.scale * series.fields[source.field][rows], limit, source.channel.wraps)
    return bad


def _leaps(t: FloatArray, values: FloatArray, limit: float, wraps: bool) -> BoolArray:
    steps = np.diff(values)
    if wraps:
        steps = (steps + np.pi) % (2.0 * np.pi) - np.pi
    fast = np.abs(steps) > limit * np.maximum(np.abs(np.diff(t)), 1e-9)
    return np.concatenate([[fast[0] and not fast[1]], fast[:-1] & fast[1:], [fast[-1] and not fast[-2]]])


def _of(series: Series, mapping: ImportMapping) -> list[ChannelSource]:
    sources = (*mapping.state, *mapping.action)
    return [s for s in sources if s.derivative_of is None and s.topic == series.topic]
