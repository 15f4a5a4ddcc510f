"""Chained Gaussian processes: a slow one and a fast one, each fitted to what the other leaves (thesis, section 5.3).

A machine may lack physics of several scales at once. One process must find a single length for each input; here the
slow one may not turn quickly and the fast one may not turn slowly, and backfitting (Hastie and Tibshirani 1990) shares
the residual out between them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from .fitting import FitSettings, GaussianProcess, fit_outputs
from .kernels import FloatArray, Interval
from .predictor import Predictor


@dataclass(frozen=True)
class ChainSettings:
    """least_slow, most_fast: lengths, in standard deviations of an input; rounds: times that both are fitted."""

    least_slow: float = 1.0
    most_fast: float = 1.0
    rounds: int = 2

    def __post_init__(self) -> None:
        if min(self.least_slow, self.most_fast) <= 0.0:
            raise ValueError("least_slow and most_fast must be positive")
        if self.rounds < 1:
            raise ValueError(f"rounds must be at least 1, got {self.rounds}")

    def of_slow(self, settings: FitSettings) -> FitSettings:
        """The settings of a process that may not turn quickly; raises ValueError where no length is left."""
        return _within(settings, self.least_slow, np.inf)

    def of_fast(self, settings: FitSettings) -> FitSettings:
        """The settings of a process that may not turn slowly; raises ValueError where no length is left."""
        return _within(settings, 0.0, self.most_fast)


def _within(settings: FitSettings, least: float, most: float) -> FitSettings:
    """With lengths between these, too."""
    given = settings.bounds.lengthscales
    lengths = Interval(max(given.low, least), min(given.high, most))
    return replace(settings, bounds=replace(settings.bounds, lengthscales=lengths))


class ChainedPredictor(Predictor):
    """The sum of several predictors over the same inputs; the noise is what the last one leaves.

    Variances add up, as of processes that are fitted each to what the others leave and know nothing of their doubts.
    """

    def __init__(self, parts: Sequence[Predictor]) -> None:
        """ValueError where the parts disagree on inputs or outputs."""
        if len({(part.dimension, len(part.outputs)) for part in parts}) != 1:
            raise ValueError("the parts of a chain need the same inputs and outputs")
        self.parts = tuple(parts)
        self.dimension, self.noise_variances = parts[-1].dimension, parts[-1].noise_variances

    def mean(self, inputs: ArrayLike) -> FloatArray:
        """The sum of the means: raw inputs (B, D) -> (B, R)."""
        return np.asarray(sum(part.mean(inputs) for part in self.parts))

    def mean_and_variance(self, inputs: ArrayLike) -> tuple[FloatArray, FloatArray]:
        """The sums of means and latent variances: raw inputs (B, D) -> (B, R) and (B, R)."""
        found = [part.mean_and_variance(inputs) for part in self.parts]
        return np.asarray(sum(mean for mean, _ in found)), np.asarray(sum(variance for _, variance in found))


def fit_chain(
    inputs: FloatArray,
    targets: FloatArray,
    settings: FitSettings,
    chain: ChainSettings,
    rng: np.random.Generator,
) -> tuple[ChainedPredictor, tuple[GaussianProcess, ...], tuple[GaussianProcess, ...]]:
    """The sum of a slow and a fast process for each output of the targets (N, R), and the processes of both."""
    slow_settings, fast_settings = chain.of_slow(settings), chain.of_fast(settings)
    fast_mean = np.zeros_like(targets)
    for _ in range(chain.rounds):
        slow = fit_outputs(inputs, targets - fast_mean, slow_settings, rng)
        slow_part = Predictor(slow)
        fast = fit_outputs(inputs, targets - slow_part.mean(inputs), fast_settings, rng)
        fast_part = Predictor(fast)
        fast_mean = fast_part.mean(inputs)
    return ChainedPredictor([slow_part, fast_part]), slow, fast
