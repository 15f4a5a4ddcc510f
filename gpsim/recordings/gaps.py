"""Where a log has lost rows: which steps are too long, and what is known of the commands over them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd

from gpsim.channels import BoolArray, Channels, FloatArray, IntArray, columns_beside

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
