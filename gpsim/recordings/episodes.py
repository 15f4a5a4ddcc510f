"""Where episodes lie: intervals of time, cut by gaps, flags and length, and what is held out."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from gpsim.channels import BoolArray, Channels, FloatArray, IntArray, columns_beside
from gpsim.recordings.clock import TOLERANCE
from gpsim.recordings.recording import Episode, HeldOut

if TYPE_CHECKING:
    import pandas as pd

    from gpsim.recordings.mapping import HeldOutRule

Interval = tuple[float, float]


def runs(t: FloatArray, ends: BoolArray | None = None) -> list[Interval]:
    """From the first to the last stamp of each run of t (N,) s; ends: (N - 1,) whether one ends before the next."""
    if not len(t):
        return []
    breaks = np.flatnonzero(ends) if ends is not None else np.zeros(0, dtype=np.int64)
    starts, stops = np.append(t[:1], t[breaks + 1]), np.append(t[breaks], t[-1:])
    return list(zip(starts.tolist(), stops.tolist(), strict=True))


def standing(
    t: FloatArray, end: float, limit: float | None = None, on: BoolArray | None = None
) -> list[Interval]:
    """Intervals in which what is held stands: from each stamp to the next or to `end`, at most `limit` [s] on.

    on: (N,) which of the stamps set a flag, the others clear it.
    """
    until = np.append(t[1:], max(end, t[-1])) if len(t) else t
    until = until if limit is None else np.minimum(until, t + limit)
    chosen = slice(None) if on is None else on
    return joined(zip(t[chosen].tolist(), until[chosen].tolist(), strict=True))


def joined(intervals: Iterable[Interval]) -> list[Interval]:
    """Sorted intervals with touching neighbours merged."""
    out: list[Interval] = []
    for a, b in intervals:
        if out and a <= out[-1][1]:
            out[-1] = (out[-1][0], max(b, out[-1][1]))
        else:
            out.append((a, b))
    return out


def common(first: Sequence[Interval], second: Sequence[Interval]) -> list[Interval]:
    """The intersection of two sorted lists of intervals; pieces of no length are left out."""
    out, i, j = [], 0, 0
    while i < len(first) and j < len(second):
        a, b = max(first[i][0], second[j][0]), min(first[i][1], second[j][1])
        if a < b:
            out.append((a, b))
        if first[i][1] < second[j][1]:
            i += 1
        else:
            j += 1
    return out


def inside(t: FloatArray, intervals: Sequence[Interval]) -> BoolArray:
    """(N,) whether each time lies in one of the sorted intervals, ends included."""
    if not intervals:
        return np.zeros(len(t), dtype=np.bool_)
    starts, ends = np.array(intervals).T
    index = np.searchsorted(starts - TOLERANCE, t, side="right") - 1
    found: NDArray[np.bool_] = (index >= 0) & (t <= ends[np.clip(index, 0, None)] + TOLERANCE)
    return found


def stands_inside(t: FloatArray, intervals: Sequence[Interval]) -> BoolArray:
    """(N,) whether a command given at t (sorted) stands at some moment of one of the intervals."""
    if not intervals or not len(t):
        return np.zeros(len(t), dtype=np.bool_)
    starts, ends = np.array(intervals).T
    until = np.append(t[1:], np.inf)
    index = np.searchsorted(ends, t, side="left")  # the first interval that ends at or after the command
    begins = starts[np.clip(index, 0, len(starts) - 1)]
    found: NDArray[np.bool_] = (index < len(ends)) & (until > begins)
    return found


def hold_out(episodes: Sequence[Episode], rule: HeldOutRule, session: bool) -> HeldOut | None:
    """What to keep for judging: by default the last episodes that hold about `share` of the time, or of it when few.

    With fewer than five episodes on their own clocks the last one is held out; a single episode, or few on
    one clock, are cut at a moment.
    """
    if rule.episodes_from is not None or rule.time_from is not None:
        return HeldOut(rule.episodes_from, rule.time_from)
    if rule.share == 0.0:
        return None
    count = len(episodes)
    lengths = np.array([float(e.t[-1] - e.t[0]) for e in episodes])
    if count >= 5 or (count > 1 and not session):
        last = (
            lengths[::-1].cumsum()[: count - 1] / lengths.sum()
        )  # of the time, in the last 1, 2, ... episodes
        few = int(np.abs(last - rule.share).argmin()) + 1 if count >= 5 else 1
        return HeldOut(episodes_from=count - few)
    left = (1.0 - rule.share) * float(lengths.sum())
    for episode in episodes:
        length = float(episode.t[-1] - episode.t[0])
        if left <= length:
            break
        left -= length
    return HeldOut(time_from=round(float(episode.t[0]) + min(left, length), 6))


LONGEST_STEP = 1.8  # in control steps: a longer one may hide commands


def gaps(t: FloatArray, dt: float) -> BoolArray:
    """(K,): steps of a clock t (K + 1,) s that are too long for one control step of dt s."""
    return np.asarray(np.diff(t) > LONGEST_STEP * dt)


def pieces(ends: Sequence[int], last: int) -> list[tuple[int, int]]:
    """First and last of the pieces that samples 0 to `last` fall into where the samples `ends` each end one."""
    return list(zip([0, *(end + 1 for end in ends)], [*ends, last], strict=True))


def steps_to_next(t: FloatArray, episode: IntArray, dt: float) -> IntArray:
    """(N,): how many control steps of dt s lie between a row and the next one of its episode, at least 1.

    t (N,) s, episode (N,) ascending. A clock that jitters counts as one step; only a gap counts as more. The last row
    of an episode, which has none after it, counts 1.
    """
    count = np.ones(len(t), dtype=np.int64)
    lost = np.flatnonzero(gaps(t, dt) & (np.diff(episode) == 0))
    count[lost] = np.rint((t[lost + 1] - t[lost]) / dt).astype(np.int64)
    return count


@dataclass(frozen=True)
class OverGaps:
    """The commands over the gaps of a table of transitions that leaves these out: each stood until the next row.

    after: (M,) the row of the table that each follows, in its episode and ascending; t: (M,) s, since when it stood;
    actions: (M, A). Where gaps follow one another, several have one row before them.
    """

    after: IntArray
    t: FloatArray
    actions: FloatArray

    @classmethod
    def of(cls, over: BoolArray, episode: IntArray, t: FloatArray, actions: FloatArray) -> OverGaps | None:
        """Those of the transitions `over` (N,) a gap, which are left out; None where there are none.

        episode (N,), t (N,) s and actions (N, A) are those of all transitions, in order. What stood before an episode's
        first row that is left has nothing to follow: the episode begins there.
        """
        before = np.maximum.accumulate(np.where(over, -1, np.arange(len(over))))
        follows = over & (before >= 0) & (episode[before] == episode)
        if not follows.any():
            return None
        return cls((np.cumsum(~over) - 1)[follows], t[follows], actions[follows])

    def take(self, rows: BoolArray) -> OverGaps:
        """Those that follow a row of the mask (N,), for the table of these rows alone."""
        left = rows[self.after]
        return OverGaps((np.cumsum(rows) - 1)[self.after[left]], self.t[left], self.actions[left])

    def put_back(
        self, actions: FloatArray, episode: IntArray, t: FloatArray
    ) -> tuple[FloatArray, IntArray, FloatArray, BoolArray]:
        """The table's actions (N, A), episode (N,) and t (N,) with the commands over gaps in their places.

        Returns those of all N + M rows, and (N + M,) which of them are the table's own.
        """
        at = self.after + 1
        return (
            np.insert(actions, at, self.actions, axis=0),
            np.insert(episode, at, episode[self.after]),
            np.insert(t, at, self.t),
            np.insert(np.ones(len(t), dtype=np.bool_), at, False),
        )

    def to_table(self, action: Channels) -> pd.DataFrame:
        """One row a command: after, t, the action's channels."""
        import pandas as pd  # here: half a second that most commands need not wait for

        columns = columns_beside(action.names, ("after", "t"), "command")
        commands = {name: self.actions[:, i] for i, name in enumerate(columns)}
        return pd.DataFrame({"after": self.after, "t": self.t} | commands)

    @classmethod
    def from_table(cls, table: pd.DataFrame) -> OverGaps:
        """The inverse of `to_table`."""
        return cls(
            table["after"].to_numpy(dtype=np.int64),
            table["t"].to_numpy(dtype=np.float64),
            table.drop(columns=["after", "t"]).to_numpy(dtype=np.float64),
        )
