"""Damage that nothing complains about: flipped bytes that still decode. Looked for by what cannot be true.

The limits are wide, so that sound recordings have no findings; small flips in a mantissa stay unseen.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from scipy.ndimage import median_filter

from gpsim.channels import BoolArray, FloatArray, IntArray
from gpsim.recordings.raw import Series

Kind = Literal[
    "not finite", "no rotation", "absurd magnitude", "jump", "stamp leaps", "stamp far from arrival"
]
_POSE = ("position", "orientation", "translation", "rotation")
_STAMP_PARTS = ("sec", "nanosec", "seq")
AROUND = 501  # messages among which one that is late stands out


@dataclass(frozen=True)
class Limits:
    """quaternion: believable | norm - 1 |. largest, smallest: believable nonzero magnitudes in any SI unit.

    jump: how many times the 95th percentile of a field's usual unevenness a single sample may leave its
    neighbours; leap [s]: how far one stamp may lie from both neighbours; delay [s]: how far a message's delay may
    lie from the median of those around it (a clock that runs at another pace is no damage). clocks: fields that hold
    the time, of any unit; periods: fields of angles, with what one turn is in them.
    """

    quaternion: float = 0.01
    largest: float = 1e12
    smallest: float = 1e-100
    jump: float = 50.0
    leap: float = 10.0
    delay: float = 60.0
    clocks: tuple[str, ...] = ()
    periods: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True)
class Finding:
    """Rows of a topic that cannot be true; message: one line for the person."""

    kind: Kind
    rows: IntArray
    message: str


Suspect = tuple[Kind, str | None, BoolArray, str]
"""(kind, field, rows that cannot be true (N,), what is wrong with them)."""


def find_silent_damage(series: Series, limits: Limits | None = None) -> tuple[Finding, ...]:
    """Everything in a topic that cannot be true; rows count from 0 in file order."""
    chosen, found = limits or Limits(), []
    for kind, name, bad, what in (
        *_values(series, chosen),
        *_quaternions(series, chosen),
        *_stamps(series, chosen),
    ):
        rows = np.flatnonzero(bad)
        if len(rows):
            place = f"{series.topic}, row {rows[0]}" + ("" if name is None else f", field {name}")
            found.append(Finding(kind, rows, f"{place}: {what} ({len(rows)} of {len(bad)} rows)"))
    return tuple(found)


def _values(series: Series, limits: Limits) -> Iterator[Suspect]:
    turned = _turned(series)
    for name, values in series.fields.items():
        missing = np.isnan(values) & (series.absent.get(name, 0) > 0)
        yield "not finite", name, ~np.isfinite(values) & ~missing, "the value is no finite number"
        size = np.abs(np.where(np.isfinite(values), values, 0.0))
        if name not in limits.clocks:
            strange = (size > limits.largest) | ((size > 0) & (size < limits.smallest))
            yield "absurd magnitude", name, strange, "no sensor or command has this magnitude"
        if any(part in _POSE for part in name.split(".")) and name.split(".")[-1] not in _STAMP_PARTS:
            steady = turned.get(name, values)
            if name in limits.periods:
                steady = np.unwrap(steady, period=limits.periods[name])
            yield "jump", name, jumps(steady, limits.jump), "leaves its neighbours and comes back"


def _turned(series: Series) -> dict[str, FloatArray]:
    """The parts of quaternions with one sign throughout: q and -q are the same rotation."""
    out: dict[str, FloatArray] = {}
    for parts in _quaternion_parts(series):
        values = np.stack([series.fields[part] for part in parts])
        with np.errstate(over="ignore", invalid="ignore"):
            agree = np.sum(values[:, 1:] * values[:, :-1], axis=0)
        sign = np.cumprod(np.concatenate([[1.0], np.where(agree < 0, -1.0, 1.0)]))
        out |= dict(zip(parts, sign * values, strict=True))
    return out


def _quaternion_parts(series: Series) -> list[list[str]]:
    """The fields x, y, z and w of every quaternion."""
    found = [[f"{name[:-1]}{axis}" for axis in "xyzw"] for name in series.fields if name.endswith(".w")]
    return [parts for parts in found if all(part in series.fields for part in parts)]


def jumps(values: FloatArray, factor: float) -> BoolArray:
    """Samples that stand alone: (N,) bool. Uneven is what a sample differs from the mean of its two neighbours."""
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


def _quaternions(series: Series, limits: Limits) -> Iterator[Suspect]:
    for parts in _quaternion_parts(series):
        values = np.stack([series.fields[part] for part in parts])
        known = np.isfinite(values).all(axis=0)
        with np.errstate(over="ignore", invalid="ignore"):
            norm = np.sqrt(np.sum(values**2, axis=0))
        off = known & ~(np.abs(norm - 1.0) <= limits.quaternion)
        yield "no rotation", parts[-1][:-2], off, "the quaternion's norm is not 1"


def _stamps(series: Series, limits: Limits) -> Iterator[Suspect]:
    arrival, header = series.receive, series.header
    yield "stamp leaps", None, _leaps(arrival, limits.leap), "the receive time leaves its neighbours"
    if header is None:
        return
    yield "stamp leaps", None, _leaps(header, limits.leap), "the header stamp leaves its neighbours"
    delay = arrival - header
    known = np.isfinite(delay)
    if known.any() and np.ptp(header[known]) > 0:  # a stamp that is never set is no clock
        far = np.zeros(len(delay), dtype=np.bool_)
        usual = median_filter(delay[known], AROUND, mode="nearest")
        far[known] = np.abs(delay[known] - usual) > limits.delay
        yield "stamp far from arrival", None, far, "the header stamp is far from its arrival"


def _leaps(stamps: FloatArray, limit: float) -> BoolArray:
    """Stamps further than `limit` from the median of themselves and the two on either side."""
    count = len(stamps)
    if count < 5 or not np.isfinite(stamps).all():
        return np.zeros(count, dtype=np.bool_)
    around = np.clip(np.arange(count)[:, None] + np.arange(-2, 3), 0, count - 1)
    middle = np.median(stamps[around], axis=1)
    steps = np.diff(stamps)
    usual = float(np.median(steps[steps > 0])) if (steps > 0).any() else 0.0
    return np.asarray(np.abs(stamps - middle) > max(limit, 20.0 * usual), dtype=np.bool_)
