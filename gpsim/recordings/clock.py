"""One clock: the stamps of a topic put in order, with everything odd about them counted."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.ndimage import median_filter
from scipy.spatial.transform import Rotation, Slerp

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
    usual = float(np.median(np.abs(np.diff(stamps))))
    near = median_filter(stamps, size=min(NEIGHBOURS, len(stamps)), mode="nearest")
    return np.flatnonzero(np.abs(stamps - near) > max(limit, NEIGHBOURS * usual))


def in_order(stamps: FloatArray, values: FloatArray, jump: float, newest_of_burst: bool) -> Ordered:
    """Sort a topic by its stamps and drop what no clock can hold.

    stamps: (N,) s in file order, finite; values: (N, F), to tell a duplicate from a second value.
    newest_of_burst: keep only the newest of messages that arrived together (right for poses on receive time,
    where the others waited somewhere and their time of arrival says nothing).
    """
    dropped: dict[str, int] = {}
    keep = np.ones(len(stamps), dtype=np.bool_)
    keep[jumping(stamps, jump)] = False
    _count(dropped, "jumping stamp", int((~keep).sum()))
    rows = np.flatnonzero(keep)
    t = stamps[rows]
    late = int((t < np.maximum.accumulate(t)).sum()) if len(t) else 0
    order = np.argsort(t, kind="stable")
    rows, t = rows[order], t[order]

    same = np.flatnonzero(np.diff(t) == 0)
    equal = (values[rows[same]] == values[rows[same + 1]]).all(axis=1)
    _count(dropped, "duplicate", int(equal.sum()))
    _count(dropped, "second value at one stamp", int((~equal).sum()))
    rows, t = np.delete(rows, same), np.delete(t, same)  # the last of each stamp stays

    together = bursts(t)
    if newest_of_burst:
        _count(dropped, "older of a burst", len(together))
        rows, t = np.delete(rows, together), np.delete(t, together)
    noticed: dict[str, int] = {}
    _count(noticed, "out of order", late)
    _count(noticed, "in a burst", 0 if newest_of_burst else len(together))
    return Ordered(rows, t, dropped, noticed)


def bursts(t: FloatArray) -> IntArray:
    """Rows followed by the next at less than BURST of the median interval; t: (N,) s, sorted."""
    if len(t) < 3:
        return np.zeros(0, dtype=np.int64)
    steps = np.diff(t)
    return np.flatnonzero(steps < BURST * np.median(steps))


def _count(table: dict[str, int], reason: str, number: int) -> None:
    if number:
        table[reason] = table.get(reason, 0) + number


@dataclass(frozen=True)
class Lag:
    """How much later a response moves than its command: lag [s] at the peak of their correlation (-1..1)."""

    command: str
    response: str
    lag: float
    correlation: float
    within: float

    @property
    def usable(self) -> bool:
        """A clear peak inside the searched range; otherwise the lag means nothing."""
        return abs(self.correlation) >= 0.5 and abs(self.lag) < self.within


def estimate_lag(
    names: tuple[str, str],
    pieces: Sequence[tuple[FloatArray, FloatArray]],
    step: float,
    within: float = 1.0,
) -> Lag:
    """Cross-correlate command and response over episodes; the peak is refined by a parabola.

    names: command, response. pieces: per episode (command, response), each (N,) on an even grid of `step`.
    The lag holds the system's own delay and inertia as well as any offset between the clocks: it is an
    upper bound of the latter, to be shown, not believed.
    """
    reach = max(1, round(within / step))
    covariance = np.zeros(2 * reach + 1)
    power = np.zeros((2, 2 * reach + 1))
    means = [np.mean(np.concatenate([piece[i] for piece in pieces])) for i in (0, 1)]
    for command, response in pieces:
        u, r = command - means[0], response - means[1]
        covariance += _correlation(r, u, reach)
        power[0] += _correlation(np.ones_like(r), u * u, reach)
        power[1] += _correlation(r * r, np.ones_like(u), reach)
    scale = np.sqrt(np.clip(power[0], 0.0, None) * np.clip(power[1], 0.0, None))
    curve = np.divide(
        covariance, scale, out=np.zeros_like(scale), where=scale > 1e-12 * (scale.max() + 1e-300)
    )
    peak = int(np.argmax(np.abs(curve)))
    shift = 0.0
    if 0 < peak < 2 * reach:
        left, top, right = curve[peak - 1 : peak + 2]
        bend = left - 2.0 * top + right
        shift = float(np.clip(0.5 * (left - right) / bend, -0.5, 0.5)) if bend != 0 else 0.0
    return Lag(*names, lag=(peak - reach + shift) * step, correlation=float(curve[peak]), within=reach * step)


def _correlation(later: FloatArray, earlier: FloatArray, reach: int) -> FloatArray:
    """sum_i later[i + k] earlier[i] for k = -reach..reach."""
    from scipy.signal import correlate  # here: half a second that most commands need not wait for

    full = correlate(later, earlier, mode="full", method="fft")
    centre = len(earlier) - 1
    out = np.zeros(2 * reach + 1)
    low, high = max(-reach, -centre), min(reach, len(later) - 1)
    out[low + reach : high + reach + 1] = full[centre + low : centre + high + 1]
    return out


# Absolute stamps (about 1.7e9 s) in double precision are a quarter of a microsecond apart: a command
# that arrives within this of t_k was given at t_k, not one step later.
TOLERANCE = 1e-6


def linear(at: FloatArray, t: FloatArray, values: FloatArray) -> FloatArray:
    """Values (M,) at times `at` inside [t[0], t[-1]] from values (N,) at t (N,) s."""
    return np.asarray(np.interp(at, t, values), dtype=np.float64)


def unwrapped(angles: FloatArray) -> FloatArray:
    """Angles [rad] made continuous: each step the short way round."""
    return np.asarray(np.unwrap(angles), dtype=np.float64)


def slerp(at: FloatArray, t: FloatArray, quaternions: FloatArray) -> FloatArray:
    """Quaternions (M, 4) x y z w at times `at`: constant rate on the shortest arc (Shoemake 1985).

    q and -q are the same rotation and may alternate in the input. Where `at` is a stamp, that rotation
    is returned.
    """
    if len(t) == 1:
        return np.repeat(quaternions, len(at), axis=0)
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
