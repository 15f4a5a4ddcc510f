"""How a policy does where it does worst: the mean of the worst tenth of its episodes beside the mean of all."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from gpsim.channels import FloatArray
from gpsim.evaluation.statistics import bootstrap_interval

TENTH = 0.1


def worst_tenth(returns: FloatArray) -> float:
    """The mean of the lowest tenth, of one episode at least (the conditional value at risk)."""
    flat = np.sort(np.asarray(returns, dtype=np.float64).ravel())
    return float(flat[: max(1, round(TENTH * flat.size))].mean())


def mean_and_worst(returns: FloatArray) -> dict[str, Any]:
    """Mean and worst tenth of returns (N,), each with the 95 % bootstrap interval over starts."""
    one = returns[None]
    return {
        "mean": float(returns.mean()),
        "interval": list(bootstrap_interval(one, lambda r: float(r.mean()))),
        "worst_tenth": worst_tenth(returns),
        "worst_tenth_interval": list(bootstrap_interval(one, worst_tenth)),
        "episodes": int(returns.size),
    }


def robustness_lines(found: Mapping[str, Mapping[str, Mapping[str, Any]]]) -> list[str]:
    """A line a policy and place."""
    return [
        f"on {'the target' if where == 'target' else 'draws of the posterior'}, {name}: mean {of['mean']:.1f}, worst "
        f"tenth {of['worst_tenth']:.1f} ({of['worst_tenth_interval'][0]:.1f} to {of['worst_tenth_interval'][1]:.1f})"
        for where, policies in found.items()
        for name, of in policies.items()
    ]
