"""Where in state, action and time a mismatch lives: the part that holds nearly all of it and few of the samples."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from gpsim.channels import FloatArray

BINS = 40  # of equal numbers of samples
MOST_OF_IT = 0.9  # share of the squares beyond noise that a part must hold
FEW = 0.35  # share of the samples that it may hold at most
FEWEST_SAMPLES, LEAST = 400, 0.25  # below, chance may put the squares beyond noise anywhere


@dataclass(frozen=True)
class Part:
    """The samples whose `channel` lies in [low, high], or outside of it; shares of the mismatch and of the samples."""

    channel: str
    low: float
    high: float
    inside: bool
    share: float
    samples: float

    @property
    def entry(self) -> dict[str, Any]:
        """For diagnosis.json."""
        return {
            "channel": self.channel,
            "where": "inside" if self.inside else "outside",
            "interval": [self.low, self.high],
            "share_of_mismatch": round(min(self.share, 1.0), 3),  # noise left the rest below nothing
            "share_of_samples": round(self.samples, 3),
        }


def concentrated(inputs: Mapping[str, FloatArray], squares: FloatArray, noise: float) -> Part | None:
    """The part of one input (N,) that holds nearly all of the `squares` (N,) beyond `noise`, or None.

    noise: the mean square that the sensors alone would make. Of several, the one with the fewest samples.
    """
    beyond = squares - noise
    if len(squares) < FEWEST_SAMPLES or beyond.mean() <= LEAST * noise:
        return None
    parts = [_part(name, values, beyond) for name, values in inputs.items()]
    found = [part for part in parts if part is not None and part.samples <= FEW]
    return min(found, key=lambda part: part.samples, default=None)


def _part(name: str, values: FloatArray, beyond: FloatArray) -> Part | None:
    edges = np.unique(np.quantile(values, np.linspace(0, 1, BINS + 1)))
    if len(edges) < 3:
        return None
    which = np.clip(np.searchsorted(edges, values, side="right") - 1, 0, len(edges) - 2)
    share = np.bincount(which, weights=beyond, minlength=len(edges) - 1) / beyond.sum()
    samples = np.bincount(which, minlength=len(edges) - 1) / len(values)
    held, many = (np.concatenate([[0.0], np.cumsum(part)]) for part in (share, samples))
    first, last = np.triu_indices(len(edges), 1)  # bins first ... last - 1
    within, count = held[last] - held[first], many[last] - many[first]
    options = [
        _named(name, edges, (int(i), int(j)), inside, (float(s), float(n)))
        for inside, shares, counts in ((True, within, count), (False, 1.0 - within, 1.0 - count))
        for k in [int(np.argmin(np.where(shares >= MOST_OF_IT, counts, np.inf)))]
        for i, j, s, n in [(first[k], last[k], shares[k], counts[k])]
        if s >= MOST_OF_IT and n > 0.0
    ]
    return min(options, key=lambda part: part.samples, default=None)


def _named(
    name: str, edges: FloatArray, ends: tuple[int, int], inside: bool, shares: tuple[float, float]
) -> Part:
    """Outside an interval that reaches to the end of what was visited is inside the rest."""
    first, last = ends
    if not inside and first == 0:
        first, last, inside = last, len(edges) - 1, True
    elif not inside and last == len(edges) - 1:
        first, last, inside = 0, first, True
    return Part(name, float(edges[first]), float(edges[last]), inside, *shares)
