"""Where in state, action and time a mismatch lives: the part that holds nearly all of it and few of the samples."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from gpsim.channels import FloatArray
from gpsim.diagnosis.report import Concentration

INPUT_BINS = 40  # of equal numbers of samples, into which an input is cut
FEWEST_SAMPLES = 400  # samples with fewer, chance may put a mismatch anywhere
LEAST_MISMATCH = 0.25  # of the noise's mean square, that the mismatch's must be
LEAST_HELD = 0.9  # of the mismatch, that a part must hold
FEW_SAMPLES = 0.35  # of the samples, that such a part may hold at most
MANY_SAMPLES = 0.8  # of the samples, that it may hold where its edges are sharp, as an onset's are
SHARP_EDGE = 0.5  # of the density within, that the mismatch must have at such edges
MOST_OUTSIDE = 0.1  # of the density within, that it may have outside
EDGE_BINS = 2  # bins that make an edge


@dataclass(frozen=True)
class Part:
    """The samples whose `channel` lies in [low, high], or outside of it; shares of the mismatch and of the samples.

    age: whether `channel` is no channel but how long ago something happened.
    """

    channel: str
    low: float
    high: float
    inside: bool
    share: float
    samples: float
    age: bool = False

    def of(self, rate: str) -> Concentration:
        """As the mismatch of this rate is reported."""
        return Concentration(
            rate,
            self.channel,
            "inside" if self.inside else "outside",
            (self.low, self.high),
            share_of_mismatch=round(min(self.share, 1.0), 3),  # noise left the rest below nothing
            share_of_samples=round(self.samples, 3),
        )


def concentrated(
    inputs: Mapping[str, FloatArray],
    squares: FloatArray,
    noise: float,
    ages: Mapping[str, FloatArray] | None = None,
) -> Part | None:
    """The part of one input (N,) that holds nearly all of the `squares` (N,) beyond `noise`, or None.

    ages: more inputs, (N,) s since something happened, of which only what is soon after it counts. noise: the mean
    square that the sensors alone would make. Of several, the one with the fewest samples. A part with many samples
    counts where its edges are sharp, as those of an onset are: a law that grows steadily has none.
    """
    beyond = squares - noise
    if len(squares) < FEWEST_SAMPLES or beyond.mean() <= LEAST_MISMATCH * noise:
        return None
    parts = [_part(name, values, beyond) for name, values in inputs.items()]
    found = [part for part in parts if part is not None]
    for name, age in (ages or {}).items():
        part = _part(name, age, beyond)
        if part is not None and part.inside and part.low == age.min():
            found.append(replace(part, age=True))
    return min(found, key=lambda part: part.samples, default=None)


def _part(name: str, values: FloatArray, beyond: FloatArray) -> Part | None:
    """The smallest part that holds nearly all, if it is small; else the one that stands out most, if it is sharp."""
    edges = np.unique(np.quantile(values, np.linspace(0, 1, INPUT_BINS + 1), method="inverted_cdf"))
    if len(edges) < 3:
        return None
    which = np.clip(np.searchsorted(edges, values, side="right") - 1, 0, len(edges) - 2)
    share = np.bincount(which, weights=beyond, minlength=len(edges) - 1) / beyond.sum()
    samples = np.bincount(which, minlength=len(edges) - 1) / len(values)
    held, many = (np.concatenate([[0.0], np.cumsum(part)]) for part in (share, samples))
    first, last = np.triu_indices(len(edges), 1)  # bins first ... last - 1
    within, count = held[last] - held[first], many[last] - many[first]
    parts = [(True, within, count), (False, 1.0 - within, 1.0 - count)]

    def named(k: int, inside: bool, shares: FloatArray, counts: FloatArray) -> Part:
        return _named(
            name, edges, (int(first[k]), int(last[k])), inside, (float(shares[k]), float(counts[k]))
        )

    found = []
    for inside, shares, counts in parts:
        whole = (shares >= LEAST_HELD) & (counts > 0.0)
        costs = np.where(whole & (counts <= FEW_SAMPLES), counts, np.inf)
        k = int(np.argmin(costs))
        if np.isfinite(costs[k]):
            found.append(named(k, inside, shares, counts))
    if found:
        return min(found, key=lambda part: part.samples)
    for inside, shares, counts in parts:
        # Squares of the best fit by one level in the part and none elsewhere.
        squares = shares**2 / np.maximum(counts, 1e-300)
        whole = (shares >= LEAST_HELD) & (counts > 0.0)
        worth = np.where(whole & (counts <= MANY_SAMPLES), squares, -np.inf)
        k = int(np.argmax(worth))
        ends = int(first[k]), int(last[k])
        if np.isfinite(worth[k]) and _is_sharp(share / samples, samples, ends, inside):
            found.append(named(k, inside, shares, counts))
    return min(found, key=lambda part: part.samples, default=None)


def _is_sharp(
    density: FloatArray,
    samples: FloatArray,
    ends: tuple[int, int],
    inside: bool,
) -> bool:
    """Whether a part of the bins is as dense at its edges as within, and next to nothing lies outside."""
    edge, part = EDGE_BINS, np.zeros(len(density), dtype=np.bool_)
    part[ends[0] : ends[1]] = True
    part = part if inside else ~part
    level = float(np.average(density[part], weights=samples[part]))
    cuts = np.flatnonzero(part[1:] != part[:-1])  # between bins cut and cut + 1
    sides = [np.arange(c - edge + 1, c + 1) if part[c] else np.arange(c + 1, c + 1 + edge) for c in cuts]
    near = [side[(side >= 0) & (side < len(part))] for side in sides]
    dense = all(density[side[part[side]]].mean() >= SHARP_EDGE * level for side in near)
    outside = float(np.average(density[~part], weights=samples[~part])) if dense else np.inf
    return dense and outside <= MOST_OUTSIDE * level


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
