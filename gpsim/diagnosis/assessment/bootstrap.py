"""Errors, and how much smaller than the base simulator's they are, with paired bootstrap intervals."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from gpsim.channels import FloatArray
from gpsim.diagnosis.data import rms
from gpsim.diagnosis.report import Kind, OverBefore, Ratio, Share

BLOCK = 25  # samples in a row that are drawn together (a usual window)
FEWEST_BLOCKS = 8  # shorter ones are drawn, or no interval is told, where there are fewer [blocks]
DRAWS = 400  # of all blocks
LOW = 0.05  # quantile of the draws that is the interval's lower end (usual: 90 %)
HIGH = 0.95  # quantile of the draws that is its upper end (usual: 90 %)

MODELS: tuple[Kind, ...] = ("before", "tuned", "gp", "after", "after_gp")


def over_before(
    errors: Mapping[str, FloatArray],
    rng: np.random.Generator,
    *,
    correlated: bool = True,
) -> OverBefore:
    """Each model's root mean square over the base's, with its 90 % interval.

    A paired bootstrap over blocks of neighbouring samples (Kuensch 1989), or over samples if they are not `correlated`.
    Errors: (N,) each; the interval is None where there are too few.
    """
    sums = _by_block(errors, correlated)
    drawn = rng.integers(0, len(sums["before"]), (DRAWS, len(sums["before"])))
    base = sums["before"]

    def ratio(kind: Kind) -> Ratio:
        ratios = np.sqrt(sums[kind][drawn].sum(axis=1) / np.maximum(base[drawn].sum(axis=1), 1e-300))
        low, high = np.quantile(ratios, [LOW, HIGH])
        known = len(base) >= FEWEST_BLOCKS and bool(np.isfinite(high))
        value = rms(errors[kind]) / max(rms(errors["before"]), 1e-300)
        return Ratio(value, float(low) if known else None, float(high) if known else None)

    return OverBefore(**{kind: ratio(kind) for kind in MODELS[1:]})


def share_explained(errors: Mapping[str, FloatArray], rng: np.random.Generator) -> Share | None:
    """Which share of the base's squared errors beyond those of noise the effects take off; None where it has none.

    errors: (N,) of `before`, `after` and `noise_floor`, blocks of which are drawn as in `over_before`.
    """
    sums = _by_block(errors, correlated=True)
    drawn = rng.integers(0, len(sums["before"]), (DRAWS, len(sums["before"])))
    excess, left = (sums[kind] - sums["noise_floor"] for kind in ("before", "after"))
    if excess.sum() <= 0.0:
        return None
    shares = 1.0 - left[drawn].sum(axis=1) / np.maximum(excess[drawn].sum(axis=1), 1e-300)
    low, high = np.quantile(np.clip(shares, 0.0, 1.0), [LOW, HIGH])
    known = len(excess) >= FEWEST_BLOCKS
    share = float(np.clip(1.0 - left.sum() / excess.sum(), 0.0, 1.0))
    return Share(share, float(low) if known else None, float(high) if known else None)


def _by_block(errors: Mapping[str, FloatArray], correlated: bool) -> dict[str, FloatArray]:
    """Sums of squares of each model's errors (N,) in blocks of neighbours."""
    count = len(errors["before"])
    block = max(1, min(BLOCK, count // FEWEST_BLOCKS)) if correlated else 1
    which = np.arange(count) // block
    return {kind: np.asarray(np.bincount(which, weights=e**2), dtype=float) for kind, e in errors.items()}
