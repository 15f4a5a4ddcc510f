"""One clock: the stamps of a topic put in order, with everything odd about them counted."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from gpsim.channels import FloatArray, IntArray

BURST = 0.1  # an interval below this share of the median interval is a burst
RESTART = 10  # this many messages in a row behind the latest stamp: the clock was set back
NEIGHBOURS = 11  # window of the median that a jumping stamp is compared with


@dataclass(frozen=True)
class Ordered:
    """The rows of a topic worth keeping, in the order of time.

    rows: (K,) indices into the topic's rows; t: (K,) s, strictly increasing; dropped: rows by reason;
    noticed: what was kept but is odd, by kind.
    """

    rows: IntArray
    t: FloatArray
    dropped: Mapping[str, int]
    noticed: Mapping[str, int]


def restarts(stamps: FloatArray) -> list[int]:
    """Rows at which the clock was set back for good: the stamps stay behind for at least RESTART rows.

    stamps: (N,) s in file order. A few late messages are not a restart; `in_order` sorts them in.
    """
    found: list[int] = []
    start = 0
    while True:
        behind = stamps[start:] < np.maximum.accumulate(stamps[start:])
        change = np.flatnonzero(np.diff(np.concatenate(([0], behind.astype(np.int8), [0]))))
        runs = change.reshape(-1, 2)
        long = runs[runs[:, 1] - runs[:, 0] >= RESTART]
        if not len(long):
            return found
        start += int(long[0, 0])
        found.append(start)


def jumping(stamps: FloatArray, limit: float) -> IntArray:
    """Rows whose stamp lies more than `limit` [s] away from the median of its neighbours in the file.

    The median stands on the own side of a lasting pause, so pauses are no jumps; runs of up to five are
    found. The limit grows with the usual interval, so that slow logs are not all jumps.
    """
    if len(stamps) < 3:
        return np.zeros(0, dtype=np.int64)
    from scipy.ndimage import (
        median_filter,  # here, as below: half a second that most commands need not wait for
    )

    usual = float(np.median(np.abs(np.diff(stamps))))
    near = median_filter(stamps, size=min(NEIGHBOURS, len(stamps)), mode="nearest")
    return np.flatnonzero(np.abs(stamps - near) > max(limit, NEIGHBOURS * usual))


def in_order(stamps: FloatArray, values: FloatArray, jump: float, newest_of_burst: bool) -> Ordered:
    """Sort a topic by its stamps and drop what no clock can hold.

    stamps: (N,) s in file order, finite; values: (N, F), to tell a duplicate from a second value.
    newest_of_burst: keep only the newest of messages that arrived together (right for poses on receive time,
    where the others waited somewhere and their time of arrival says nothing).
    """
    wrong = jumping(stamps, jump)
    rows = np.delete(np.arange(len(stamps)), wrong)
    t = stamps[rows]
    late = int((t < np.maximum.accumulate(t)).sum()) if len(t) else 0
    order = np.argsort(t, kind="stable")
    rows, t = rows[order], t[order]

    same = np.flatnonzero(np.diff(t) == 0)
    equal = int((values[rows[same]] == values[rows[same + 1]]).all(axis=1).sum())
    rows, t = np.delete(rows, same), np.delete(t, same)  # the last of each stamp stays

    together = bursts(t)
    if newest_of_burst:
        rows, t = np.delete(rows, together), np.delete(t, together)
    burst = len(together)
    dropped = {
        "jumping stamp": len(wrong),
        "duplicate": equal,
        "second value at one stamp": len(same) - equal,
    }
    dropped |= {"older of a burst": burst} if newest_of_burst else {}
    noticed = {"out of order": late, "in a burst": 0 if newest_of_burst else burst}
    some = [{reason: count for reason, count in one.items() if count} for one in (dropped, noticed)]
    return Ordered(rows, t, *some)


def bursts(t: FloatArray) -> IntArray:
    """Rows followed by the next at less than BURST of the median interval; t: (N,) s, sorted."""
    if len(t) < 3:
        return np.zeros(0, dtype=np.int64)
    steps = np.diff(t)
    return np.flatnonzero(steps < BURST * np.median(steps))


# Absolute stamps (about 1.7e9 s) in double precision are a quarter of a microsecond apart: a command
# that arrives within this of t_k was given at t_k, not one step later.
TOLERANCE = 1e-6


def slerp(at: FloatArray, t: FloatArray, quaternions: FloatArray) -> FloatArray:
    """Quaternions (M, 4) x y z w at times `at`: constant rate on the shortest arc (Shoemake 1985).

    q and -q are the same rotation and may alternate in the input. Where `at` is a stamp, that rotation
    is returned.
    """
    if len(t) == 1:
        return np.repeat(quaternions, len(at), axis=0)
    from scipy.spatial.transform import Rotation, Slerp

    return np.asarray(Slerp(t, Rotation.from_quat(quaternions))(np.clip(at, t[0], t[-1])).as_quat())


def euler_angle(quaternions: FloatArray, name: str) -> FloatArray:
    """roll, pitch or yaw [rad] (N,) of quaternions (N, 4): R = Rz(yaw) Ry(pitch) Rx(roll) (REP 103).

    x y z w. Written out, because SciPy warns at pitch = +-90 degrees, where only yaw - roll is defined.
    """
    x, y, z, w = (quaternions / np.linalg.norm(quaternions, axis=1, keepdims=True)).T
    if name == "yaw":
        angle = np.arctan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))
    elif name == "roll":
        angle = np.arctan2(2.0 * (w * x + y * z), 1.0 - 2.0 * (x * x + y * y))
    else:
        angle = np.arcsin(np.clip(2.0 * (w * y - z * x), -1.0, 1.0))
    return np.asarray(angle, dtype=np.float64)


def held(at: FloatArray, t: FloatArray, values: FloatArray) -> FloatArray:
    """The value standing at each time: the last one given at or before it (zero-order hold).

    Before t[0] nothing was commanded; callers start episodes no earlier (the first value is returned).
    """
    index = np.searchsorted(t, at + TOLERANCE, side="right") - 1
    return values[np.clip(index, 0, len(t) - 1)]


def held_mean(at: FloatArray, t: FloatArray, values: FloatArray) -> FloatArray:
    """Time average (M - 1,) of the held signal over each interval [at_k, at_k+1]."""
    ends = np.concatenate([t, [max(at[-1], t[-1])]])
    area = np.concatenate([[0.0], np.cumsum(values * np.diff(ends))])
    before = np.clip(at, t[0], None)
    integral = np.interp(before, ends, area) + np.minimum(at - t[0], 0.0) * values[0]
    return np.asarray(np.diff(integral) / np.diff(at), dtype=np.float64)
