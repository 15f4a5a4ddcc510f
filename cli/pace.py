"""How long a job still takes, whose steps do not take equally long."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

Shares = Sequence[tuple[float, float]]
"""(share of the steps that are done, share of the time that has usually gone by then), ascending, from 0 to 1."""
EVEN: Shares = ((0.0, 0.0), (1.0, 1.0))
DIAGNOSIS: Shares = (
    (0.0, 0.0), (0.05, 0.05), (0.2, 0.55), (0.4, 0.6), (0.55, 0.72), (0.9, 0.92), (0.98, 0.99), (1.0, 1.0),
)  # fmt: skip
"""Of a diagnosis with a built-in simulator, measured on data/cart.csv: half the time goes into the usual effects."""
MUJOCO: Shares = (
    (0.0, 0.0), (0.05, 0.01), (0.4, 0.05), (0.68, 0.27), (0.9, 0.47), (0.92, 0.72), (0.98, 0.99), (1.0, 1.0),
)  # fmt: skip
"""Of one with a MuJoCo model, measured on data/arm.csv: most goes into the search and into checking its result."""
OVERRUN = 0.5  # of the time that a step has taken so far, that it takes at least from now on
EARLIEST = 0.02  # of the time: before that nobody can tell how long the whole takes
BELOW_A_MINUTE = 5  # s, to which less than a minute is rounded


class Pace:
    """The time left of one job: as much as its steps usually take beside those that are done.

    A step that takes longer than usual makes the whole longer: as long as it lasts, the job is not beyond it.
    """

    def __init__(self, shares: Shares, began: float) -> None:
        self._shares, self._began = shares, began
        self.share, self._next, self._reached = 0.0, 1.0, began

    def update(self, done: int, total: int, now: float) -> None:
        """`done` of `total` is done now."""
        share, following = _between(self._shares, done / total if total else 0.0)
        if share > self.share or self._reached == self._began:
            self.share, self._next, self._reached = max(share, self.share), following, now

    def left(self, now: float) -> float | None:
        """Seconds; None where nobody can tell yet."""
        if self.share < EARLIEST:
            return None
        whole = max((self._reached - self._began) / self.share, (now - self._began) / self._next)
        return max(whole - (now - self._began), OVERRUN * (now - self._reached))


def clock(seconds: float) -> str:
    """`40 s`, `3 min`: no finer than a forecast is good for."""
    if seconds < 60.0 - BELOW_A_MINUTE / 2:
        return f"{BELOW_A_MINUTE * max(round(seconds / BELOW_A_MINUTE), 1)} s"
    return f"{max(round(seconds / 60.0), 1)} min"


def _between(shares: Shares, done: float) -> tuple[float, float]:
    """The share of the time at `done`, and at the end of the step in which that lies."""
    for (low, before), (high, after) in pairwise(shares):
        if done < high:
            return before + (after - before) * (done - low) / (high - low), after
    return 1.0, 1.0
