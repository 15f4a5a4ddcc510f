"""The chi square distribution whose centre is off."""

from __future__ import annotations

import numpy as np
from scipy.special import chdtrc, gammaln, xlogy


def beyond(square: float, freedom: int, shift: float) -> float:
    """How probable a chi square of so much `freedom`, its centre off by `shift`, is to be more than `square`.

    The sum of Fisher (1928): central ones of two degrees more each, weighed by Poisson's law; none of its terms is
    negative, so that it is good to the last digits far out, too. SciPy's own takes half a second to be imported.
    """
    middle = max(square, shift) / 2
    pairs = np.arange(int(middle + 10 * np.sqrt(middle)) + 50)
    weights = np.exp(xlogy(pairs, shift / 2) - shift / 2 - gammaln(pairs + 1))
    return float(weights @ chdtrc(freedom + 2 * pairs, square))
