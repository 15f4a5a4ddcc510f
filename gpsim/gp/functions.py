"""Functions drawn from the posterior of Gaussian processes: the same input gives the same value, call after call.

Wilson et al. (2020), "Efficiently sampling functions from Gaussian process posteriors": a function of the prior, its
RBF part by random Fourier features (Rahimi and Recht 2007), moved by what the data say of its values at the training
inputs (Matheron's rule). Replicates that a fit averaged count as one row here: functions vary a little more there.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from .kernels import FloatArray, covariance
from .predictor import Output, Predictor

FEATURES = 256
"""Fourier features: the covariance is off by 1 / sqrt of it, of the prior's variance."""
CHUNK = 4096
"""Rows that are worked on at once."""


class DrawnFunctions:
    """So many functions of every output, drawn once."""

    def __init__(self, predictor: Predictor, count: int, rng: np.random.Generator) -> None:
        self.count = count
        self._drawn = tuple((output, *_drawn(output, count, rng)) for output in predictor.outputs)

    def __call__(self, inputs: FloatArray, which: Sequence[int] | FloatArray) -> FloatArray:
        """(B, R): at each raw input (B, D) the function `which` (B,) of every output."""
        chosen = np.asarray(which, dtype=np.int64)[:, None]
        out = np.empty((len(inputs), len(self._drawn)))
        for start in range(0, len(inputs), CHUNK):
            part = slice(start, start + CHUNK)
            for r, (output, frequencies, phases, prior, update) in enumerate(self._drawn):
                own = output.standardisation
                z = own.inputs(inputs[part])
                values = _features(z, frequencies, phases) @ prior
                values += covariance(z, output.terms.support, output.hyper_parameters) @ update
                values = own.target_mean + own.target_scale * values
                out[part, r] = np.take_along_axis(values, chosen[part], axis=1)[:, 0]
        return out


def _drawn(
    output: Output, count: int, rng: np.random.Generator
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Frequencies and phases of the features, their weights (F + D + 1, K) and those of the covariances (M, K)."""
    hyper, terms = output.hyper_parameters, output.terms
    frequencies = rng.standard_normal((hyper.dimension, FEATURES)) / hyper.lengthscales[:, None]
    phases = rng.uniform(0.0, 2.0 * np.pi, FEATURES)
    deviations = np.concatenate(
        [np.full(FEATURES, hyper.signal_std * np.sqrt(2.0 / FEATURES)), hyper.linear_stds, [hyper.bias_std]]
    )
    prior = deviations[:, None] * rng.standard_normal((len(deviations), count))
    at_support = _features(terms.support, frequencies, phases) @ prior
    noisy = at_support + hyper.noise_std * rng.standard_normal(at_support.shape)
    return frequencies, phases, prior, terms.weights[:, None] - terms.root @ (terms.root.T @ noisy)


def _features(z: FloatArray, frequencies: FloatArray, phases: FloatArray) -> FloatArray:
    """(B, F + D + 1): what a function of the prior is linear in, of standardised inputs (B, D)."""
    return np.hstack([np.cos(z @ frequencies + phases), z, np.ones((len(z), 1))])
