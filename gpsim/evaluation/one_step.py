"""Layer 1: how well the correction predicts one step (thesis, section 4.3.2 and Table 4.3)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from gpsim.channels import FloatArray, IntArray
from gpsim.evaluation.statistics import nrmse, r2

LEVELS = (0.5, 0.9, 0.99)
MUCH_OUTSIDE = 0.1
"""Share of a deployed policy's transitions outside the recording from which on it is a warning."""


@dataclass(frozen=True)
class OneStep:
    """Residuals of target transitions, and what the GPs say of them.

    actual, mean: (N, R) rates; latent_variance: (N, R) of the function, noise_variance: (R,) on top of it;
    episode: (N,) index.
    """

    actual: FloatArray
    mean: FloatArray
    latent_variance: FloatArray
    noise_variance: FloatArray
    episode: IntArray

    def scores(self, rate: int, rng: np.random.Generator, *, sample_noise: bool) -> dict[str, Any]:
        """Scores of the mean and of a sample of one rate, with the quality of the predicted distribution.

        NRMSE divides by the range of the pooled residual (a per-episode range divides by nearly nothing); its
        spread is the standard deviation over episodes of the error on that same range.
        """
        from scipy.stats import norm  # here: most commands need not wait for it

        actual, mean = self.actual[:, rate], self.mean[:, rate]
        observed = np.sqrt(self.latent_variance[:, rate] + self.noise_variance[rate])
        drawn = observed if sample_noise else np.sqrt(self.latent_variance[:, rate])
        sample = mean + drawn * rng.standard_normal(len(mean))
        coverage = {}
        for level in LEVELS:
            half = norm.ppf(0.5 + level / 2) * observed
            coverage[f"{level:g}"] = float(np.mean(np.abs(actual - mean) <= half))
        return {
            "mean": self._errors(mean, actual),
            "sample": self._errors(sample, actual),
            "negative_log_likelihood": float(-np.mean(norm.logpdf(actual, mean, observed))),
            "coverage": coverage,
            "predicted_std": float(np.sqrt(np.mean(observed**2))),
            "range": float(np.ptp(actual)),
        }

    def _errors(self, predicted: FloatArray, actual: FloatArray) -> dict[str, float]:
        pooled = float(np.ptp(actual))
        masks = [self.episode == i for i in np.unique(self.episode)]
        by_episode = [nrmse(predicted[mask], actual[mask], pooled) for mask in masks]
        return {
            "nrmse": nrmse(predicted, actual),
            "nrmse_std": float(np.std(by_episode)),
            "r2": r2(predicted, actual),
            "rmse": float(np.sqrt(np.mean((predicted - actual) ** 2))),
        }


def outside_range(visited: FloatArray, training: FloatArray) -> float:
    """Share of the visited inputs (N, D) with a column outside the range of the training inputs (M, D).

    There a Gaussian process extrapolates, and its mean falls back to the prior's.
    """
    outside = (visited < training.min(axis=0)) | (visited > training.max(axis=0))
    return float(np.mean(outside.any(axis=1)))


def coverage_warnings(outside: Mapping[str, float | None]) -> list[str]:
    """What to say where the deployed policy goes where nothing was recorded; `outside`: driver to `outside_range`."""
    share = outside.get("deployed")
    if share is None or not share > MUCH_OUTSIDE:
        return []
    return [
        f"{100.0 * share:.0f} % of what the deployed GP policy visits on the target lies outside the range of the "
        "recording, where the Gaussian processes only extrapolate: record more of it (collect.episodes, "
        "collect.policy=dithered)"
    ]
