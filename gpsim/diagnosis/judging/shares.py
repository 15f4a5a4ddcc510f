"""Shares of a mismatch: of the base's squared errors, beyond the noise, what an account takes off.

Of a channel 1 - (after^2 - floor^2) / (before^2 - floor^2), clipped to [0, 1]; over channels the mean, each weighed by
its excess before^2 - floor^2 in units of its own variance: a channel in which the simulator is far off says more.
Intervals are quantiles of a block bootstrap (Kuensch 1989), in which all accounts are judged on the same draws.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from gpsim.channels import BoolArray, FloatArray
from gpsim.diagnosis.report import Share

FEWEST_BLOCKS = 8
"""Blocks of a rollout's length: with fewer held out the whole recording is judged on in turn, with fewer in it there
are no intervals."""
LOW = 0.05  # quantile of the draws that is an interval's lower end (usual: 90 %)
HIGH = 0.95  # quantile of the draws that is its upper end (usual: 90 %)

TINY = 1e-300  # guards divisions by sums of squares that are 0
ROUNDING = 1e-18  # of a channel's variance: squares that are less are those of rounding, and no mismatch


@dataclass(frozen=True)
class Mismatch:
    """Sums of squares (B, S) by block and channel: of the base's errors and of what noise alone makes.

    scale: (S,) the variance of each channel; seen: (S,) which are judged; times: the base's root mean square must be
    so many times the noise's, 0 where any excess counts; drawn: (D, B) how often every draw holds every block.
    """

    before: FloatArray
    floor: FloatArray
    scale: FloatArray
    seen: BoolArray
    times: float
    drawn: FloatArray

    @cached_property
    def counts(self) -> BoolArray:
        """(S,) channels in which the mismatch stands out of the noise."""
        before, floor = self.before.sum(axis=0), self.floor.sum(axis=0)
        excess = self.drawn @ (self.before - self.floor)
        sure = np.quantile(excess, LOW, axis=0) > 0
        return np.asarray(self.seen & sure & self._stands_out(before, floor))

    def _stands_out(self, before: FloatArray, floor: FloatArray) -> BoolArray:
        """(..., S): of which sums of squares the base's are more than noise, or rounding, makes."""
        least = np.maximum(self.times**2 * floor, ROUNDING * self.scale)
        return np.asarray(before > np.maximum(least, TINY))

    def by_channel(self, after: FloatArray) -> FloatArray:
        """(..., 1 + D, S) clipped shares of an account's sums of squares (..., B, S); first those of all blocks.

        Where a draw holds no mismatch that stands out, as without the few moments in which an axis met its stop, it
        tells nothing: what is explained there is as of all blocks.
        """
        before, floor, left = (self.sums(sums) for sums in (self.before, self.floor, after))
        shares = np.clip(1.0 - (left - floor) / np.maximum(before - floor, TINY), 0.0, 1.0)
        return np.asarray(np.where(self._stands_out(before, floor), shares, shares[..., :1, :]))

    def overall(self, after: FloatArray) -> FloatArray:
        """(..., 1 + D) the same over all channels that count."""
        before, floor = self.sums(self.before), self.sums(self.floor)
        weights = np.maximum(before - floor, 0.0) / np.maximum(self.scale, TINY) * self.counts
        total = np.maximum(weights.sum(axis=-1), TINY)
        return np.asarray((self.by_channel(after) * weights).sum(axis=-1) / total)

    def share(self, values: FloatArray) -> Share:
        """Of (1 + D,) values, the first of which is that of all blocks."""
        low, high = np.quantile(values[1:], [LOW, HIGH])
        known = len(self.before) >= FEWEST_BLOCKS
        return Share(float(values[0]), float(low) if known else None, float(high) if known else None)

    def sums(self, sums: FloatArray) -> FloatArray:
        """(..., 1 + D, S): over all blocks, then over those of each draw."""
        return np.concatenate([sums.sum(axis=-2, keepdims=True), self.drawn @ sums], axis=-2)


def draws(blocks: int, count: int, rng: np.random.Generator) -> FloatArray:
    """(D, B) how often each of B blocks is drawn, B times with replacement."""
    return rng.multinomial(blocks, np.full(blocks, 1.0 / blocks), count).astype(float)
