"""Model error: what physics without a name may have done to a size, which no scatter of the data shows.

What is left after a fit is what no named effect could take. What they did take of it went into their sizes, the same
way everywhere, so that neither windows nor runs of them disagree (Kennedy and O'Hagan 2001: a model's inadequacy is no
noise). How much that is was measured on rough worlds, which hold two to four nuisances outside the catalogue.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from scipy.special import ndtri

from gpsim.channels import FloatArray
from gpsim.diagnosis.settings import IntervalSettings
from gpsim.effects import EffectParameter


def model_error(left: float, settings: IntervalSettings) -> float:
    """Standard deviation of a size, as a share of what it does. left: share of the mismatch that has no name.

    Shares are of squares, hence the root: what bends a size is as large as what is left, times a number.
    """
    return settings.model_error * math.sqrt(max(left, 0.0))


def with_model_error(
    bounds: FloatArray, values: FloatArray, declared: Sequence[EffectParameter], error: float, level: float
) -> FloatArray:
    """(P, 2): the intervals (P, 2) of one effect's values (P,), widened by a model error, within what may be.

    Sizes are told from the value at which they do nothing. Where something acts (a rest position) has none: it is
    widened as many times as the size beside it that widens most.
    """
    sides = np.abs(bounds - values[:, None])
    sizes = np.abs(values - np.array([p.none for p in declared]))
    wide = np.hypot(sides, ndtri(0.5 + level / 2) * error * sizes[:, None])
    places = np.array([p.place for p in declared])
    if places.any():
        own = np.maximum(sides.max(axis=1), np.finfo(float).tiny)
        times = (wide.max(axis=1) / own)[~places].max(initial=1.0)
        wide[places] = sides[places] * times
    low, high = (np.array([getattr(p, end) for p in declared]) for end in ("low", "high"))
    return np.stack([np.maximum(values - wide[:, 0], low), np.minimum(values + wide[:, 1], high)], axis=1)
